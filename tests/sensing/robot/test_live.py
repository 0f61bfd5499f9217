"""Live streams: samples over DDS, and what is refused of them."""

import os
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from standing_robot import standing_samples

from cad.errors import ParameterError
from sensing.live.outputs.ros import dds
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import messages
from sensing.robot.node.cli import main
from sensing.robot.node.live import LiveRobot
from sensing.robot.node.run import run_robot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

pytest.importorskip("cyclonedds")
ROBOT, PATIENCE_S = load_robot(), 120.0
CABLES = tuple(cable.name for cable in ROBOT.cables)
DOMAIN = 1 + (os.getpid() + 50) % 100


@pytest.fixture(autouse=True)
def here_only(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


class Publisher:
    """Publishes a robot that stands, until it is stopped; one stream may be of another clock."""

    def __init__(self, participant, shift_s: float = 0.0) -> None:
        self._participant, self._shift_s, self._writers = participant, shift_s, {}
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
        if isinstance(sample, InertialSample):
            topic = f"imu/{sample.sensor}"
        elif isinstance(sample, FootSample):
            topic = f"{sample.endcap}/wrench/with_covariance"
        kind, cdr = messages.sample_message(sample, CABLES[::-1], wall_ns)
        if isinstance(sample, LengthSample):  # another order than the description's, with its names
            turned = replace(sample, lengths_m=np.asarray(sample.lengths_m)[::-1])
            kind, cdr = messages.sample_message(turned, CABLES[::-1], wall_ns)
        if topic not in self._writers:
            self._writers[topic] = dds.publisher(self._participant, topic, kind)
        if not warm:
            self._writers[topic].write(dds.encoded(kind, cdr))

    def close(self):
        self.stopped.set()
        self._thread.join(PATIENCE_S)


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


def test_lengths_are_put_in_the_order_of_the_description():
    stamp = SimpleNamespace(sec=7, nanosec=5)
    message = SimpleNamespace(header=SimpleNamespace(stamp=stamp), name=CABLES[:0:-1], position=list(range(1, 9)))
    sample = LiveRobot(ROBOT, domain=DOMAIN)._named(messages.JOINTS, message)
    assert np.array_equal(sample.lengths_m, [np.nan, 8, 7, 6, 5, 4, 3, 2, 1], equal_nan=True)


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
    ],
)
def test_bad_input_gets_one_line(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
