"""Samples of the robot's sensors, one record each (s, m, rad, N, N m); times are capture times on one clock."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InertialSample:
    """One sample of an inertial sensor, in the sensor's own axes.

    Attributes:
        time_s: capture time.
        sensor: name in the robot's description.
        rate_rad_s: (3,) angular velocity.
        acceleration_m_s2: (3,) specific force (at rest: +g upward); None without accelerometer.
    """

    time_s: float
    sensor: str
    rate_rad_s: Array
    acceleration_m_s2: Array | None = None


@dataclass(frozen=True)
class LengthSample:
    """Lengths of the measured cables.

    Attributes:
        time_s: capture time.
        lengths_m: (C,) in the order of the measured cables; NaN where one is missing.
    """

    time_s: float
    lengths_m: Array


@dataclass(frozen=True)
class FootSample:
    """Wrench and contact of one endcap, from its live reading.

    Attributes:
        time_s: capture time of the picture.
        endcap: name in the robot's description.
        force_n, torque_nm: (3,) on the endcap, at the origin of the endcap frame; NaN where the numbers are not valid.
        covariance: (6, 6) covariance of (force, torque); NaN, or a diagonal that is not positive, for none.
        touching: whether it touches; None where that is not known.
        flags: flags of the wrench, for example "out_of_range".
    """

    time_s: float
    endcap: str
    force_n: Array
    torque_nm: Array
    covariance: Array = field(default_factory=lambda: np.full((6, 6), np.nan))
    touching: bool | None = None
    flags: frozenset[str] = frozenset()


Sample = InertialSample | LengthSample | FootSample
