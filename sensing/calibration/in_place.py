"""Which dot of the pattern is which blob where the assumed camera sees nearly all of them on their places: no search.

Less work than :func:`sensing.calibration.assign.assign_dots`; a blob between two places may find another partner.
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

NEAR = 0.2  # of the dots' spacing


def assign_in_place(
    blobs_px: Array, params: EndcapParams, start: MountedCamera, fit: Fit
) -> tuple[DotPairs, MountedCamera] | None:
    """As :func:`assign_dots`, without a search; None unless the start camera sees nearly all dots on their places.

    Args:
        blobs_px: (n, 2) blob centres.
        params: the design.
        start: the camera.
        fit: refines it.
    """
    pairs = pairs_in_place(blobs_px, params, start, NEAR)
    if pairs is None:
        return None
    points = pattern_points(params)[0]
    mounted = fit(start, points[pairs.pattern_index], blobs_px[pairs.blob_index])
    reach = NEAR * spacing_px(blobs_px) * neighbour_ratio(start, points)
    return mutual_nearest(blobs_px, mounted, points, np.ones(len(points), bool), reach), mounted


def pairs_in_place(blobs_px: Array, params: EndcapParams, camera: MountedCamera, near: float) -> DotPairs | None:
    """Dots near where a camera sees them; None unless these are nearly all, and no turn of the pattern fits better.

    Args:
        blobs_px: (n, 2) blob centres.
        params: the design.
        camera: the one assumed.
        near: how far a dot may lie from its place, over the dots' spacing.
    """
    points, rings = pattern_points(params)
    if len(blobs_px) < FEWEST_TO_FIT:
        return None
    reach = near * spacing_px(blobs_px) * neighbour_ratio(camera, points)
    pairs = mutual_nearest(blobs_px, camera, points, np.ones(len(points), bool), reach)
    if len(pairs.blob_index) < SURE * possible_pairs(camera, points, blobs_px):
        return None
    azimuth_deg = float(np.degrees(camera_vector(camera)[7]))
    return None if best_turn(camera, blobs_px, points, rings, azimuth_deg).angle_rad else pairs
