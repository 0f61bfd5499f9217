"""Contact from one wrench: normal, normal force and friction ratio, with their uncertainties.

Notes:
    A push has its line of action through the contact point, but friction about the normal is a couple, which moves that
    line away: by up to 1.8 degrees (rms) of the normal in simulated walks. So the contact is the place of the sphere
    where force and a couple about its normal are the wrench, in closed form (soft finger on a sphere: Bicchi, Salisbury
    and Brock 1993, Int. J. Robotics Research 12(3)). The full outer radius is used: against our finite elements,
    without such a couple, the normal is then off by at most 1.9 degrees, and by 7 if the sphere is shrunk by the
    indentation.
    Normal and ratio do not depend on the scale of the wrench, so a silicone of another stiffness does not change them.
    Tangential force F and torque T about the normal share the friction of a contact, (F / mu)^2 + (T / lever)^2 = N^2
    where it slips (an ellipsoid: Howe and Cutkosky 1996, doi:10.1177/027836499601500603), and it then moves along the
    ellipsoid's normal: at F lever^2 / (T mu^2) times the rate about its normal, against F.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sensing.robot.contact_kernels import line_of_action_slopes
from sensing.robot.layout import Layout
from sensing.robot.settings import Settings
from sensing.tensegrity.description import Array
from sensing.tensegrity.samples import FootSample

# E: errors of a wrench without covariance: standard deviations, and additions in proportion to the force's size.
FORCE_SD_N, TORQUE_SD_NM, SHARE, LEVER_SHARE_M = 0.2, 0.01, 0.02, 0.0005
SPIN_SHARE = 0.3  # E: relative error of the needed coefficient where the torque uses all friction
UNCONFIRMED = "unconfirmed"  # flag of a reading that waits for the next frame (sensing.live.core.gate)
OUT_OF_RANGE = 2.0  # E: factor on the variance of a flagged wrench
LEAST_PUSH = 0.1  # normal over whole force; below it the line of action grazes or misses the sphere


@dataclass(frozen=True)
class Contact:
    """Contact from one sample; bar axes.

    Attributes:
        touching: whether the endcap touches; None where the sample leaves that open.
        known: whether the numbers below are valid.
        force_n: (3,) force on the endcap, N.
        force_covariance: (3, 3) covariance of its errors, N^2; NaN without valid numbers.
        normal: (3,) unit normal, out of the endcap.
        push_n: normal force, N.
        ratio: tangential over normal force.
        use: least coefficient of friction for this force and the torque about the normal.
        spin_m: that torque over the normal force, m.
        normal_sd, ratio_sd, use_sd: standard deviations (rad, 1).
    """

    touching: bool | None
    known: bool
    force_n: Array
    force_covariance: Array
    normal: Array
    push_n: float
    ratio: float
    use: float
    spin_m: float
    normal_sd: float
    ratio_sd: float
    use_sd: float


_NOTHING = np.full(3, np.nan)  # vector of a contact without valid numbers
_NO_SPREAD = np.full((3, 3), np.nan)  # covariance of such a contact
_NO_NUMBERS = (math.nan,) * 6  # scalars of a contact without valid numbers


def contact_of(sample: FootSample, endcap: int, layout: Layout, settings: Settings) -> Contact:
    """Contact from one sample.

    Args:
        sample: sample of the endcap.
        endcap: number of the endcap.
        layout, settings: indices and assumptions of the estimator.
    """
    force = np.asarray(sample.force_n, float)
    torque = np.asarray(sample.torque_nm, float)
    size = math.sqrt(float(force @ force))
    if UNCONFIRMED in sample.flags:  # its force and contact bit are predictions of the wrench filter
        return Contact(None, False, _NOTHING, _NO_SPREAD, _NOTHING, math.nan, *_NO_NUMBERS)
    if not math.isfinite(size + float(torque.sum())):
        return Contact(sample.touching, False, _NOTHING, _NO_SPREAD, _NOTHING, math.nan, *_NO_NUMBERS)
    touching = size >= settings.least_force_n if sample.touching is None else sample.touching
    turn = layout.endcap_turn[endcap]
    if size < settings.least_force_n:
        return Contact(touching, False, turn @ force, _NO_SPREAD, _NOTHING, size, *_NO_NUMBERS)
    yields_m = layout.compliance_m_n(endcap, settings) * size
    if yields_m > layout.radius_m[endcap]:  # no dome yields by more: a spike of the sensor
        return Contact(touching, False, turn @ force, _NO_SPREAD, _NOTHING, math.nan, *_NO_NUMBERS)
    height = float(layout.centre_height_m[endcap])
    about = np.array([*force, torque[0] + height * force[1], torque[1] - height * force[0], torque[2]])
    value, slopes = line_of_action_slopes(about, float(layout.radius_m[endcap]), settings.spin_lever_m)
    covariance = np.array(sample.covariance, float)
    if not (np.isfinite(covariance).all() and (np.diag(covariance) > 0).all()):  # 0 and -1: unknown, as in ROS
        covariance = np.diag([(FORCE_SD_N + SHARE * size) ** 2] * 3 + [(TORQUE_SD_NM + LEVER_SHARE_M * size) ** 2] * 3)
    lever = np.eye(6)
    lever[3, 1], lever[4, 0] = height, -height
    if not (np.isfinite(value[:3]).all() and value[3] > LEAST_PUSH * size and value[6] < layout.radius_m[endcap]):
        return Contact(touching, False, turn @ force, _NO_SPREAD, _NOTHING, math.nan, *_NO_NUMBERS)
    slopes = slopes @ lever
    if "out_of_range" in sample.flags:
        covariance = OUT_OF_RANGE * covariance
    spread = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
    normal_sd = math.sqrt(max(0.0, float(spread[:3].sum()) / 2))
    ratio_sd, use_sd = np.sqrt(np.maximum(0.0, spread[4:6])).tolist()
    push, ratio, use, spin = value[3:].tolist()
    use_sd += SPIN_SHARE * use * min(1.0, spin / settings.spin_lever_m) ** 4
    return Contact(
        touching, True, turn @ force, turn @ covariance[:3, :3] @ turn.T, turn @ value[:3],
        push, ratio, use, spin, normal_sd, ratio_sd, use_sd,
    )  # fmt: skip
