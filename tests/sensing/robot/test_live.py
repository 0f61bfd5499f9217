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
from standing_robot import standing_samples

from cad.errors import ParameterError
from sensing.live.outputs import ros_types as ros
from sensing.live.outputs.ros import dds
from sensing.live.outputs.ros.topics import open_participant
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import live, messages
from sensing.robot.node.cli import main
from sensing.robot.node.clock_watch import ClockWatch
from sensing.robot.node.live import LiveRobot
from sensing.robot.node.replay import Recording
from sensing.robot.node.run import run_robot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

pytest.importorskip("cyclonedds")
ROBOT, PATIENCE_S = load_robot(), 120.0
CABLES = tuple(cable.name for cable in ROBOT.cables)
NAMES = ("endcap_0", "endcap_3")
DOMAIN = 1 + (os.getpid() + 50) % 100


@pytest.fixture(autouse=True)
def here_only(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


class Publisher:
    """Publishes a robot that stands, until it is stopped; one stream may be of another clock.

    ``wrenches``: "with_covariance", "plain" (geometry_msgs/WrenchStamped), or none.
    """

    def __init__(self, participant, shift_s: float = 0.0, wrenches: str = "with_covariance") -> None:
        self._participant, self._shift_s, self._writers = participant, shift_s, {}
        self._wrenches = wrenches
        self.stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        samples = standing_samples(ROBOT, 60.0, rate_hz=100.0)[1]
        for sample in samples[:13]:
            self._write(sample, time.time_ns(), warm=True)
        begin_ns = time.time_ns()
        for sample in samples:
            if self.stopped.wait(max(0.0, sample.time_s - (time.time_ns() - begin_ns) / 1e9)):
                return
            off = self._shift_s if isinstance(sample, LengthSample) else 0.0
            self._write(replace(sample, time_s=sample.time_s + off), begin_ns)

    def _write(self, sample, wall_ns, warm=False):
        topic = "cable_lengths"
        kind, cdr = messages.sample_message(sample, CABLES[::-1], wall_ns)
        if isinstance(sample, InertialSample):
            topic = f"imu/{sample.sensor}"
        elif isinstance(sample, FootSample) and self._wrenches == "plain":
            topic, kind, cdr = f"{sample.endcap}/wrench", ros.WRENCH, plain_wrench(cdr)
        elif isinstance(sample, FootSample):
            topic = f"{sample.endcap}/wrench/{self._wrenches}"
        if isinstance(sample, LengthSample):  # another order than the description's, with its names
            turned = replace(sample, lengths_m=np.asarray(sample.lengths_m)[::-1])
            kind, cdr = messages.sample_message(turned, CABLES[::-1], wall_ns)
        if isinstance(sample, FootSample) and not self._wrenches:
            return
        if topic not in self._writers:
            self._writers[topic] = dds.publisher(self._participant, topic, kind)
        if not warm:
            self._writers[topic].write(dds.encoded(kind, cdr))

    def close(self):
        self.stopped.set()
        self._thread.join(PATIENCE_S)


def plain_wrench(cdr):
    """The WrenchStamped of an EndcapWrench, of a sensor whose frame has a name of its own."""
    full, types = ros.decode(ros.ENDCAP_WRENCH, cdr), ros.typestore().types
    header = replace(full.header, frame_id="mini45")
    return ros.encode(ros.WRENCH, types[ros.WRENCH](header=header, wrench=full.wrench))


def lines_of(process):
    """JSON lines of a program, as they come."""
    found = []
    threading.Thread(target=lambda: found.extend(map(json.loads, process.stdout)), daemon=True).start()
    return found


class Kept:
    def __init__(self, enough: int):
        self.reports, self._enough, self._end = [], enough, time.monotonic() + PATIENCE_S

    def sample(self, _):
        pass

    def report(self, report):
        self.reports.append(report)

    def done(self):
        return len(self.reports) >= self._enough or time.monotonic() > self._end


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
        file.write_text("".join(f'[[endcap]]\nname = "{name}"\nsource = "{address}"\n' for name in NAMES))
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


def test_lengths_are_put_in_the_order_of_the_description():
    stamp = SimpleNamespace(sec=7, nanosec=5)
    message = SimpleNamespace(header=SimpleNamespace(stamp=stamp), name=CABLES[:0:-1], position=list(range(1, 9)))
    sample = LiveRobot(ROBOT, domain=DOMAIN)._sample(messages.JOINTS, "", message)
    assert np.array_equal(sample.lengths_m, [np.nan, 8, 7, 6, 5, 4, 3, 2, 1], equal_nan=True)


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
    ("age_s", "said"), [(0.03, ""), (-5.0, "5.00 s ahead of"), (-0.2, "0.20 s ahead"), (2.0, "behind")]
)
def test_a_topic_of_another_clock_is_named_once(age_s, said):
    lines = []
    watch = ClockWatch(lines.append)
    for k in range(300):  # some are held up on their way
        watch.take("cable_lengths", 0.01 * k, 0.01 * k + age_s + (0.4 if k % 7 else 0.0))
    assert len(lines) == bool(said) and all(said in line and line.startswith("/cable_lengths") for line in lines)


def test_clocks_that_disagree_are_named():
    source, kept = LiveRobot(ROBOT, domain=DOMAIN + 100), Kept(1000)
    publisher = Publisher(source._participant, shift_s=600.0)
    try:
        with pytest.raises(ParameterError, match=r"the other samples: give times of one clock"):
            run_robot(source, RobotEstimator(ROBOT), [kept], kept.done)
    finally:
        publisher.close()


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
