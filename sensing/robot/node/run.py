"""Runs the estimator: samples as they arrive, reports to the outputs.

The arrival of samples determines when reports are made, so a recording that holds samples and reports in their order
gives the same reports again, to the bit. Times of samples are whole nanoseconds, as recordings and topics hold them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from cad.errors import printable
from cad.messages import LOG
from sensing.live.core.sink import reason_of
from sensing.robot.estimate import RobotEstimate
from sensing.robot.estimator import RobotEstimator
from sensing.robot.layout import layout_of
from sensing.robot.node.record import Report
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample, Sample

REPORT_S = 0.05  # s, interval of reports
SILENT_S = 0.3  # E: s without any sample of a live robot, after which the estimate is predicted
NS = 10**9  # nanoseconds in a second
STEP_M = 0.05  # m, least step of the path; shorter ones are noise


class RobotSource(Protocol):
    """Interface of a source of samples."""

    robot: TensegrityRobot

    def arrivals(self) -> Iterator[tuple[float, Sample] | None]:
        """(time of arrival, sample) on the samples' clock; None now and then while none comes."""
        ...

    def truth(self, time_s: float) -> Array | None:
        """(B, 4, 4) m true poses of the bars, in a world frame of their own; None where they are unknown."""
        ...


class Output(Protocol):
    """Interface of an output of samples and reports."""

    def sample(self, sample: Sample) -> None:
        """Take a sample, before the estimator does."""
        ...

    def report(self, report: Report) -> None:
        """Take an estimate of this moment."""
        ...


def give(estimator: RobotEstimator, sample: Sample) -> None:
    """Pass a sample to the method of the estimator for its kind.

    Raises:
        ParameterError: a sample that is not of this robot, or of another clock.
    """
    if isinstance(sample, InertialSample):
        estimator.imu(sample)
    elif isinstance(sample, LengthSample):
        estimator.lengths(sample)
    else:
        assert isinstance(sample, FootSample)
        estimator.reading(sample)


def whole_ns(time_s: float) -> int:
    """Nanoseconds of a time in s."""
    return round(time_s * NS)


class Way:
    """Path of the robot, and its true pose in the world of the estimate."""

    def __init__(self, robot: TensegrityRobot) -> None:
        self._last, self._align = np.full(2, np.nan), np.eye(4)
        self._begun, self.path_m = False, 0.0
        self._leader = layout_of(robot).leader

    def report(self, estimate: RobotEstimate, truth: Array | None) -> Report:
        """The report of an estimate.

        Args:
            estimate: estimate of this moment.
            truth: (B, 4, 4) m, true poses at this moment, in the source's world.
        """
        if not self._begun and truth is not None:
            self._align = _alignment(estimate.bars[self._leader].T_world_bar, truth[self._leader])
        now = estimate.centre_of_mass_m[:2]
        if not self._begun:
            self._last = now
        step = float(np.linalg.norm(now - self._last))
        if step > STEP_M:
            self.path_m, self._last = self.path_m + step, now
        self._begun = True
        return Report(estimate, None if truth is None else self._align @ truth, self.path_m)


def run_robot(
    source: RobotSource, estimator: RobotEstimator, outputs: Sequence[Output], stopped: Callable[[], bool],
    lost: Callable[[str], object] = LOG.error, silent_s: float = math.inf,
) -> int:  # fmt: skip
    """Run until the source ends or is stopped; returns the number of reports.

    Args:
        source: source of samples.
        estimator: estimator of the same robot.
        outputs: outputs of samples and reports; one that raises gets no more.
        stopped: polled; True ends the run.
        lost: function that takes a line for every output that raised.
        silent_s: silence, s, after which reports are predictions whose health states that all sensors are silent.

    Raises:
        ParameterError: a sample that is not of this robot, or of another clock.
    """
    way, count, moments, working = Way(source.robot), 0, _Moments(estimator, silent_s), list(outputs)
    for arrival in source.arrivals():
        if stopped():
            break
        if arrival is None:
            estimate = moments.in_silence()
        else:
            at_s, sample = arrival
            sample = replace(sample, time_s=whole_ns(sample.time_s) / NS) if math.isfinite(sample.time_s) else sample
            _hand_out(working, lambda output: output.sample(sample), lost)  # noqa: B023 (called at once)
            give(estimator, sample)
            estimate = moments.after_sample(at_s)
        if estimate is not None:
            report = way.report(estimate, source.truth(estimate.time_s))
            count += 1
            _hand_out(working, lambda output: output.report(report), lost)  # noqa: B023 (called at once)
    return count


class _Moments:
    """Times of reports: every 0.05 s of arrivals, and during a silence as long as a prediction is possible.

    Without the latter, the last report of a robot with a lost network would state good health. So would that of one
    whose clock was set back: samples older than the newest one do not end a silence.
    """

    def __init__(self, estimator: RobotEstimator, silent_s: float) -> None:
        self._estimator, self._silent_s = estimator, silent_s
        self._next_s, self._last_s, self._heard_s = -math.inf, -math.inf, math.inf
        self._newest_s = -math.inf  # capture time of the newest sample
        self._named: set[str] = set()

    def after_sample(self, at_s: float) -> RobotEstimate | None:
        """Estimate at the newest sample; None if none is due, or an estimate of that time or a later one is given.

        Args:
            at_s: arrival of a sample, s.
        """
        if self._estimator.newest_s > self._newest_s:
            self._newest_s, self._heard_s = self._estimator.newest_s, time.monotonic()
        if at_s < self._next_s:
            return None
        self._next_s = at_s + REPORT_S
        return self._reported(self._estimator.state() if self._newest_s > self._last_s else None)

    def in_silence(self) -> RobotEstimate | None:
        """Prediction over a time without samples."""
        quiet_s, newest_s = time.monotonic() - self._heard_s, self._estimator.newest_s
        at_s = newest_s + min(quiet_s, self._estimator.settings.history_s)
        if quiet_s < self._silent_s or not at_s >= self._last_s + REPORT_S:
            return None
        return self._reported(self._estimator.state(at_s))

    def _reported(self, estimate: RobotEstimate | None) -> RobotEstimate | None:
        if estimate is not None:
            self._last_s = estimate.time_s
        elif self._last_s == -math.inf:  # before the first estimate, no health reports it
            self._name_left_out()
        return estimate

    def _name_left_out(self) -> None:
        for line in self._estimator.left_out():
            if (what := line.split(":")[0]) not in self._named:
                self._named.add(what)
                LOG.warning(line)


def _hand_out(working: list[Output], take: Callable[[Output], None], lost: Callable[[str], object]) -> None:
    """Call ``take`` on every working output; one that raises is removed, and ``lost`` gets the reason."""
    for output in tuple(working):
        try:
            take(output)
        except Exception as error:  # an output must not end the run of a walking robot
            working.remove(output)
            lost(printable(f"{type(output).__name__}: stopped ({reason_of(error)})"))


def _alignment(estimated: Array, true: Array) -> Array:
    """(4, 4) rotation about z and shift that map the true heading and place of a bar, (4, 4), to the estimated ones."""
    turned = estimated[:3, :3] @ true[:3, :3].T
    angle = math.atan2(turned[1, 0] - turned[0, 1], turned[0, 0] + turned[1, 1])
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    pose[:3, 3] = estimated[:3, 3] - pose[:3, :3] @ true[:3, 3]
    return pose
