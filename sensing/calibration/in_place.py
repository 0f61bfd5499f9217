"""Which dot of the pattern is which blob where the assumed camera sees nearly all of them on their places: no search.

A fifth of the time of :func:`sensing.calibration.assign.assign_dots`; a blob between two places may find another
partner.
"""

from __future__ import annotations

import numpy as np

from cad.params import EndcapParams
from sensing.calibration.assign import SURE, Fit
from sensing.calibration.dots import (
    FEWEST_TO_FIT,
    DotPairs,
    mutual_nearest,
    neighbour_ratio,
    pattern_points,
    possible_pairs,
    spacing_px,
)
from sensing.calibration.turns import best_turn
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.parameters import camera_vector


def assign_in_place(
    blobs_px: Array, params: EndcapParams, start: MountedCamera, fit: Fit
) -> tuple[DotPairs, MountedCamera] | None:
    """As :func:`assign_dots`, without a search; None unless the start camera sees nearly all dots on their places.

    Args:
        blobs_px: (n, 2) blob centres. params: the design. start: the camera. fit: refines it.
    """
    points, rings = pattern_points(params)
    if len(blobs_px) < FEWEST_TO_FIT:
        return None
    every, near = np.ones(len(points), bool), 0.2 * spacing_px(blobs_px) * neighbour_ratio(start, points)
    pairs = mutual_nearest(blobs_px, start, points, every, near)
    if len(pairs.blob_index) < SURE * possible_pairs(start, points, blobs_px):
        return None
    if best_turn(start, blobs_px, points, rings, np.degrees(camera_vector(start)[7])).angle_rad:
        return None
    mounted = fit(start, points[pairs.pattern_index], blobs_px[pairs.blob_index])
    return mutual_nearest(blobs_px, mounted, points, every, near), mounted
