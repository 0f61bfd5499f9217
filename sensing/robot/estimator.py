"""The robot from its samples: pose, velocity and shape, and which endcaps hold.

    estimator = RobotEstimator(load_robot())
    estimator.imu(InertialSample(...)); estimator.lengths(LengthSample(...)); estimator.reading(FootSample(...))
    estimate = estimator.state()                        # at the newest sample; None until it has stood a while
    estimate = estimator.state(at=now_s)                # predicted to a later time, or as it was

Samples may come late, twice or out of order: the estimate depends on their capture times only. docs/robot.md describes
the method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cad.errors import ParameterError
from sensing.robot.contact import contact_of
from sensing.robot.estimate import RobotEstimate
from sensing.robot.filter import Filter
from sensing.robot.history import AnySample, History
from sensing.robot.layout import layout_of
from sensing.robot.report import report_of
from sensing.robot.samples_check import SampleCheck
from sensing.robot.settings import DEFAULTS, KnownContact, Settings
from sensing.robot.silence import doubtful, follow_on, pauses, tries_balance
from sensing.robot.start import Gathered, begin, first_leader, gather, goes_on, lengths_late, moves, nothing_gathered
from sensing.robot.state import State, empty_state
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample


@dataclass
class _Progress:
    """Measurements gathered before the start, and the state after it; both again after a silence of the sensors.

    Attributes:
        gathered: measurements of the start; None while no start is being prepared.
        state: state of the filter; None before the first start.
        stands: whether the robot stood still while they were gathered.
        began_s: time of the first state, s; NaN before.
    """

    gathered: Gathered | None
    state: State | None
    stands: bool = True
    began_s: float = np.nan

    def copy(self) -> _Progress:
        gathered, state = self.gathered and self.gathered.copy(), self.state and self.state.copy()
        return _Progress(gathered, state, self.stands, self.began_s)


class RobotEstimator:
    """Estimates one robot from its samples; deterministic: the same samples give the same bits.

    Args:
        robot: description of the robot.
        settings: assumptions on sensors and contacts.

    Raises:
        ParameterError: a description that cannot be estimated (two inertial sensors on a bar, no stated ends).
    """

    def __init__(self, robot: TensegrityRobot, settings: Settings = DEFAULTS) -> None:
        self.robot, self.settings = robot, settings
        self._layout = layout_of(robot)
        self._filter = Filter(self._layout, settings)
        self._check = SampleCheck(self._layout)
        self._number = {endcap.name: number for number, endcap in enumerate(robot.endcaps)}
        self._bar_of = {name: bar for bar, name in enumerate(self._layout.sensor_of_bar) if name}
        self._ignored = 0
        first = _Progress(nothing_gathered(self._layout), None)
        self._history = History(first, self._take, settings.history_s)

    @property
    def newest_s(self) -> float:
        """Capture time of the newest sample, s; -inf before the first."""
        return self._history.newest_s

    def imu(self, sample: InertialSample) -> None:
        """Take a sample of an inertial sensor.

        Raises:
            ParameterError: an unknown sensor, another count of numbers, or another clock. The methods for other samples
                raise it, too.
        """
        self._put(sample)

    def lengths(self, sample: LengthSample) -> None:
        """Take the lengths of the cables; NaN where one is missing."""
        self._put(sample)

    def reading(self, sample: FootSample) -> None:
        """Take the wrench of an endcap (:func:`sensing.robot.readings.foot_sample` makes it from a live reading)."""
        self._put(sample)

    def known(self, sample: KnownContact) -> None:
        """Take the true contact of a simulation, before its reading; for ``Contacts.KNOWN`` only."""
        self._put(sample)

    def state(self, at: float | None = None) -> RobotEstimate | None:
        """Estimate of the robot at a time; None before the start.

        Args:
            at: time, s; None for that of the newest sample. A later time is predicted with the last rates, over at most
                ``Settings.history_s``.

        Raises:
            ParameterError: a time that is not finite, or before the history that is kept.
        """
        time_s = self.newest_s if at is None else float(at)
        if at is not None and not np.isfinite(time_s):
            raise ParameterError(f"at={at}: not a time: give seconds on the samples' clock", name="at", value=at)
        if time_s < self.newest_s - self.settings.history_s:
            raise ParameterError(
                f"at={time_s:.3f} is {self.newest_s - time_s:.2f} s before the newest sample: the past is kept for "
                f"{self.settings.history_s:g} s (Settings.history_s)",
                name="at", value=at,
            )  # fmt: skip
        progress = self._history.at(time_s)
        if progress.state is None or self.newest_s < progress.began_s + self.settings.late_s - 1e-9:
            return None
        state, measured_s = progress.state.copy(), progress.state.time_s
        if time_s > measured_s:
            end_s = min(time_s, measured_s + self.settings.history_s)
            self._filter.take(state, end_s, [], self._coming(end_s, []))
        layout = self._filter.led(state)
        return report_of(state, measured_s, self._ignored, self.left_out(), layout, self.settings)

    def left_out(self) -> list[str]:
        """One line for each kind of recent sample with impossible values; an estimate's health contains them, too."""
        return self._check.notes(self.newest_s)

    def _put(self, sample: AnySample) -> None:
        usable = self._check.usable(sample, self.newest_s)
        if usable is None or not self._history.put(usable):
            self._ignored += 1

    def _coming(self, time_s: float, samples: list[AnySample]) -> list[InertialSample]:
        """The next samples of the inertial sensors that have none at a time."""
        now = {sample.sensor for sample in samples if isinstance(sample, InertialSample)}
        return self._history.coming(time_s, self._bar_of.keys() - now)

    def _take(self, progress: _Progress, time_s: float, samples: list[AnySample]) -> None:
        if progress.state is not None:
            self._filter.take(progress.state, time_s, samples, self._coming(time_s, samples))
            state, began_s = progress.state, progress.began_s
            wanted = state.held_s or doubtful(state) or tries_balance(state, began_s)
            if wanted and progress.gathered is None and self._filter.measures(samples):
                progress.gathered = nothing_gathered(self._layout, time_s)
            elif state.began_unbalanced and not wanted:  # it walked on until the tries were over
                progress.gathered = None
        gathered = progress.gathered
        if gathered is None:
            return
        if np.isnan(gathered.tried_s):
            gathered.tried_s = time_s
        doubted = None if progress.state is None or progress.state.held_s else progress.state
        waits = doubted is not None  # a state exists, so that a new start can wait for a robot that stands
        waits = waits or time_s - gathered.tried_s < self.settings.start_limit_s - self.settings.start_s
        moving = moves(gathered, samples) or (doubted is not None and pauses(doubted))
        late = lengths_late(gathered, time_s, samples)
        progress.stands = (progress.stands or late) and (not moving or waits)
        again = nothing_gathered(self._layout, gathered.tried_s if doubted is None else time_s)
        if late or (moving and waits):  # it falls, rocks or walks, so the gathered means are not those at rest
            gathered = progress.gathered = again
        self._gather(gathered, time_s, samples)
        enough = time_s - gathered.first_s >= self.settings.start_s - 1e-9
        settling = enough and goes_on(gathered)
        progress.stands &= not settling or waits
        if settling and waits:
            progress.gathered = again
        elif enough and (gathered.length_counts > 0).any():
            self._begin(progress, gathered, time_s)

    def _begin(self, progress: _Progress, gathered: Gathered, time_s: float) -> None:
        """Begin, or begin anew: but from one start in no balance with another one nothing is won."""
        layout = self._layout.led_by(first_leader(gathered, self._layout))
        before, progress.gathered = progress.state, None
        state = empty_state(layout, time_s)
        begin(state, gathered, layout, self.settings, progress.stands)
        progress.stands = True
        if before is not None:
            if state.began_unbalanced and before.began_unbalanced and not (before.held_s or doubtful(before)):
                before.tried_s = time_s
                return
            follow_on(state, before, layout)
        progress.state, progress.began_s = state, time_s if np.isnan(progress.began_s) else progress.began_s

    def _gather(self, gathered: Gathered, time_s: float, samples: list[AnySample]) -> None:
        if np.isnan(gathered.first_s):
            gathered.first_s = time_s
        for sample in samples:
            if isinstance(sample, FootSample):
                number = self._number[sample.endcap]
                gathered.contacts[number] = contact_of(sample, number, self._layout, self.settings)
                gathered.reading_s[number] = time_s
            elif not isinstance(sample, KnownContact):
                bar = self._bar_of[sample.sensor] if isinstance(sample, InertialSample) else -1
                gather(gathered, time_s, bar, sample, self._layout, self.settings)
