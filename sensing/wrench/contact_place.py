"""Where an endcap is touched: the centre of pressure on the undeformed sphere (mm, endcap frame; N, N m).

A single push at one point has its force's line of action through that point, and the line meets the sphere there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.frames import MM_PER_M

LEAST_FORCE_N = 0.05  # at D=130 T=8: below it the line of action is noise


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


def line_of_action(
    force: NDArray[np.float64],
    torque: NDArray[np.float64],
    radius_mm: float,
    centre_height_mm: float,
    load_scale: float = 1.0,
) -> PressureCentre:
    """Where the line of a force enters the sphere.

    Args:
        force: (3,) N.
        torque: (3,) N m about the sphere's centre.
        radius_mm: of the sphere.
        centre_height_mm: its centre's z.
        load_scale: how large the endcap's forces are (:mod:`sensing.wrench.load_scale`).

    Notes:
        Torque t of a force f at r is r x f. The line's foot is r0 = f x t / |f|^2, and r = r0 - sqrt(R^2 - |r0|^2)
        f / |f| is where it enters: a push points inward, f.r < 0. Flattening by a depth d moves the true centre
        inward by about d along r.
    """
    (fx, fy, fz), (tx, ty, tz) = force.tolist(), torque.tolist()  # plain floats: a tenth of numpy's time
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    if not norm >= LEAST_FORCE_N * load_scale:
        return PressureCentre(np.full(3, np.nan), float("nan"), float("nan"))
    lever = MM_PER_M / norm**2
    foot = (fy * tz - fz * ty) * lever, (fz * tx - fx * tz) * lever, (fx * ty - fy * tx) * lever
    reach = math.sqrt(foot[0] ** 2 + foot[1] ** 2 + foot[2] ** 2)
    inside = reach <= radius_mm
    share, back = (1.0, math.sqrt(radius_mm**2 - reach**2) / norm) if inside else (radius_mm / reach, 0.0)
    x, y, z = share * foot[0] - back * fx, share * foot[1] - back * fy, share * foot[2] - back * fz
    spin = (fx * tx + fy * ty + fz * tz) / norm
    return PressureCentre(np.array([x, y, z + centre_height_mm]), max(0.0, reach - radius_mm), spin)
