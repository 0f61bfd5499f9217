"""Which samples are refused, in one line, and which are left out without a word but counted."""

from __future__ import annotations

import math

import numpy as np

from cad.errors import ParameterError, printable
from sensing.robot.history import AnySample
from sensing.robot.layout import Layout
from sensing.robot.settings import KnownContact
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

FARTHEST_S = 60.0  # between two streams: more means that their clocks differ


class SampleCheck:
    """Checks samples against the robot's description and against each other's clocks.

    Args:
        layout: of the robot.
    """

    def __init__(self, layout: Layout) -> None:
        robot = layout.robot
        self._sensors = {sensor.name: sensor.accelerometer for sensor in robot.sensors}
        self._endcaps = {endcap.name for endcap in robot.endcaps}
        self._cables = len(layout.cable_bars)

    def counts(self, sample: AnySample, newest_s: float) -> bool:
        """Whether a sample can be used; False for numbers that are NaN.

        Args:
            sample: any. newest_s: of all samples so far.

        Raises:
            ParameterError: it is not one of this robot's, has another form, or another clock.
        """
        what = self._known(sample)
        if not math.isfinite(sample.time_s):
            return False
        late_s = newest_s - sample.time_s
        if late_s > FARTHEST_S:  # as far ahead it may be the end of a pause; where it is not, the others are late
            raise ParameterError(
                f"{what}: time_s={sample.time_s:.3f} is {late_s:.0f} s before the other samples: give times of one "
                "clock",
                name="time_s", value=sample.time_s,
            )  # fmt: skip
        if isinstance(sample, InertialSample):
            values = [sample.rate_rad_s, *([] if sample.acceleration_m_s2 is None else [sample.acceleration_m_s2])]
            return all(bool(np.isfinite(_row(value, 3, what)).all()) for value in values)
        if isinstance(sample, LengthSample):
            return bool(np.isfinite(_row(sample.lengths_m, self._cables, what)).any())
        if isinstance(sample, FootSample):
            _row(sample.force_n, 3, what), _row(sample.torque_nm, 3, what)
        return True

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
