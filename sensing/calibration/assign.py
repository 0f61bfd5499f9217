"""Assignment of the blobs in a photo to the dots of the pattern.

The assignment needs no first guess: candidate tips and azimuths are scored with rings 0 to 3, the fit then grows ring
by ring, and among rotations under which the pattern looks the same the best is taken
(:mod:`sensing.calibration.turns`). Unpainted dots are left out; specks, digits and smears get no partner.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.calibration.dots import (
    FEWEST_TO_FIT,
    CalibrationError,
    DotPairs,
    fewest_dots,
    more_dots_words,
    mutual_nearest,
    neighbour_ratio,
    pattern_points,
    possible_pairs,
    spacing_px,
)
from sensing.calibration.search import candidates
from sensing.calibration.turns import best_turn, turned
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera

SURE, LEAST_MATCHED = 0.85, 0.6  # share of the pairs that there can be: ends the search, and is needed at its end

Fit = Callable[[MountedCamera, Array, Array], MountedCamera]


def assign_dots(
    blobs_px: Array, params: EndcapParams, start: MountedCamera, fit: Fit, azimuth_hint_deg: float = 0.0
) -> tuple[DotPairs, MountedCamera]:
    """Match blobs to the pattern without a known pose.

    Args:
        blobs_px: (n, 2) blob centres.
        params: the design whose pattern it is.
        start: a camera with plausible distortion; its focal length, centre and azimuth are searched.
        fit: takes a camera, points (m, 3) and pixels (m, 2), returns the refined camera.
        azimuth_hint_deg: rough turn of the image against the endcap, +-90 degrees.

    Raises:
        CalibrationError: too few blobs, or no pose under which rings 0 to 3 are seen.
    """
    points, rings = pattern_points(params)
    fewest = fewest_dots(start, points)
    if len(blobs_px) < fewest:
        photo = "sharper photo, with dots darker than the silicone, or give dots as a CSV"
        remedy = more_dots_words(start, params, photo)
        raise CalibrationError(f"{len(blobs_px)} dots found, at least {fewest} needed: {remedy}")
    best: tuple[int, DotPairs, MountedCamera] | None = None
    for candidate in candidates(blobs_px, points, rings, start, azimuth_hint_deg):
        pairs, mounted = _grown(blobs_px, candidate, points, rings, fit)
        turn = best_turn(mounted, blobs_px, points, rings, azimuth_hint_deg)
        if turn.angle_rad:
            pairs, mounted = _grown(blobs_px, turned(mounted, turn.angle_rad), points, rings, fit)
        if best is None or len(pairs.blob_index) > best[0]:
            best = len(pairs.blob_index), pairs, mounted
        if best[0] >= SURE * possible_pairs(best[2], points, blobs_px):
            return best[1], best[2]
    if best is None or best[0] < LEAST_MATCHED * possible_pairs(best[2], points, blobs_px):
        matched = "no pose under which rings 0 to 3 are seen" if best is None else f"{best[0]} dots matched"
        raise CalibrationError(
            f"pattern not recognised: {matched} of {len(blobs_px)} found (need {100 * LEAST_MATCHED:.0f} %); "
            "check --diameter, --wall, --dot-rings and --dot-mm, take an undeformed photo, or give dots as a CSV"
        )
    return best[1], best[2]


def _grown(
    blobs_px: Array, mounted: MountedCamera, points: Array, rings: NDArray[np.intp], fit: Fit
) -> tuple[DotPairs, MountedCamera]:
    """Pairs and camera, fitted ring by ring from the tip outward."""
    spacing, last = spacing_px(blobs_px) * neighbour_ratio(mounted, points), int(rings.max())
    for ring in [*range(2, last + 1), last, last]:
        tolerance = spacing * (0.3 if ring < last else 0.2)
        pairs = mutual_nearest(blobs_px, mounted, points, rings <= ring, tolerance)
        if len(pairs.blob_index) < FEWEST_TO_FIT:
            break
        mounted = fit(mounted, points[pairs.pattern_index], blobs_px[pairs.blob_index])
    return mutual_nearest(blobs_px, mounted, points, rings <= last, 0.2 * spacing), mounted
