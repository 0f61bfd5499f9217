"""How large the dots of a design look in a picture, and how near to each other they lie: what finding them starts from.

The nominal camera sees dots of 4 mm at D = 130 mm as 18 of 480 px, on a dome of 100 mm as 32, on one of 250 mm as 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from cad.dots import dot_pattern, dot_position_mm
from cad.params import EndcapParams
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount

RELEASED = EndcapParams(130.0, 8.0)


@dataclass(frozen=True)
class DotLook:
    """Dots in the picture of the nominal camera.

    Attributes:
        scale: median diameter of the dots over that of the released design's.
        least_pitch: least distance between the centres of two dots over the picture's short side.
    """

    scale: float
    least_pitch: float


@cache
def dot_look(params: EndcapParams | None = None) -> DotLook:
    """The look of a design.

    Args:
        params: the design; None for the released one.
    """
    median, pitch = _measured(params or RELEASED)
    return DotLook(median / _measured(RELEASED)[0], pitch)


@cache
def _measured(params: EndcapParams) -> tuple[float, float]:
    """(median radius, least pitch) of the dots that the nominal camera sees, over the picture's short side."""
    mounted = nominal_mount(params)
    short = min(mounted.camera.width_px, mounted.camera.height_px)
    points = np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)])
    pixels = mounted.project(points)
    seen = mounted.sees(points)
    apart = np.linalg.norm(pixels[seen, None] - pixels[None, seen], axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(disc_radius_px(mounted, points[seen], params))) / short, float(apart.min()) / short


def disc_radius_px(mounted: MountedCamera, points_mm: Array, params: EndcapParams) -> Array:
    """(n,) radius of the circle with the area that the discs of the dots cover in the picture.

    Args:
        mounted: the camera.
        points_mm: (n, 3) centres of dots, endcap frame.
        params: the design.
    """
    slope = mounted.camera.jacobians(mounted.to_camera(points_mm))[0] @ mounted.T_camera_endcap[:3, :3]  # (n, 2, 3)
    outward = points_mm - [0, 0, params.centre_height_mm]
    outward = outward / np.linalg.norm(outward, axis=1)[:, None]
    areas = np.abs(np.einsum("na,na->n", np.cross(slope[:, 0], slope[:, 1]), outward))  # px^2 a mm^2 of the dome
    return np.asarray(params.dot_radius_mm * np.sqrt(areas))
