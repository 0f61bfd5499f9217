"""ROS 2 topics, transforms and the service over DDS, read by a second process; types and bytes against others'."""

import itertools
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, a_reading, film, frames, pipeline, wait_for

from cad.errors import ParameterError
from sensing.camera.mount import rotation_matrix
from sensing.live.outputs.ros import types as ros

cyclonedds = pytest.importorskip("cyclonedds")
from sensing.live.outputs.ros import dds, messages  # noqa: E402
from sensing.live.outputs.ros.environment import dds_configuration, domain_id  # noqa: E402
from sensing.live.outputs.ros.frames import transforms_of  # noqa: E402
from sensing.live.outputs.ros.topics import ROOM, TOPICS, RosTopics  # noqa: E402
from sensing.live.outputs.ros.wall_clock import WallClock  # noqa: E402

ROOT = Path(__file__).resolve().parents[3]
SUBSCRIBER = """
import json, sys, time
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros import dds, messages
from sensing.live.outputs.ros.topics import TOPICS
from sensing.live.outputs.ros.topics import _participant
participant, owner = _participant(int(sys.argv[1]))
messages.register_trigger()
def reader(topic, kind, **more):
    qos = dds.quality(**more)
    return DataReader(participant, Topic(participant, topic, dds.idl_type(kind), qos=qos), qos=qos)
readers = {name: reader(f"rt/endcap_0/{name}", kind) for name, kind in TOPICS.items()}
replies = reader("rr/endcap_0/zeroReply", messages.TRIGGER_REPLY)
kind, qos = dds.idl_type(messages.TRIGGER_REQUEST), dds.quality()
requests = DataWriter(participant, Topic(participant, "rq/endcap_0/zeroRequest", kind, qos=qos), qos=qos)
print("ready", flush=True)
end, got, hashes, asked = time.monotonic() + float(sys.argv[2]), {}, {}, False
while (len(got) < len(readers) + 1 or len(hashes) < len(readers)) and time.monotonic() < end:
    for name, each in readers.items():
        for sample in each.take(10):
            got[name] = sample
        for handle in each.get_matched_publications():
            found = each.get_matched_publication_data(handle)
            if found is not None:
                hashes[name] = [bytes(p.data).decode() for p in found.qos if type(p).__name__.endswith("Userdata")]
    if got and requests.get_matched_subscriptions() and replies.get_matched_publications() and not asked:
        asked = kind(guid=77, seq=5, structure_needs_at_least_one_member=0)
        asked.cdr = ros.encode(messages.TRIGGER_REQUEST, ros.typestore().types[messages.TRIGGER_REQUEST](77, 5, 0))
        requests.write(asked)
    for sample in replies.take(1):
        got["zero"] = sample
    time.sleep(0.01)
transforms = reader("rt/tf_static", messages.TRANSFORMS, latched=True)  # late: it must still get them
while not (late := transforms.take(1)) and time.monotonic() < end:
    time.sleep(0.01)
full, info, zero = got["wrench/with_covariance"], got["camera_info"], got["zero"]
plain = got["wrench/wrench_pred"]
print(json.dumps({
    "frame": plain.header.frame_id, "sec": plain.header.stamp.sec, "hashes": hashes,
    "force": [plain.wrench.force.x, plain.wrench.force.y, plain.wrench.force.z],
    "torque": [plain.wrench.torque.x, plain.wrench.torque.y, plain.wrench.torque.z],
    "norm": got["wrench/force_norm"].data, "contact": bool(got["contact"].data),
    "cells": len(got["array/shear_vector"].data), "sizes": [d.size for d in got["array/shear_vector"].layout.dim],
    "covariance": list(full.covariance), "valid": bool(full.valid), "state": full.state, "touching": full.contact,
    "jpeg": len(got["image/compressed"].data), "k": list(info.k), "d": list(info.d), "model": info.distortion_model,
    "size": [info.width, info.height], "camera_frame": info.header.frame_id,
    "zero": [zero.guid, zero.seq, bool(zero.success), zero.message],
    "transforms": [[t.header.frame_id, t.child_frame_id, t.transform.translation.z] for t in late[0].transforms],
}), flush=True)
"""


@pytest.mark.long
def test_a_second_process_sees_topics_transforms_and_the_service(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    domain = 1 + os.getpid() % 100  # beside other runs on this computer
    other = subprocess.Popen(
        [sys.executable, "-c", SUBSCRIBER, str(domain), str(PATIENCE_S)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert other.stdout.readline() == "ready\n"
    pipe, reading = a_reading()
    begin_s = time.time()
    topics = RosTopics([pipe], domain)
    topics.start()
    end = time.monotonic() + PATIENCE_S
    while other.poll() is None and time.monotonic() < end:
        topics.put(reading)
        time.sleep(0.05)
    topics.close(PATIENCE_S)
    assert topics.failed == ""
    seen = json.loads(other.stdout.read())
    assert seen["force"] == reading.wrench.force_n.tolist() and seen["torque"] == reading.wrench.torque_nm.tolist()
    assert seen["norm"] == pytest.approx(np.linalg.norm(reading.wrench.force_n)) and seen["contact"] is True
    assert seen["frame"] == "endcap_0" and begin_s - 1 <= seen["sec"] <= time.time()
    assert seen["cells"] == 512 and seen["sizes"] == [2, 16, 16]
    assert seen["covariance"] == reading.wrench.covariance.ravel().tolist() and seen["valid"] is True
    assert seen["state"] == "running" and seen["touching"] == messages.CONTACT_TOUCHING
    assert seen["jpeg"] == len(reading.frame.jpeg)
    camera = pipe.camera(640, 480).camera
    assert seen["k"][0] == camera.fx_px and seen["k"][2] == camera.cx_px and seen["d"] == list(camera.k)
    assert (seen["model"], seen["size"], seen["camera_frame"]) == ("equidistant", [640, 480], "endcap_0_camera")
    guid, number, success, message = seen["zero"]
    assert (guid, number, success) == (77, 5, False) and "touched with" in message
    assert seen["hashes"] == {name: [f"typehash={ros.type_hash(kind)};"] for name, kind in TOPICS.items()}
    place = pipe.camera(640, 480).pupil_endcap_mm[2] / 1e3
    assert seen["transforms"] == [["endcap_0", "endcap_0_camera", pytest.approx(place)]]


def test_bytes_of_every_topic_are_those_of_another_implementation():
    pipe, reading = a_reading()
    topics = RosTopics([pipe], 0)
    topics._looked_at["endcap_0"] = True
    found = dict(topics._encoded(reading, 1_700_000_000_123_456_789))
    found["tf"] = messages.transforms(transforms_of([pipe]), 0)
    assert set(found) == {*TOPICS, "tf"}
    for name, cdr in found.items():  # rosbags wrote them, Cyclone DDS reads and writes them
        kind = dds.idl_type(TOPICS.get(name, messages.TRANSFORMS))
        assert kind.__idl__.serialize(kind.deserialize(cdr)).rstrip(b"\0") == cdr.rstrip(b"\0"), name


@pytest.mark.parametrize(
    ("heights_mm", "placed"),
    [([0], set()), ([0, 0], set()), ([0, 100], {"endcap_0", "endcap_1"}), ([0, 0, 100], {"endcap_2"})],
)
def test_only_endcaps_whose_place_is_stated_stand_in_the_robots_frame(heights_mm, placed):
    def at(number: int, height_mm: float) -> SimpleNamespace:
        place = np.eye(4)
        place[2, 3] = height_mm
        return SimpleNamespace(
            endcap=replace(pipe.endcap, name=f"endcap_{number}", T_robot_endcap=place), camera=pipe.camera
        )

    pipe, _ = a_reading()
    found = transforms_of([at(number, height_mm) for number, height_mm in enumerate(heights_mm)])
    assert {child for child, (parent, _) in found.items() if parent == "robot"} == placed


@pytest.mark.parametrize("size", [(640, 16864), (320, 240)])
def test_a_picture_of_another_size_has_no_camera_and_stops_nothing(size, monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    pipe, reading = a_reading()
    topics = RosTopics([pipe], 0)
    other = replace(reading, frame=replace(reading.frame, size=size))
    found = [set(dict(topics._encoded(each, 0))) for each in (reading, other, reading)]
    assert found[0] - found[1] == {"camera_info"} and found[2] == found[0]


@pytest.mark.parametrize("set_by_s", [0.02, -0.08, 3600.0])
def test_stamps_follow_a_wall_clock_that_is_set(set_by_s, monkeypatch):
    clock, real = WallClock(), time.time_ns
    before_ns = clock.stamp_ns(100.0)
    monkeypatch.setattr(time, "time_ns", lambda: real() + int(set_by_s * 1e9))
    assert abs(clock.stamp_ns(100.0) - before_ns - set_by_s * 1e9) < 5e6


def test_a_thread_that_waits_between_two_clocks_moves_no_stamp(monkeypatch):
    """Beside three busy threads one look in some 40,000 is off by over a millisecond, up to 118."""
    clock, looks = WallClock(), itertools.count()
    before_ns, real = clock.stamp_ns(100.0), time.time_ns

    def waits():
        now_ns = real()
        time.sleep(0.15 * (next(looks) % 3 == 0))
        return now_ns

    monkeypatch.setattr(time, "time_ns", waits)
    assert clock.stamp_ns(100.0) == before_ns


def test_types_have_the_names_and_hashes_of_ros():
    assert dds.idl_type(ros.WRENCH).__idl__.idl_transformed_typename == "geometry_msgs::msg::dds_::WrenchStamped_"
    assert ros.type_hash(ros.WRENCH) == "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77"
    assert ros.type_hash(ros.STRING) == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_a_zero_is_answered_when_it_is_taken(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    pipe = pipeline()
    rest = frames(film([0] * 60))
    for frame in rest[:4]:
        pipe.update(frame, time.monotonic())
    topics, said = RosTopics([pipe], 0), []
    end = topics._services._ends[0]

    waiting = [dds.idl_type(messages.TRIGGER_REQUEST)(guid=1, seq=2, structure_needs_at_least_one_member=0)]

    class Requests:
        def take(self, count):
            return [waiting.pop()] if waiting else []

    class Replies:
        def write(self, message):
            said.append(ros.decode(messages.TRIGGER_REPLY, message.cdr))

    topics._services._ends = [type(end)(pipe, Requests(), Replies())]
    before = pipe.zero
    topics._services._look()
    assert said == []
    for frame in rest[4:]:
        pipe.update(frame, time.monotonic())
        pipe.taker.close(PATIENCE_S)  # the reference is made in a thread of its own
        pipe.taker._stopped = False
    topics._services._look()
    assert pipe.zero is not before and [(a.guid, a.seq, a.success) for a in said] == [(1, 2, True)]


def test_an_error_in_diagnostics_or_service_is_noted_and_the_topics_go_on(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")

    class Requests:
        def take(self, count):
            raise ValueError("no request")

    def health():
        raise KeyError("planted")

    pipe, reading = a_reading()
    topics = RosTopics([pipe], 1 + os.getpid() % 100, health)
    (end,) = topics._services._ends
    topics._services._ends = [type(end)(pipe, Requests(), None)]
    topics.start()
    wait_for(lambda: len(topics._errors) == 2)
    assert topics.note.endswith(
        "an error in /diagnostics (KeyError: 'planted'); an error in zero (ValueError: no request)"
    )
    topics.put(reading)
    wait_for(lambda: topics._cameras)  # the last message of a reading has been made
    topics.close(PATIENCE_S)
    assert topics.failed == "" and topics.loss


def test_readings_that_come_too_fast_are_counted_and_said(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    pipe, reading = a_reading()
    topics = RosTopics([pipe], 1 + os.getpid() % 100)
    for _ in range(ROOM + 3):  # its thread has not begun: as slow as can be
        topics.put(reading)
    assert topics.loss.startswith("3 readings not published") and topics.loss in topics.note
    topics.start()
    topics.close(PATIENCE_S)
    assert topics.failed == ""


def test_quaternions_are_those_of_the_rotations():
    rng = np.random.default_rng(5)
    turns = [
        *rng.normal(size=(50, 3)),
        *(np.pi * np.eye(3)),
        np.zeros(3),
        [0.0, np.pi / np.sqrt(2), np.pi / np.sqrt(2)],
    ]
    for turn in turns:
        x, y, z, w = messages.unit_quaternion(R := rotation_matrix(turn))
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        assert np.allclose(np.eye(3) + 2 * w * cross + 2 * cross @ cross, R, atol=1e-12) and w >= 0


@pytest.mark.parametrize(("said", "number"), [("", 0), ("7", 7), ("0x10", 16), ("010", 8), ("232", 232), (None, 0)])
def test_the_domain_is_read_as_ros_reads_it(said, number):
    assert domain_id(None, {} if said is None else {"ROS_DOMAIN_ID": said}) == number


@pytest.mark.parametrize("said", ["233", "-1", "one", "08", "²"])
def test_a_domain_that_is_none_is_refused(monkeypatch, said):
    monkeypatch.setenv("ROS_DOMAIN_ID", said)
    with pytest.raises(ParameterError, match=r"0\.\.232"):
        RosTopics([pipeline()])


def test_the_network_is_that_of_the_environment():
    assert dds_configuration({}) is None and dds_configuration({"ROS_LOCALHOST_ONLY": "0"}) is None
    alone = dds_configuration({"ROS_LOCALHOST_ONLY": "1", "ROS_STATIC_PEERS": "10.0.0.7"})
    assert 'address="127.0.0.1"' in alone and '"localhost"' in alone and "10.0.0.7" not in alone
    assert dds_configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}) == dds_configuration(
        {"ROS_LOCALHOST_ONLY": "1"}
    )
    peers = dds_configuration({"ROS_STATIC_PEERS": "10.0.0.7;robot", "CYCLONEDDS_URI": "file:///a.xml"})
    assert '"10.0.0.7"' in peers and '"robot"' in peers and peers.endswith(",file:///a.xml")
    assert "Peers" not in dds_configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", "ROS_STATIC_PEERS": "a"})
    with pytest.raises(ParameterError, match="LOCALHOST, SUBNET"):
        dds_configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "MOON"})
