"""Live streams whose stamps are of another clock, or far from now."""

import os
import time
from types import SimpleNamespace

import pytest
from robot_publisher import PATIENCE_S, ROBOT, Kept, Publisher
from standing_robot import standing_samples

from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import live
from sensing.robot.node.clock_watch import ClockWatch
from sensing.robot.node.live import LiveRobot
from sensing.robot.node.run import run_robot

pytest.importorskip("cyclonedds")
DOMAIN = 1 + (os.getpid() + 20) % 100


@pytest.fixture(autouse=True)
def here_only(monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)


@pytest.mark.parametrize(
    ("age_s", "said"), [(0.03, ""), (-5.0, "5.00 s ahead of"), (-0.2, "0.20 s ahead"), (2.0, "behind")]
)
def test_a_topic_of_another_clock_is_named_once(age_s, said):
    lines = []
    watch = ClockWatch(lines.append)
    for k in range(300):  # some are held up on their way
        watch.take("cable_lengths", 0.01 * k, 0.01 * k + age_s + (0.4 if k % 7 else 0.0))
    assert len(lines) == bool(said) and all(said in line and line.startswith("/cable_lengths") for line in lines)


@pytest.mark.parametrize(("off_s", "said"), [(0.6, "0.60 s ahead of"), (75.0, "75.00 s ahead of"), (-75.0, "behind")])
def test_one_stamp_far_from_now_is_left_out_and_named_once(off_s, said):
    lines = []
    watch = ClockWatch(lines.append)
    used = [watch.take("imu/imu_red", 0.01 * k + off_s * (k % 50 == 20), 0.01 * k + 0.004) for k in range(300)]
    assert [k for k in range(300) if not used[k]] == list(range(20, 300, 50))
    assert len(lines) == 1 and said in lines[0] and lines[0].startswith("/imu/imu_red")


def test_one_stamp_far_ahead_spoils_no_estimate(capsys):
    """Its time would be the newest of all: every later sample would come too late, or end the run."""
    source, kept = LiveRobot(ROBOT, domain=DOMAIN + 100), Kept(60)
    publisher = Publisher(source._participant, odd_s=75.0)
    try:
        run_robot(source, RobotEstimator(ROBOT), [kept], kept.done)
    finally:
        publisher.close()
    assert len(kept.reports) >= 60
    last = kept.reports[-1].estimate
    assert [endcap.hold.word for endcap in last.endcaps] == ["holds", "free"] * 3
    named = [line for line in capsys.readouterr().err.splitlines() if "such samples are left out" in line]
    assert (
        named and len(named) == len({line.split(":")[0] for line in named}) and all("/imu/" in line for line in named)
    )


def test_clocks_that_disagree_are_named(capsys):
    source, kept = LiveRobot(ROBOT, domain=DOMAIN + 100), Kept(1)
    publisher = Publisher(source._participant, shift_s=600.0)
    end, said, named_s = time.monotonic() + PATIENCE_S, "", None

    def enough() -> bool:
        """A second after the topic was named, in which it might be named again."""
        nonlocal said, named_s
        said += capsys.readouterr().err
        named_s = named_s or (time.monotonic() if "/cable_lengths" in said else None)
        return time.monotonic() > (named_s + 1.0 if named_s else end)

    try:
        run_robot(source, RobotEstimator(ROBOT), [kept], enough)
    finally:
        publisher.close()
    assert said.count("/cable_lengths: a stamp 600") + said.count("/cable_lengths: a stamp 599") == 1


def test_a_computer_that_is_too_slow_reports_less_often_and_says_so(monkeypatch, capsys):
    """A report after every sample, since each took longer than the time between two, made it later and later."""
    source, samples = LiveRobot(ROBOT, domain=DOMAIN + 61), standing_samples(ROBOT, 2.0, rate_hz=100.0)[1]
    batches = [samples[k : k + 200] for k in range(0, len(samples), 200)]
    monkeypatch.setattr(source, "_waiting", lambda: batches.pop(0) if batches else [])
    now = [0.0]
    monkeypatch.setattr(live, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=lambda _: None))
    kept = Kept(10**6)

    class Slow:
        def sample(self, _):
            now[0] += 0.06

        def report(self, _):
            now[0] += 0.5

    run_robot(source, RobotEstimator(ROBOT), [kept, Slow()], lambda: not batches)
    assert 10 <= len(kept.reports) <= 25  # of a second after the start, 20 a second
    assert capsys.readouterr().err.count("this computer has too little time") == 1


def test_stamps_are_read_by_a_clock_that_was_set(monkeypatch, capsys):
    source = LiveRobot(ROBOT, domain=DOMAIN)
    before_ns, real = source._clock.offset_ns, time.time_ns
    monkeypatch.setattr(live.time, "time_ns", lambda: real() + 20 * 365 * 86400 * 10**9)
    assert source._waiting() == [] and source._waiting() == []
    assert abs(source._clock.offset_ns - before_ns - 20 * 365 * 86400 * 10**9) < 10**8
    assert capsys.readouterr().err.count("clock was set by +630720000") == 1
