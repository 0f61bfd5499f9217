"""What a run shows: its page on loopback, and its ROS 2 topics as a second process sees them."""

import json
import os
import subprocess
import sys
import time
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from standing_robot import feed, standing_samples

from cad.errors import ParameterError
from sensing.live.outputs.ros import types as ros
from sensing.live.web.process import HEADERS
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import messages
from sensing.robot.node.page import RobotPage, ellipse
from sensing.robot.node.record import Report
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.shape import rotation_of

ROOT, PATIENCE_S = Path(__file__).resolve().parents[3], 180.0
ROBOT = load_robot()
SUBSCRIBER = """
import json, sys, time
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros.messages import TRANSFORMS
from sensing.live.outputs.ros.topics import open_participant
from sensing.robot.node import messages
participant, owner = open_participant(int(sys.argv[1]))
kinds = {"rt/robot/bar/green/odometry": messages.ODOMETRY, "rt/robot/endcaps": messages.POSES,
         "rt/robot/estimate": ros.STRING, "rt/tf": TRANSFORMS}
qos = dds.quality()
readers = {name: DataReader(participant, Topic(participant, name, dds.idl_type(kind), qos=qos), qos=qos)
           for name, kind in kinds.items()}
print("ready", flush=True)
end, got = time.monotonic() + float(sys.argv[2]), {}
while len(got) < len(readers) and time.monotonic() < end:
    for name, reader in readers.items():
        for sample in reader.take(1):
            got[name] = sample
    time.sleep(0.01)
kind, qos = dds.idl_type(TRANSFORMS), dds.quality(latched=True)
late = DataReader(participant, Topic(participant, "rt/tf_static", kind, qos=qos), qos=qos)
while not (mounted := late.take(1)) and time.monotonic() < end:
    time.sleep(0.01)
odometry, poses, text, tf = (got[name] for name in kinds)
place = odometry.pose.pose.position
print(json.dumps({
    "frames": [odometry.header.frame_id, odometry.child_frame_id], "place": [place.x, place.y, place.z],
    "covariance": list(odometry.pose.covariance), "endcaps": [[p.position.x, p.position.y] for p in poses.poses],
    "time_s": json.loads(text.data)["time_s"], "children": [t.child_frame_id for t in tf.transforms],
    "mounted": {t.child_frame_id: [t.header.frame_id, [getattr(t.transform.translation, a) for a in "xyz"],
                                   [getattr(t.transform.rotation, a) for a in "xyzw"]] for t in mounted[0].transforms},
}), flush=True)
"""


@pytest.fixture(scope="module")
def report():
    poses, samples = standing_samples(ROBOT, 1.0)
    estimator = RobotEstimator(ROBOT)
    feed(estimator, samples)
    return Report(estimator.state(), poses, 0.0)


@pytest.fixture
def page():
    served = RobotPage(ROBOT, 0)
    served.start()
    yield served
    served.close()


def asked(url, **headers):
    """(status, headers, body)."""
    for _ in range(500):
        try:
            with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=PATIENCE_S) as answer:
                return answer.status, dict(answer.headers), answer.read()
        except urllib.error.HTTPError as error:
            return error.code, dict(error.headers), error.read()
        except urllib.error.URLError:
            time.sleep(0.02)
    raise AssertionError("no answer")


def test_the_page_shows_the_newest_report(page, report):
    assert json.loads(asked(page.url + "state.json")[2]) is None
    page.report(report)
    state = json.loads(asked(page.url + "state.json")[2])
    assert state["time_s"] == report.estimate.time_s and state["drift_m"] == report.drift_m(ROBOT)
    assert np.shape(state["truth"]) == (3, 4, 4) and len(state["path"]) == len(state["drift"]) == 1
    about = json.loads(asked(page.url + "about.json")[2])
    assert [bar["name"] for bar in about["bars"]] == ["red", "green", "blue"] and len(about["cables"]) == 9
    for name in ("", "robot.js", "scene.js", "theme.css", "robot.css", "favicon.svg"):
        status, headers, body = asked(page.url + name)
        assert status == 200 and body
        assert all(headers[key.lower()] == value for key, value in HEADERS.items())


def test_the_page_is_for_this_computer_and_its_own_scripts(page):
    assert asked(page.url + "state.json", Host="example.org")[0] == 403
    assert asked(page.url, Host="example.org")[0] == 403
    assert asked(page.url + "state.json", Origin="http://example.org")[0] == 403
    assert asked(page.url + "../record.py")[0] == 404


def test_the_ellipse_is_that_of_two_standard_deviations():
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    away = ellipse(np.array([1.0, 2.0]), covariance) - [1.0, 2.0]
    assert np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away) == pytest.approx(4.0)


def test_a_second_process_sees_the_topics(report, monkeypatch):
    pytest.importorskip("cyclonedds")
    from sensing.robot.node.ros_topics import RobotTopics

    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    domain = 101 + os.getpid() % 100  # beside other runs on this computer
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", SUBSCRIBER, str(domain), str(PATIENCE_S)]
    other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    topics = RobotTopics(ROBOT, domain)
    try:
        assert other.stdout.readline() == "ready\n"
        end = time.monotonic() + PATIENCE_S
        while other.poll() is None and time.monotonic() < end:
            topics.report(report)
            time.sleep(0.05)
        found = json.loads(other.stdout.read())
    finally:
        topics.close()
        other.kill()
        other.wait()
    bar = report.estimate.bars[1]
    assert found["frames"] == ["world", "bar_green"] and found["children"] == ["bar_red", "bar_green", "bar_blue"]
    assert found["place"] == bar.T_world_bar[:3, 3].tolist()
    assert found["covariance"] == bar.covariance[:6, :6].ravel().tolist()
    assert found["endcaps"] == [endcap.centre_m[:2].tolist() for endcap in report.estimate.endcaps]
    assert found["time_s"] == report.estimate.time_s
    assert list(found["mounted"]) == [endcap.name for endcap in ROBOT.endcaps]
    for endcap, (parent, place, turn) in zip(ROBOT.endcaps, found["mounted"].values(), strict=True):
        assert parent == f"bar_{endcap.bar}" and place == pytest.approx(endcap.T_bar_endcap[:3, 3])
        assert np.allclose(Rotation.from_quat(turn).as_matrix(), endcap.T_bar_endcap[:3, :3])


@pytest.mark.parametrize(
    ("bars", "said"),
    [
        (("1", "green", "blue"), "1, begins with a digit"),
        (("green 1", "green-1", "blue"), "green_1, stands for another"),
    ],
)
def test_a_bar_whose_topic_no_node_could_read_or_is_anothers_is_refused(bars, said):
    pytest.importorskip("cyclonedds")
    from sensing.robot.node.live import LiveRobot
    from sensing.robot.node.ros_topics import RobotTopics

    named = tuple(replace(bar, name=name) for bar, name in zip(ROBOT.bars, bars, strict=True))
    with pytest.raises(ParameterError, match=said):
        RobotTopics(replace(ROBOT, bars=named))
    sensors = tuple(replace(sensor, name=name) for sensor, name in zip(ROBOT.sensors, bars, strict=True))
    with pytest.raises(ParameterError, match=said):
        LiveRobot(replace(ROBOT, sensors=sensors))


def test_the_covariance_of_a_twist_is_that_of_drawn_turns_and_velocities(report):
    """A velocity in the bar's axes errs with the bar's turn, too: a heading that is not known leaves it as it is."""
    bar, rng = report.estimate.bars[1], np.random.default_rng(0)
    velocity, root = np.array([0.4, -0.2, 0.1]), 0.01 * rng.normal(size=(9, 9))
    root[5] += 0.05 * rng.normal(size=9)
    root[6:8] += np.outer([-velocity[1], velocity[0]], root[5])  # the velocity turns with the heading
    moving = replace(bar, velocity_m_s=velocity, covariance=root @ root.T, bar_rate_covariance=np.diag([1.0, 4.0, 9.0]))
    errors = rng.normal(size=(4000, 9)) @ root.T
    R = bar.T_world_bar[:3, :3]
    drawn = [(rotation_of(error[3:6]) @ R).T @ (velocity + error[6:]) for error in errors]
    twist = ros.decode(messages.ODOMETRY, messages.odometry(moving, 0)).twist
    covariance = np.array(twist.covariance).reshape(6, 6)
    expected = np.cov(np.array(drawn).T)
    assert covariance[:3, :3] == pytest.approx(expected, abs=0.08 * np.trace(expected))
    assert covariance[3:, 3:] == pytest.approx(np.diag([1.0, 4.0, 9.0]))
