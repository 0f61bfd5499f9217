"""Errors of contact centre and normal in sets that record the plane; in degrees about the sphere's centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.frames import MM_PER_M, T_sphere_endcap, wrench_in
from sensing.records import Wrench
from sensing.records_labelled import LabelledFrame
from sensing.wrench.plane_contact import PlaneContactLaw, pressure_point

Array = NDArray[np.float64]
UNKNOWN = np.full(4, np.nan)  # errors of a frame without a known plane


def place_errors(item: LabelledFrame, estimate: Wrench, law: PlaneContactLaw | None, params: EndcapParams) -> Array:
    """(4,) degrees: errors of centre and normal, and the standard deviations that the answer states; NaN where unknown.

    Args:
        item: labelled frame.
        estimate: estimated wrench, endcap or sphere frame.
        law: contact law of the endcap; None without a plane.
        params: design.

    Notes:
        The true plane is the world's z = 0, and the true centre follows from the true wrench on it.
    """
    pose = np.asarray(item.labels["T_world_endcap"], float)
    if law is None or pose.shape != (4, 4) or not (item.contact and np.isfinite(pose).all()):
        return UNKNOWN
    centre = np.array([0.0, 0.0, params.centre_height_mm])
    outward, height = -pose[2, :3], float(pose[2, :3] @ centre + pose[2, 3])
    true = _about_centre(item.wrench, params)
    if not float(true.force_n @ outward) < 0:
        return UNKNOWN
    point = pressure_point(true.force_n, MM_PER_M * true.torque_nm, outward, height)
    found = law.of(_about_centre(estimate, params))
    sd = np.degrees(found.position_sd_mm / np.linalg.norm(point)), found.normal_sd_deg
    return np.array([_apart_deg(found.position_mm - centre, point), _apart_deg(found.normal, outward), *sd])


def _about_centre(wrench: Wrench, params: EndcapParams) -> Wrench:
    return wrench if wrench.frame == "sphere" else wrench_in(wrench, T_sphere_endcap(params), "sphere")


def _apart_deg(first: Array, second: Array) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))
