"""Which dot of the pattern is which blob of a photo: a small finder for calibration, and the assignment.

The finder works on one undeformed photo and is meant for calibration only (tracking has its own). The assignment needs
no start: the spacing of the blobs gives the scale, candidate tips and azimuths are scored with rings 0 to 3, and the
fit then grows ring by ring. Unpainted dots are simply not found; specks, digits and smears find no partner.

The pattern's counts are all even, so it maps onto itself after half a turn: azimuth is known only modulo 180 degrees
and the caller says which half (``azimuth_hint_deg``). Pixels as in :mod:`sensing.camera.model`.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern, dot_position_mm
from cad.errors import EndcapError, FileError
from cad.params import EndcapParams
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera

REFERENCE_HEIGHT_PX = 480  # blob sizes below are for a dot of 14 px at this image height
BLUR_PX = 1.0
BACKGROUND_PX = 37  # odd window of the median that removes dots: over twice a dot, under the dot spacing
MIN_CONTRAST = 0.22  # relative to the silicone around it; ink measures 0.35 to 0.8, stains and seams under 0.15
AREA_PX = (35.0, 520.0)
SEARCH_RINGS = 4
TIP_CANDIDATES = 20
ANCHORS = 7  # the tip, then ring 1
NEAR_STEPS = 4  # of a fifth of the dots' spacing: 32 px at 480 rows
FEWEST_TO_FIT = 7
SURE, LEAST_MATCHED = 0.85, 0.6  # share of the pairs that there can be: ends the search, and is needed at its end


class CalibrationError(EndcapError):
    """Photo, dots or views from which no camera can be calibrated."""


@dataclass(frozen=True)
class DotPairs:
    """Pattern dots matched to image blobs.

    Attributes:
        pattern_index: (n,) index into ``cad.dots.dot_pattern(params)``.
        blob_index: (n,) index into the given blobs.
    """

    pattern_index: NDArray[np.intp]
    blob_index: NDArray[np.intp]


Fit = Callable[[MountedCamera, Array, Array], MountedCamera]


def find_dots(image_bgr: NDArray[np.uint8]) -> Array:
    """Centres (n, 2) of the dark blobs of an undeformed photo, weighted by contrast, in px.

    Args:
        image_bgr: (h, w, 3) photo. Blue and green are used: ink near the tip glints orange and is bright in red.
    """
    return find_blobs(image_bgr)[0]


def find_blobs(image_bgr: NDArray[np.uint8]) -> tuple[Array, Array]:
    """Centres (n, 2) as :func:`find_dots`, and radii (n,) of circles of the blobs' areas, in px."""
    scale = image_bgr.shape[0] / REFERENCE_HEIGHT_PX
    gray = image_bgr[..., :2].astype(np.float32).mean(-1)
    gray = cv2.GaussianBlur(gray, (0, 0), BLUR_PX * scale)
    window = round(BACKGROUND_PX * scale / 2) * 2 + 1
    background = cv2.medianBlur(np.clip(gray, 0, 255).astype(np.uint8), window).astype(np.float32)
    contrast = (background - gray) / np.maximum(background, 25)
    count, labels, stats, _ = cv2.connectedComponentsWithStats((contrast > MIN_CONTRAST).astype(np.uint8))
    area = stats[:, cv2.CC_STAT_AREA] / scale**2
    weight = np.maximum(contrast, 0).ravel()
    rows, columns = np.indices(labels.shape)
    total = np.maximum(np.bincount(labels.ravel(), weight, count), 1e-9)  # a black picture has no weight
    centres = np.stack(
        [np.bincount(labels.ravel(), weight * axis.ravel(), count) / total for axis in (columns, rows)], -1
    )
    left, top, width, height = stats[:, :4].T
    whole = (left > 0) & (top > 0) & (left + width < labels.shape[1]) & (top + height < labels.shape[0])
    keep = (area > AREA_PX[0]) & (area < AREA_PX[1]) & whole  # a dot cut by the frame has its centre elsewhere
    return centres[keep], np.sqrt(area[keep] / np.pi) * scale


def read_dots(path: str | Path) -> Array:
    """Blob centres (n, 2) from a CSV with the columns u_px and v_px.

    Raises:
        FileError: missing file or columns, or text that is not a number (naming the line).
    """
    try:
        with Path(path).open(newline="") as stream:
            table = csv.DictReader(stream)
            values = [(float(row["u_px"]), float(row["v_px"])) for row in table]
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror})") from error
    except (KeyError, TypeError, ValueError) as error:
        raise FileError(
            f"{path}: line {table.line_num}: need numbers in the columns u_px and v_px ({error})"
        ) from error
    return np.array(values, dtype=float).reshape(-1, 2)


def pattern_points(params: EndcapParams) -> tuple[Array, NDArray[np.intp]]:
    """Positions (n, 3) of the pattern's dots in the endcap frame (mm) and their ring numbers (n,)."""
    dots = dot_pattern(params)
    return np.array([dot_position_mm(params, dot) for dot in dots]), np.array([dot.ring for dot in dots])


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
    if len(blobs_px) < 20:
        raise CalibrationError(f"{len(blobs_px)} dots found, at least 20 needed: sharper photo, or give dots as a CSV")
    best: tuple[int, DotPairs, MountedCamera] | None = None
    for candidate in _candidates(blobs_px, points[rings < SEARCH_RINGS], start, azimuth_hint_deg):
        pairs, mounted = _grown(blobs_px, candidate, points, rings, fit)
        if best is None or len(pairs.blob_index) > best[0]:
            best = len(pairs.blob_index), pairs, mounted
        if best[0] >= SURE * possible_pairs(best[2], points, blobs_px):
            return best[1], best[2]
    if best is None or best[0] < LEAST_MATCHED * possible_pairs(best[2], points, blobs_px):
        matched = "no pose under which rings 0 to 3 are seen" if best is None else f"{best[0]} dots matched"
        raise CalibrationError(
            f"pattern not recognised: {matched} of {len(blobs_px)} found (need {100 * LEAST_MATCHED:.0f} %); "
            f"check --diameter and --wall, take an undeformed photo, or give dots as a CSV"
        )
    return best[1], best[2]


def _grown(
    blobs_px: Array, mounted: MountedCamera, points: Array, rings: NDArray[np.intp], fit: Fit
) -> tuple[DotPairs, MountedCamera]:
    """Pairs and camera, fitted ring by ring from the tip outward."""
    spacing, last = spacing_px(blobs_px), int(rings.max())
    for ring in [*range(2, last + 1), last, last]:
        tolerance = spacing * (0.3 if ring < last else 0.2)
        pairs = mutual_nearest(blobs_px, mounted, points, rings <= ring, tolerance)
        if len(pairs.blob_index) < FEWEST_TO_FIT:
            break
        mounted = fit(mounted, points[pairs.pattern_index], blobs_px[pairs.blob_index])
    return mutual_nearest(blobs_px, mounted, points, rings <= last, 0.2 * spacing), mounted


def possible_pairs(mounted: MountedCamera, points: Array, blobs_px: Array) -> int:
    """How many pairs there can be: blobs, or dots that the camera sees.

    Args:
        mounted: the camera. points: (n, 3) dots of the pattern, endcap frame, mm. blobs_px: (m, 2) blob centres.
    """
    pixels = mounted.project(points)
    size = (mounted.camera.width_px, mounted.camera.height_px)
    return min(len(blobs_px), int(((pixels > 0) & (pixels < np.array(size) - 1)).all(axis=1).sum()))


def _candidates(
    blobs_px: Array, points: Array, start: MountedCamera, azimuth_hint_deg: float
) -> Iterator[MountedCamera]:
    """Cameras to begin with: near the start at any azimuth, then any scale and place.

    In the second search some blob is taken for the tip or, where the tip is not painted, for a dot of the first ring.
    """
    scores = _Scores(blobs_px, (start.camera.width_px, start.camera.height_px))
    yield _near(scores, points, start, azimuth_hint_deg)
    for anchor in range(ANCHORS):
        score, mounted = _search_from(scores, points, anchor, start, azimuth_hint_deg)
        if score >= 0.4 * len(points):
            yield mounted


def _near(scores: _Scores, points: Array, start: MountedCamera, azimuth_hint_deg: float) -> MountedCamera:
    """The start camera, turned about its axis and its picture shifted so that most of the dots lie on blobs."""
    middle = np.array([start.camera.cx_px, start.camera.cy_px])
    pattern = start.project(points) - middle
    reach = np.arange(-NEAR_STEPS, NEAR_STEPS + 1) * scores.tolerance_px
    shifts = np.stack(np.meshgrid(reach, reach), -1).reshape(-1, 1, 2)
    best, choice = -1.0, (0.0, start.project(points[0]))
    for azimuth in np.radians(azimuth_hint_deg + np.arange(-90, 90, 2)):
        turn = np.array([[np.cos(azimuth), -np.sin(azimuth)], [np.sin(azimuth), np.cos(azimuth)]])
        where = pattern @ turn.T + middle + shifts
        score = scores.of(where)
        if score.max() > best:
            best, choice = float(score.max()), (azimuth, where[score.argmax(), 0])
    return _place(start, 1.0, *choice, points[0])


def spacing_px(blobs_px: Array) -> float:
    """Median distance of a blob to its nearest neighbour: about one polar step."""
    distance = np.linalg.norm(blobs_px[:, None] - blobs_px[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    return float(np.median(distance.min(axis=1)))


class _Scores:
    """How well points lie on blobs: 1 at a blob's centre, falling to 0 at a fifth of the blobs' spacing.

    Looked up in a picture of the distance to the nearest blob, because a search asks for a million points.
    """

    def __init__(self, blobs_px: Array, size_px: tuple[int, int]) -> None:
        self.blobs_px, self.spacing_px = blobs_px, spacing_px(blobs_px)
        self.tolerance_px = 0.2 * self.spacing_px
        width, height = size_px
        free = np.ones((height, width), np.uint8)
        column, row = np.rint(blobs_px).astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        free[row[inside], column[inside]] = 0
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        self._map = np.zeros((height + 1, width + 1), np.float32)  # the last row and column stand for outside
        self._map[:-1, :-1] = np.maximum(0, 1 - (distance / self.tolerance_px) ** 2)

    def of(self, where: Array) -> Array:
        """Sum over the points of each candidate: (..., n, 2) to (...)."""
        height, width = self._map.shape
        column, row = (np.rint(where[..., axis]) for axis in (0, 1))
        inside = (column >= 0) & (column < width - 1) & (row >= 0) & (row < height - 1)
        column, row = (
            np.where(inside, a, last).astype(np.intp) for a, last in ((column, width - 1), (row, height - 1))
        )
        return self._map[row, column].sum(axis=-1)


def _search_from(
    scores: _Scores, points: Array, anchor: int, start: MountedCamera, azimuth_hint_deg: float
) -> tuple[float, MountedCamera]:
    """(score, camera) of the best candidate in which a pattern dot, the anchor, lies on a blob near the middle."""
    blobs, spacing = scores.blobs_px, scores.spacing_px
    pattern = start.project(points)
    step = float(np.median(np.linalg.norm(pattern[1:7] - pattern[0], axis=1)))
    pattern = pattern - pattern[anchor]
    order = np.argsort(np.linalg.norm(blobs - np.median(blobs, axis=0), axis=1))
    best, choice = -1.0, (1.0, 0.0, blobs[0])
    for scale in spacing / step * np.geomspace(0.8, 1.35, 12):
        for azimuth in np.radians(azimuth_hint_deg + np.arange(-90, 90, 2)):
            turn = np.array([[np.cos(azimuth), -np.sin(azimuth)], [np.sin(azimuth), np.cos(azimuth)]])
            moved = scale * pattern @ turn.T
            where = blobs[order[:TIP_CANDIDATES], None] + moved
            score = scores.of(where)
            if score.max() > best:
                best, choice = float(score.max()), (scale, azimuth, where[score.argmax(), 0])
    return best, _place(start, *choice, points[0])


def _place(start: MountedCamera, scale: float, azimuth: float, tip_px: Array, tip_mm: Array) -> MountedCamera:
    """The start camera with another focal length, turned about its axis, its centre moved to put the tip on a blob."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(azimuth), -np.sin(azimuth)], [np.sin(azimuth), np.cos(azimuth)]]
    camera = replace(start.camera, fx_px=start.camera.fx_px * scale, fy_px=start.camera.fy_px * scale)
    T = turn @ start.T_camera_endcap
    offset = tip_px - MountedCamera(camera, T).project(tip_mm)
    return MountedCamera(replace(camera, cx_px=camera.cx_px + offset[0], cy_px=camera.cy_px + offset[1]), T)


def mutual_nearest(
    blobs_px: Array, mounted: MountedCamera, points: Array, use: NDArray[np.bool_], tolerance_px: float
) -> DotPairs:
    """Pairs that are each other's nearest, within a tolerance.

    Args:
        blobs_px: (m, 2) found dots. mounted: the camera. points: (n, 3) of the pattern, endcap frame, mm.
        use: (n,) the pattern's dots to consider. tolerance_px: largest distance of a pair.
    """
    predicted = mounted.project(points)
    candidates = np.flatnonzero(use & np.isfinite(predicted[:, 0]))
    if not len(candidates) or not len(blobs_px):
        return DotPairs(np.zeros(0, np.intp), np.zeros(0, np.intp))
    distance = np.linalg.norm(predicted[candidates, None] - blobs_px[None], axis=-1)  # (candidates, blobs)
    blob = distance.argmin(axis=1)
    own = np.arange(len(candidates))
    near = (distance[own, blob] <= tolerance_px) & (distance.argmin(axis=0)[blob] == own)
    return DotPairs(candidates[near], blob[near])
