"""Where an endcap is touched: the centre of pressure on the undeformed sphere (mm, endcap frame; N, N m).

Notes:
    A push at one point has its force's line of action through that point. Friction about the normal, of a contact that
    pivots, is a couple, which moves that line away by m sin(a) / |f| (m the couple, a the angle of the force from the
    normal). So the place is that of the sphere where force and a couple about its normal are the wrench, in closed form
    (soft finger on a sphere: Bicchi, Salisbury and Brock 1993, Int. J. Robotics Research 12(3)); without a couple it is
    where the line of action enters the sphere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.frames import MM_PER_M

LEAST_FORCE_N = 0.05  # at D=130 T=8: below it the line of action is noise
LEAST_PUSH = 0.1  # normal over whole force: no friction holds a contact below it
MOST_LEVER = 1.0  # E: couple over normal force, in radii: no contact is as large as that


@dataclass(frozen=True)
class PressureCentre:
    """Place of a contact on the sphere.

    Attributes:
        position_mm: (3,) endcap frame, on the undeformed outer sphere; NaN without force.
        miss_mm: by how much the line of action passes the sphere (0 when it meets it); where no contact explains the
            wrench, the place is where the line enters the sphere, or the point nearest to it.
        spin_nm: couple about the outward normal at the place; about the line where no contact explains the wrench.
    """

    position_mm: NDArray[np.float64]
    miss_mm: float
    spin_nm: float


def contact_centre(
    force: NDArray[np.float64],
    torque: NDArray[np.float64],
    radius_mm: float,
    centre_height_mm: float,
    load_scale: float = 1.0,
) -> PressureCentre:
    """Where a contact that gives this wrench touches the sphere.

    Args:
        force: (3,) N.
        torque: (3,) N m about the sphere's centre.
        radius_mm: of the sphere.
        centre_height_mm: its centre's z.
        load_scale: how large the endcap's forces are (:mod:`sensing.wrench.load_scale`).

    Notes:
        At an outward normal n the torque over the radius is t = n x f + k n. Its product with f gives k = t.f / (n.f),
        its square an equation for the push p = -n.f, and n solves the linear rest. Flattening by a depth d moves the
        true centre inward by about d along n.
    """
    fx, fy, fz = force.tolist()  # plain floats: a tenth of numpy's time
    tx, ty, tz = (x * MM_PER_M / radius_mm for x in torque.tolist())
    square = fx * fx + fy * fy + fz * fz
    norm = math.sqrt(square)
    if not norm >= LEAST_FORCE_N * load_scale:
        return PressureCentre(np.full(3, np.nan), float("nan"), float("nan"))
    x, y, z = fy * tz - fz * ty, fz * tx - fx * tz, fx * ty - fy * tx
    reach = math.sqrt(x * x + y * y + z * z) / square  # of the line from the sphere's centre, radii
    along, excess = fx * tx + fy * ty + fz * tz, square - tx * tx - ty * ty - tz * tz
    push = math.sqrt(0.5 * max(0.0, excess + math.hypot(excess, 2.0 * along)))
    if push >= LEAST_PUSH * norm and abs(along) <= MOST_LEVER * push * push:
        couple, back = -along / push, push
        x, y, z = x + couple * tx, y + couple * ty, z + couple * tz
    else:
        couple, back = along / norm, norm * math.sqrt(max(0.0, 1.0 - reach * reach))
    x, y, z = x - back * fx, y - back * fy, z - back * fz
    size = radius_mm / math.sqrt(x * x + y * y + z * z)
    position = np.array([size * x, size * y, size * z + centre_height_mm])
    return PressureCentre(position, radius_mm * max(0.0, reach - 1.0), couple * radius_mm / MM_PER_M)
