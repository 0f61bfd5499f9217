"""Estimates of the robot at one time: records that page, recording and ROS take (m, s, N, rad).

Bars and endcaps stand in the order of the robot's description; frames are those of
:mod:`sensing.tensegrity.description`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BarEstimate:
    """One bar.

    Attributes:
        name: of the bar.
        T_world_bar: (4, 4) m.
        velocity_m_s: (3,) of the bar's origin, world axes.
        rate_rad_s: (3,) angular velocity, world axes.
        covariance: (9, 9) of origin, rotation (a turn about world axes) and velocity.
        rate_covariance: (3, 3) of the angular velocity.
    """

    name: str
    T_world_bar: Array
    velocity_m_s: Array
    rate_rad_s: Array
    covariance: Array
    rate_covariance: Array


@dataclass(frozen=True)
class Hold:
    """State of an endcap's contact, as probabilities that sum to 1; NaN without a reading.

    Attributes:
        holds: touches and stays.
        rolls: without slip.
        slips: its skin moves over the support.
        free: touches nothing.
    """

    holds: float
    rolls: float
    slips: float
    free: float

    @property
    def word(self) -> str:
        """The likeliest of the four, or "unknown"."""
        values = {"holds": self.holds, "rolls": self.rolls, "slips": self.slips, "free": self.free}
        return "unknown" if np.isnan(self.holds) else max(values, key=lambda name: values[name])


@dataclass(frozen=True)
class EndcapEstimate:
    """One endcap.

    Attributes:
        name: of the endcap.
        centre_m: (3,) centre of its sphere, world.
        covariance: (3, 3) of it.
        hold: how it meets its support.
        contact_m: (3,) where it touches, world.
        normal: (3,) unit, out of the support, world.
        normal_sd_rad: standard deviation of the normal's direction, rad.
        force_n: (3,) on the endcap, world axes.
        friction_ratio, friction_ratio_sd: tangential over normal force; NaN without contact, as all after ``hold``.
    """

    name: str
    centre_m: Array
    covariance: Array
    hold: Hold
    contact_m: Array
    normal: Array
    normal_sd_rad: float
    force_n: Array
    friction_ratio: float
    friction_ratio_sd: float


@dataclass(frozen=True)
class Health:
    """Whether the answer agrees with the samples.

    Attributes:
        lengths_consistency, anchors_consistency: mean squared innovation over its variance, lately: below 1
            where it is right, since variances hold errors that stay, too.
        weight_ratio: sum of the vertical forces over the weight, lately; NaN while the robot accelerates.
        rejected: lengths that did not fit, of the last sample.
        ignored: samples with NaN, with numbers that no sensor measures, or too old, since the start.
        notes: what is missing or does not fit, one line each.
    """

    lengths_consistency: float
    anchors_consistency: float
    weight_ratio: float
    rejected: int
    ignored: int
    notes: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether nothing is missing and innovations are no larger than they should be."""
        return not self.notes


@dataclass(frozen=True)
class RobotEstimate:
    """The robot at one time.

    Attributes:
        time_s: for which it holds.
        measured_s: of the newest sample that it uses.
        bars, endcaps: in the order of the description.
        centre_of_mass_m: (3,) world.
        centre_of_mass_covariance: (3, 3).
        friction, friction_sd: coefficient of friction of the supports as learned until now.
        softness, softness_sd: part by which the domes yield more than ``Settings.compliance_m_n`` says, as learned
            until now. Forces measured too small by that part look the same.
        health: whether it agrees with the samples.
    """

    time_s: float
    measured_s: float
    bars: tuple[BarEstimate, ...]
    endcaps: tuple[EndcapEstimate, ...]
    centre_of_mass_m: Array
    centre_of_mass_covariance: Array
    friction: float
    friction_sd: float
    softness: float
    softness_sd: float
    health: Health
