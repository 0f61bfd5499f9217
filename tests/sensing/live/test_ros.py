import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, film, frames, pipeline

from cad.errors import ParameterError
from sensing.live.outputs import ros_types as ros

cyclonedds = pytest.importorskip("cyclonedds")
from sensing.live.outputs import dds_types as dds  # noqa: E402
from sensing.live.outputs.ros_topics import RosTopics, topic_types  # noqa: E402

LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>"
)
SUBSCRIBER = """
import json, sys, time
import cyclonedds.idl.types as t
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from sensing.live.outputs.ros_topics import topic_qos, topic_types
participant, qos = DomainParticipant(int(sys.argv[1])), topic_qos()
readers = {
    name: DataReader(participant, Topic(participant, f"rt/endcap_0/{name}", kind, qos=qos), qos=qos)
    for name, kind in topic_types().items()
}
print("ready", flush=True)
got = {}
end = time.monotonic() + float(sys.argv[2])
while len(got) < len(readers) and time.monotonic() < end:
    for name, reader in readers.items():
        for sample in reader.take(10):
            got[name] = sample
    time.sleep(0.01)
wrench = got["wrench/wrench_pred"]
print(json.dumps({
    "frame": wrench.header.frame_id, "sec": wrench.header.stamp.sec,
    "force": [wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z],
    "torque": [wrench.wrench.torque.x, wrench.wrench.torque.y, wrench.wrench.torque.z],
    "norm": got["wrench/force_norm"].data, "contact": bool(got["contact"].data),
    "cells": len(got["array/shear_vector"].data),
    "sizes": [d.size for d in got["array/shear_vector"].layout.dim],
}), flush=True)
"""


def a_reading():
    pipe, found = pipeline(), None
    for frame in frames(film([0, 0, 1.0, 1.0])):
        found = pipe.update(frame, time.monotonic())
    return found


def test_a_second_process_sees_the_topics(monkeypatch):
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    domain = 100 + os.getpid() % 100  # beside other runs on this computer
    root = Path(__file__).resolve().parents[3]
    other = subprocess.Popen(
        [sys.executable, "-c", SUBSCRIBER, str(domain), str(PATIENCE_S)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(root)},
    )
    assert other.stdout.readline() == "ready\n"
    begin_s = time.time()
    topics, reading = RosTopics(("endcap_0",), domain), a_reading()
    topics.start()
    end = time.monotonic() + PATIENCE_S
    while other.poll() is None and time.monotonic() < end:
        topics.put(reading)
        time.sleep(0.05)
    topics.close(PATIENCE_S)
    assert topics.failed == ""
    reported = json.loads(other.stdout.read())
    assert (
        reported["force"] == reading.wrench.force_n.tolist() and reported["torque"] == reading.wrench.torque_nm.tolist()
    )
    assert reported["norm"] == pytest.approx(np.linalg.norm(reading.wrench.force_n)) and reported["contact"] is True
    assert reported["frame"] == "endcap_0" and begin_s - 1 <= reported["sec"] <= time.time()
    assert reported["cells"] == 512 and reported["sizes"] == [2, 16, 16]


def test_types_and_bytes_are_those_of_ros():
    reading = a_reading()
    stamp = 1_700_000_000_123_456_789
    header = dds.Header(dds.Time(stamp // 10**9, stamp % 10**9), "endcap_0")
    force, torque = (dds.Vector3(*part.tolist()) for part in (reading.wrench.force_n, reading.wrench.torque_nm))
    ours = dds.WrenchStamped(header, dds.WrenchBody(force, torque)).serialize()
    assert ours == ros.wrench_stamped(reading.wrench, stamp, "endcap_0")  # rosbags is an implementation of its own
    place = reading.place
    position, quaternion, covariance = (part.ravel().tolist() for part in place.pose())
    pose = dds.PoseWithCovariance(dds.Pose(dds.Point(*position), dds.Quaternion(*quaternion)), covariance)
    assert place.known
    assert dds.PoseWithCovarianceStamped(header, pose).serialize() == ros.pose_stamped(place, stamp, "endcap_0")
    names = {name: kind.__idl__.idl_transformed_typename for name, kind in topic_types().items()}
    assert names["wrench/wrench_pred"] == "geometry_msgs::msg::dds_::WrenchStamped_"
    assert names["array/shear_vector"] == "std_msgs::msg::dds_::Float32MultiArray_"


@pytest.mark.parametrize("reported", ["233", "-1", "one"])
def test_a_domain_that_is_none_is_refused(monkeypatch, reported):
    monkeypatch.setenv("ROS_DOMAIN_ID", reported)
    with pytest.raises(ParameterError, match=r"0\.\.232"):
        RosTopics(("endcap_0",))
