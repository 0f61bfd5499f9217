"""Estimates of the robot at one time: records for page, recording and ROS (m, s, N, rad).

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
        name: name of the bar.
        T_world_bar: (4, 4) pose, m.
        velocity_m_s: (3,) velocity of the bar's origin, world axes.
        rate_rad_s: (3,) angular velocity, world axes.
        covariance: (9, 9) covariance of origin, rotation (rotation vector in world axes) and velocity.
        rate_covariance: (3, 3) covariance of the angular velocity, with the error of the turn to the world.
        bar_rate_covariance: (3, 3) covariance of the angular velocity in the bar's axes, as its gyroscope measures it.
    """

    name: str
    T_world_bar: Array
    velocity_m_s: Array
    rate_rad_s: Array
    covariance: Array
    rate_covariance: Array
    bar_rate_covariance: Array


@dataclass(frozen=True)
class Hold:
    """State of an endcap's contact, as probabilities that sum to 1; NaN without a reading that shows it.

    Attributes:
        holds: the endcap touches and stays.
        rolls: it rolls without slip.
        slips: its skin moves over the support.
        free: it touches nothing.
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
        name: name of the endcap.
        centre_m: (3,) centre of its sphere without load, world.
        covariance: (3, 3) covariance of the centre, m2.
        hold: probabilities of its contact's state.
        contact_m: (3,) contact point on the support, world: the load has pressed the dome's sphere toward the bar.
        normal: (3,) unit, out of the support, world.
        normal_sd_rad: standard deviation of the normal's direction, rad.
        force_n: (3,) force on the endcap, world axes; NaN without a reading.
        friction_ratio, friction_ratio_sd: tangential over normal force; NaN without contact, as contact and normal.
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
    """Whether the estimate agrees with the samples.

    Attributes:
        lengths_consistency, anchors_consistency: fading mean of squared innovations over their variances: below 1 for a
            correct model, since variances contain errors that stay, too; that of anchors begins at 1 again once they
            have contradicted place and velocity.
        weight_ratio: fading mean of the vertical forces' sum over the weight, of times at which all endcaps report and
            the robot does not accelerate; NaN before the first.
        rejected: number of rejected lengths in the last sample.
        ignored: number of samples with NaN, with impossible numbers, or too old, since the start.
        notes: one line for each fault or missing sensor.
    """

    lengths_consistency: float
    anchors_consistency: float
    weight_ratio: float
    rejected: int
    ignored: int
    notes: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether nothing is missing and innovations agree with their variances."""
        return not self.notes


@dataclass(frozen=True)
class RobotEstimate:
    """The robot at one time.

    Attributes:
        time_s: time of the estimate.
        measured_s: capture time of the newest sample that it uses.
        bars, endcaps: in the order of the description.
        centre_of_mass_m: (3,) centre of mass, world.
        centre_of_mass_covariance: (3, 3) its covariance, m2.
        friction, friction_sd: mean and standard deviation of the supports' learned coefficient of friction.
        softness, softness_sd: learned relative excess of the domes' yield over ``Settings.compliance_m_n``, and its
            standard deviation; forces that are measured too small by that part have the same effect.
        delay_s, delay_sd_s: learned excess of the domes' delay over ``yield_delay_s``, and its standard deviation, s;
            stamps of the readings that are late by so much have the opposite effect.
        health: whether the estimate agrees with the samples.
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
    delay_s: float
    delay_sd_s: float
    health: Health
