"""Checks samples: some are refused with an error, some are left out and counted, and impossible ones are also named.

One sample of a broken message would spoil the state permanently, because all later states depend on it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from cad.errors import ParameterError, printable
from sensing.robot.history import AnySample
from sensing.robot.layout import Layout
from sensing.robot.settings import KnownContact
from sensing.tensegrity.description import GRAVITY_M_S2, Array
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

FARTHEST_S = 60.0  # s between two streams; more means that their clocks differ
MOST_RAD_S = 75.0  # E: the range of gyroscopes of robots ends at 70 (4000 degrees/s)
MOST_M_S2 = 1000.0  # E: a fall onto the domes has a tenth
# E: limits of a force: weights of the robot, and N; the larger one holds. A fall from 0.3 m has five weights.
MOST_WEIGHTS, MOST_N = 100.0, 1000.0
LEVER_M = 1.0  # E: limit of a torque over that of the force; domes have a tenth of it
NAMED_S = 10.0  # s for which health reports an impossible sample


class SampleCheck:
    """Checks samples against the robot's description and against each other's clocks.

    Args:
        layout: indices of the robot.
    """

    def __init__(self, layout: Layout) -> None:
        robot = layout.robot
        self._sensors = {sensor.name: sensor.accelerometer for sensor in robot.sensors}
        self._endcaps = {endcap.name for endcap in robot.endcaps}
        self._cables = [cable.name for cable in robot.cables if cable.measured]
        self._most_m = sum(bar.length_m for bar in robot.bars)  # E: no cable of a robot is longer than all its bars
        self._most_n = max(MOST_N, MOST_WEIGHTS * robot.mass_kg * GRAVITY_M_S2)
        self._impossible: dict[str, tuple[float, str]] = {}

    def notes(self, time_s: float) -> list[str]:
        """One line for each sensor or cable whose recent samples were left out as impossible.

        Args:
            time_s: capture time of the newest sample, s.
        """
        return [line for at_s, line in self._impossible.values() if time_s - at_s < NAMED_S]

    def usable(self, sample: AnySample, newest_s: float) -> AnySample | None:
        """The sample, with NaN for impossible lengths; None for numbers that are NaN or that no sensor measures.

        An acceleration is left out where the description states no accelerometer.

        Args:
            sample: sample of any kind.
            newest_s: newest capture time so far, s.

        Raises:
            ParameterError: a sample that is not of this robot, has another form, or another clock.
        """
        what = self._known(sample)
        if not math.isfinite(sample.time_s):
            return None
        late_s = newest_s - sample.time_s
        if late_s > FARTHEST_S:  # one as far ahead may follow a pause; else the others are late
            raise ParameterError(
                f"{what}: time_s={sample.time_s:.3f} is {late_s:.0f} s before the other samples: give times of one "
                "clock",
                name="time_s", value=sample.time_s,
            )  # fmt: skip
        if isinstance(sample, LengthSample):
            return self._lengths(sample, what)
        if isinstance(sample, InertialSample):
            if not self._sensors[sample.sensor]:  # drivers of gyroscopes alone fill it with zeros or NaN
                sample = replace(sample, acceleration_m_s2=None)
            rate, force = sample.rate_rad_s, sample.acceleration_m_s2
            possible = self._possible(sample.time_s, what, rate, MOST_RAD_S, "rad/s")
            finite = bool(np.isfinite(rate).all())
            if force is not None:
                possible &= self._possible(sample.time_s, what, force, MOST_M_S2, "m/s^2")
                finite &= bool(np.isfinite(force).all())
            return sample if possible and finite else None
        if isinstance(sample, FootSample):
            possible = self._possible(sample.time_s, what, sample.force_n, self._most_n, "N")
            possible &= self._possible(sample.time_s, what, sample.torque_nm, self._most_n * LEVER_M, "N m")
            return sample if possible else None
        return sample

    def _possible(self, time_s: float, what: str, values: object, most: float, unit: str) -> bool:
        row = _row(values, 3, what)
        beyond = row[np.abs(row) > most]
        if len(beyond):
            self._impossible[what] = (
                time_s, f"{what}: {beyond[0]:.4g} {unit} is outside -{most:.4g}..{most:.4g}, left out: check its unit",
            )  # fmt: skip
        return not len(beyond)

    def _lengths(self, sample: LengthSample, what: str) -> LengthSample | None:
        """The sample with NaN for impossible lengths; None without any possible one."""
        row: Array = _row(sample.lengths_m, len(self._cables), what).copy()
        for cable in np.flatnonzero((row <= 0) | (row > self._most_m)):
            self._impossible[f"cable {cable}"] = (
                sample.time_s,
                f'cable "{printable(self._cables[cable])}": {row[cable]:.4g} m is outside 0..{self._most_m:.4g}, left '
                "out: check its unit",
            )
            row[cable] = np.nan
        return replace(sample, lengths_m=row) if np.isfinite(row).any() else None

    def _known(self, sample: AnySample) -> str:
        if isinstance(sample, LengthSample):
            return "cable lengths"
        known, name = (
            (self._endcaps, sample.endcap)
            if isinstance(sample, FootSample | KnownContact)
            else (set(self._sensors), sample.sensor)
        )
        kind = "endcap" if isinstance(sample, FootSample | KnownContact) else "inertial sensor"
        if name not in known:
            raise ParameterError(
                f'{kind} "{printable(str(name))[:40]}": not in the description of the robot, which has '
                f"{', '.join(sorted(known)) or 'none'}: use its names, or add it",
                name=kind, value=name,
            )  # fmt: skip
        return f'{kind} "{name}"'


def _row(values: object, count: int, what: str) -> np.ndarray:
    row = np.asarray(values, float)
    if row.shape != (count,):
        raise ParameterError(
            f"{what}: {row.size} numbers of shape {row.shape}: give {count}, in the order of the description",
            name=what, value=row.shape,
        )  # fmt: skip
    return row
