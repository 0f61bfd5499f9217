"""Live streams: samples over DDS, cameras of this computer, and what is refused of them."""

import json
import os
import signal
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from live_program import ROBOT as ROBOT_CLI
from live_program import camera, program
from live_stand_in import wait_for
from robot_publisher import CABLES, PATIENCE_S, ROBOT, Kept, Publisher, plain_wrench
from standing_robot import standing_samples

from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.topics import open_participant
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import live, messages
from sensing.robot.node.cli import main
from sensing.robot.node.live import LiveRobot
from sensing.robot.node.replay import Recording
from sensing.robot.node.run import run_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

pytest.importorskip("cyclonedds")
NAMES = ("endcap_0", "endcap_3")
DOMAIN = 1 + (os.getpid() + 50) % 100


@pytest.fixture(autouse=True)
def here_only(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


def lines_of(process):
    """JSON lines of a program, as they come."""
    found = []
    threading.Thread(target=lambda: found.extend(map(json.loads, process.stdout)), daemon=True).start()
    return found


def test_samples_of_topics_give_an_estimate():
    source, kept = LiveRobot(ROBOT, domain=DOMAIN), Kept(30)
    publisher = Publisher(source._participant)
    try:
        run_robot(source, RobotEstimator(ROBOT), [kept], kept.done)
    finally:
        publisher.close()
    assert len(kept.reports) >= 30 and kept.reports[-1].truth is None
    last = kept.reports[-1].estimate
    assert [endcap.hold.word for endcap in last.endcaps] == ["holds", "free"] * 3
    assert abs(last.time_s - time.monotonic()) < PATIENCE_S and last.health.ignored == 0


def test_what_came_while_the_process_was_held_up_is_all_there_and_in_order():
    source = LiveRobot(ROBOT, domain=DOMAIN + 45)
    publisher = Publisher(source._participant)
    try:
        wait_for(source._waiting)
        time.sleep(1.5)
        samples = source._waiting()
    finally:
        publisher.close()
    times = [sample.time_s for sample in samples]
    assert times == sorted(times) and times[-1] - times[0] > 1.0
    for sensor in ROBOT.sensors:
        mine = [sample.time_s for sample in samples if getattr(sample, "sensor", "") == sensor.name]
        assert np.diff(mine).max() < 0.015  # at 100 Hz none is missing


@pytest.mark.long
def test_a_second_process_takes_wrenches_without_covariance(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN + 30))
    participant, _owner = open_participant(DOMAIN + 30)
    with program("--live", "--json", "--no-page", "--wrench-sd", "0.2", "0.01", cli=ROBOT_CLI, stderr=None) as process:
        publisher, found = Publisher(participant, wrenches="plain"), lines_of(process)
        try:
            wait_for(lambda: any(map(stands, found)))
        finally:
            publisher.close()
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE_S) == 0
    loaded = next(filter(stands, found))["endcaps"][::2]
    assert sum(endcap["force_n"][2] for endcap in loaded) == pytest.approx(12 * 9.81, rel=0.03)


def test_a_plain_wrench_has_the_stated_covariance_and_gives_way_to_one_with_its_own():
    source = LiveRobot(ROBOT, domain=DOMAIN, wrench_sd=(0.5, 0.02))
    foot = next(sample for sample in standing_samples(ROBOT, 0.1)[1] if isinstance(sample, FootSample))
    cdr = messages.sample_message(foot, CABLES, 0)[1]
    plain, full = ros.decode(ros.WRENCH, plain_wrench(cdr)), ros.decode(ros.ENDCAP_WRENCH, cdr)
    found = source._sample(ros.WRENCH, foot.endcap, plain)
    assert found.endcap == foot.endcap and found.touching is None and np.array_equal(found.force_n, foot.force_n)
    assert np.diag(found.covariance) == pytest.approx([0.25] * 3 + [4e-4] * 3)
    assert np.array_equal(source._sample(ros.ENDCAP_WRENCH, foot.endcap, full).covariance, foot.covariance)
    assert source._sample(ros.WRENCH, foot.endcap, plain) is None
    assert source._sample(ros.WRENCH, "endcap_5", plain).endcap == "endcap_5"


@pytest.mark.long
def test_cameras_of_this_computer_through_the_program(tmp_path, monkeypatch):
    """Two endcaps on drawn cameras, the other sensors from topics."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN + 60))
    participant, _owner = open_participant(DOMAIN + 60)
    with camera(pushes=[0] * 200 + [1.0] * 60) as address:
        file = tmp_path / "endcaps.toml"
        base = address[:-1]  # a camera for each
        file.write_text("".join(f'[[endcap]]\nname = "{name}"\nsource = "{base}{name[-1]}"\n' for name in NAMES))
        words = ["--live", "--endcaps", str(file), "--json", "--no-page", "--record", "run.mcap"]
        with program(*words, cli=ROBOT_CLI, cwd=tmp_path, stderr=(tmp_path / "said").open("w")) as process:
            publisher, found = Publisher(participant, wrenches=""), lines_of(process)
            try:
                wait_for(lambda: len(found) > 20 and any(pressed(line) for line in found))
            finally:
                publisher.close()
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0
    said = (tmp_path / "said").read_text()
    assert all(f"{name}: running" in said for name in NAMES)
    assert np.isfinite([force(found[-1], name) for name in NAMES]).all()
    assert np.isnan(force(found[-1], "endcap_1")).all()
    replayed = Recording(tmp_path / "run.mcap").replay([])
    assert replayed.compared >= 20 and replayed.different == 0 and replayed.end is None


def stands(line):
    """On a busy computer streams come up one after the other; what is stated meanwhile is flagged."""
    return line["health"]["good"] and [endcap["state"] for endcap in line["endcaps"]] == ["holds", "free"] * 3


def pressed(line):
    return all(np.linalg.norm(force(line, name)) > 2 for name in NAMES)


def force(line, name):
    endcap = next(endcap for endcap in line["endcaps"] if endcap["name"] == name)
    return np.array(endcap["force_n"], float)


def test_topics_that_bring_nothing_are_named_once(monkeypatch, capsys):
    monkeypatch.setattr(live, "PATIENCE_S", 0.0)
    source = LiveRobot(ROBOT, domain=DOMAIN + 100)
    source._silent = [topic for topic in source._silent if topic != "endcap_3/wrench/with_covariance"]  # it came
    arrivals = source.arrivals()
    assert [next(arrivals) for _ in range(3)] == [None] * 3
    said = capsys.readouterr().err
    assert said.count("waiting") == 1 and "/cable_lengths" in said and "/imu/imu_red" in said
    assert "/endcap_0/wrench" in said and "/endcap_3/wrench" not in said and "with_covariance" not in said


def test_publishers_of_best_effort_are_heard():
    """Drivers of inertial sensors offer no more (``SensorDataQoS`` of ROS 2); DDS gives that to no reliable reader."""
    source = LiveRobot(ROBOT, domain=DOMAIN + 60)
    publisher = Publisher(source._participant, reliable=False)
    try:
        heard = {topic for topic, _, _, _ in source._readers if not topic.endswith("/wrench")}
        arrivals, end_s = source.arrivals(), time.monotonic() + 60.0
        while heard & set(source._silent) and time.monotonic() < end_s:
            next(arrivals)
        assert not heard & set(source._silent)
    finally:
        publisher.close()


def test_lengths_are_put_in_the_order_of_the_description():
    stamp = SimpleNamespace(sec=7, nanosec=5)
    message = SimpleNamespace(header=SimpleNamespace(stamp=stamp), name=CABLES[:0:-1], position=list(range(1, 9)))
    sample = LiveRobot(ROBOT, domain=DOMAIN)._sample(messages.JOINTS, "", message)
    assert np.array_equal(sample.lengths_m, [np.nan, 8, 7, 6, 5, 4, 3, 2, 1], equal_nan=True)


def test_lengths_of_other_names_than_the_cables_are_named_once(capsys):
    """None of them counted, and nothing said why there was never an estimate."""
    header = SimpleNamespace(stamp=SimpleNamespace(sec=7, nanosec=5))
    message = SimpleNamespace(header=header, name=["motor 1", "motor 2"], position=[0.5, 0.5])
    source = LiveRobot(ROBOT, domain=DOMAIN)
    assert all(np.isnan(source._sample(messages.JOINTS, "", message).lengths_m).all() for _ in range(3))
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "/cable_lengths: motor 1, motor 2: no cables of the robot" in said


def test_the_topic_says_whose_a_sample_is_whatever_its_driver_calls_the_axes():
    source = LiveRobot(ROBOT, domain=DOMAIN)
    for sample in standing_samples(ROBOT, 0.1)[1][:12]:
        if isinstance(sample, LengthSample):
            continue
        kind, cdr = messages.sample_message(sample, CABLES, 0)
        message = ros.decode(kind, cdr)
        name = sample.sensor if isinstance(sample, InertialSample) else sample.endcap
        other = replace(message, header=replace(message.header, frame_id="imu_link"))
        again = source._sample(kind, name, other)
        assert name in (getattr(again, "sensor", None), getattr(again, "endcap", None))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--live", "--terrain", "flat"], "--terrain has no effect with --live"),
        (["--endcaps", "endcaps.toml"], "endcaps.toml: No such file"),
        (["--endcaps", "endcaps.toml", "--wrench-sd", "1", "1"], "their wrenches have a covariance"),
        (["--wrench-sd", "1", "1"], "--wrench-sd has no effect without --live"),
        (["--live", "--wrench-sd", "0", "1"], "--wrench-sd 0 1 outside 0..100"),
    ],
)
def test_bad_input_gets_one_line(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
