"""Where an endcap is touched and how it holds: centre of pressure, contact patch, use of friction.

Centre of pressure from the wrench: a single push at one point has its force's line of action through that point,
and the line meets the sphere there. Contact patch from the field: under an approaching wall the dots spread, so the
centre of the spreading is the centre of the patch. Units: mm (endcap frame), N, N m, pixels of the 200 x 200 crop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.camera.mount import MountedCamera
from sensing.frames import MM_PER_M, T_sphere_endcap, wrench_in
from sensing.records import ShearField, Wrench
from sensing.tracking.gelslim import CROP_PX, divergence

LEAST_FORCE_N = 0.05  # below it the line of action is noise
HALF = 0.5  # cells that spread at least this share of the most belong to the patch
STICK_USE, SLIP_USE = 0.8, 0.97  # E: of the friction coefficient


@dataclass(frozen=True)
class PressureCentre:
    """Where the line of action enters the sphere.

    Attributes:
        position_mm: (3,) endcap frame, on the undeformed outer sphere; NaN without force.
        miss_mm: by how much the line passes the sphere (0 when it meets it; then the point nearest to it is given).
        spin_nm: torque about the line, which no single force explains.
    """

    position_mm: NDArray[np.float64]
    miss_mm: float
    spin_nm: float


@dataclass(frozen=True)
class Friction:
    """How much of the friction a contact uses.

    Attributes:
        normal_n: push along the inward normal at the centre of pressure. tangential_n: across it.
        use: tangential over normal force.
        state: ``stick``, ``slip`` or, between the two or without a coefficient to compare with, ``unknown``.
    """

    normal_n: float
    tangential_n: float
    use: float
    state: Literal["stick", "slip", "unknown"]


def pressure_centre(wrench: Wrench, params: EndcapParams) -> PressureCentre:
    """Centre of pressure of a wrench in the endcap or sphere frame.

    Raises:
        ParameterError: a wrench in any other frame.

    Notes:
        About the sphere's centre, torque t of a force f at r is r x f. The line's foot is r0 = f x t / |f|^2, and r =
        r0 - sqrt(R^2 - |r0|^2) f / |f| is where it enters: a push points inward, f.r < 0. Flattening by a depth d moves
        the true centre inward by about d along r.
    """
    if wrench.frame not in ("endcap", "sphere"):
        raise ParameterError(f"frame={wrench.frame!r}: give a wrench in the endcap or sphere frame", name="frame")
    about = wrench if wrench.frame == "sphere" else wrench_in(wrench, T_sphere_endcap(params), "sphere")
    return line_of_action(about.force_n, about.torque_nm, params.outer_radius_mm, params.centre_height_mm)


def line_of_action(
    force: NDArray[np.float64], torque: NDArray[np.float64], radius_mm: float, centre_height_mm: float
) -> PressureCentre:
    """Where the line of a force enters the sphere.

    Args:
        force: (3,) N. torque: (3,) N m about the sphere's centre. radius_mm: of the sphere. centre_height_mm: its
            centre's z.
    """
    (fx, fy, fz), (tx, ty, tz) = force.tolist(), torque.tolist()  # plain floats: a tenth of numpy's time
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    if not norm >= LEAST_FORCE_N:
        return PressureCentre(np.full(3, np.nan), float("nan"), float("nan"))
    lever = MM_PER_M / norm**2
    foot = (fy * tz - fz * ty) * lever, (fz * tx - fx * tz) * lever, (fx * ty - fy * tx) * lever
    reach = math.sqrt(foot[0] ** 2 + foot[1] ** 2 + foot[2] ** 2)
    inside = reach <= radius_mm
    share, back = (1.0, math.sqrt(radius_mm**2 - reach**2) / norm) if inside else (radius_mm / reach, 0.0)
    x, y, z = share * foot[0] - back * fx, share * foot[1] - back * fy, share * foot[2] - back * fz
    spin = (fx * tx + fy * ty + fz * tz) / norm
    return PressureCentre(np.array([x, y, z + centre_height_mm]), max(0.0, reach - radius_mm), spin)


def friction_use(
    wrench: Wrench, centre: PressureCentre, params: EndcapParams, coefficient: float | None = None
) -> Friction:
    """Friction in use at a contact; whether it holds is known only with a coefficient.

    Args:
        wrench: on the endcap. centre: of pressure. params: the design. coefficient: of friction; None where unknown.
    """
    outward = centre.position_mm - [0, 0, params.centre_height_mm]
    outward = outward / np.linalg.norm(outward)
    normal = -float(wrench.force_n @ outward)
    tangential = float(np.linalg.norm(wrench.force_n + normal * outward))
    use = tangential / normal if normal > 0 else float("inf")
    state: Literal["stick", "slip", "unknown"] = "unknown"
    if coefficient is not None and np.isfinite(normal):
        state = "stick" if use < STICK_USE * coefficient else "slip" if use >= SLIP_USE * coefficient else "unknown"
    return Friction(normal, tangential, use, state)


def patch_centre_px(field: ShearField) -> NDArray[np.float64]:
    """(2,) x, y of the contact patch's centre in the 200 x 200 crop; NaN where nothing spreads.

    The centroid of the cells whose divergence is at least half of the largest, weighted with it.
    """
    spread = np.where(field.valid, divergence(field.channel("u"), field.channel("v")), 0.0)
    top = float(spread.max(initial=0.0))
    if not top > 0:
        return np.full(2, np.nan)
    weight = np.where(spread >= HALF * top, spread, 0.0)
    height, width = spread.shape
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    x, y = (weight * columns).sum() / width, (weight * rows).sum() / height
    return np.array([x, y]) * CROP_PX / weight.sum() - 0.5


def place_on_dome(point_px: NDArray[np.float64], mounted: MountedCamera, params: EndcapParams) -> NDArray[np.float64]:
    """(3,) where the ray through a pixel of the 200 x 200 crop leaves the undeformed outer sphere (endcap frame).

    Args:
        point_px: (2,) in the crop. mounted: the camera. params: the design.
    """
    camera = mounted.camera
    side = min(camera.width_px, camera.height_px)
    corner = np.array([(camera.width_px - side) // 2, (camera.height_px - side) // 2])
    full_px = (np.asarray(point_px, float) + 0.5) * side / CROP_PX - 0.5 + corner
    ray = mounted.rays_endcap(full_px)
    start = mounted.pupil_endcap_mm - [0, 0, params.centre_height_mm]
    along = float(start @ ray)
    root = math.sqrt(max(0.0, along**2 - float(start @ start) + params.outer_radius_mm**2))
    return mounted.pupil_endcap_mm + (root - along) * ray
