"""Cameras to begin the assignment of dots with: near the start, or anywhere."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from sensing.calibration.dots import neighbour_ratio, spacing_px
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera

SEARCH_RINGS = 4  # innermost rings of the pattern, matched by scale, rotation and shift alone
TIP_CANDIDATES = 20  # blobs nearest to the middle of all that are tried as the anchor
MOST_ANCHORS = 6  # dots of ring 1 that are taken for the one on a blob
DOUBT = 2.0  # dots more that must lie on blobs at one turn for another to be excluded
NEAR_STEPS = 4  # of a fifth of the dots' spacing: 32 px at 480 rows


def candidates(
    blobs_px: Array, points: Array, rings: NDArray[np.intp], start: MountedCamera, azimuth_hint_deg: float
) -> Iterator[MountedCamera]:
    """Cameras to begin with: near the start at any azimuth, then any scale and place.

    In the second search some blob is taken for the tip or, where the tip is not painted, for a dot of the first ring.

    Args:
        blobs_px: (m, 2) found dots.
        points: (n, 3) of the pattern, ring by ring, mm.
        rings: (n,) their ring numbers.
        start: a camera with plausible distortion.
        azimuth_hint_deg: expected turn of the image.
    """
    scores = Scores(blobs_px, (start.camera.width_px, start.camera.height_px))
    inner, first = rings < SEARCH_RINGS, int((rings == 1).sum())
    ratio = neighbour_ratio(start, points)[inner]
    finest_deg = 360.0 / np.bincount(rings[inner])[1:].max()
    yield _near(scores, points[inner], ratio, start, azimuth_hint_deg, min(2.0, finest_deg / 4))
    for anchor in range(1 + min(first, MOST_ANCHORS)):
        score, mounted = _search_from(scores, points[inner], anchor, first, start, azimuth_hint_deg)
        if score >= 0.4 * inner.sum():
            yield mounted


def _near(
    scores: Scores, points: Array, ratio: Array, start: MountedCamera, azimuth_hint_deg: float, step_deg: float
) -> MountedCamera:
    """The start camera, turned about its axis and its picture shifted so that most of the dots lie on blobs.

    Of turns that put as many on blobs the one nearest to the hint; ``step_deg`` lies between those that are tried.
    """
    middle = np.array([start.camera.cx_px, start.camera.cy_px])
    pattern = start.project(points) - middle
    reach = np.arange(-NEAR_STEPS, NEAR_STEPS + 1) * scores.tolerance_px
    shifts = np.stack(np.meshgrid(reach, reach), -1).reshape(-1, 1, 2)
    steps = np.arange(-90, 90, step_deg)
    azimuths, best, tips = np.radians(azimuth_hint_deg + steps), np.zeros(len(steps)), np.zeros((len(steps), 2))
    for number, azimuth in enumerate(azimuths):
        turn = np.array([[np.cos(azimuth), -np.sin(azimuth)], [np.sin(azimuth), np.cos(azimuth)]])
        where = pattern @ turn.T + middle + shifts
        score = scores.of(where, ratio)
        best[number], tips[number] = score.max(), where[score.argmax(), 0]
    around = np.lib.stride_tricks.sliding_window_view(np.pad(best, 2, mode="wrap"), 5).max(axis=1)
    alike = np.flatnonzero((best == around) & (best >= best.max() - DOUBT))
    chosen = alike[np.abs(steps[alike]).argmin()]
    return _place(start, 1.0, azimuths[chosen], tips[chosen], points[0])


class Scores:
    """How well points lie on blobs: 1 at a blob's centre, falling to 0 at a tolerance, a fifth of the blobs' spacing.

    Looked up in a picture of the distance to the nearest blob, because a search asks for a million points.

    Args:
        blobs_px: (m, 2) found dots.
        size_px: (width, height) of the picture.
        tolerance_px: at which a point counts 0; None for a fifth of the spacing.
    """

    def __init__(self, blobs_px: Array, size_px: tuple[int, int], tolerance_px: float | None = None) -> None:
        self.blobs_px, self.spacing_px = blobs_px, spacing_px(blobs_px)
        self.tolerance_px = 0.2 * self.spacing_px if tolerance_px is None else tolerance_px
        width, height = size_px
        free = np.ones((height, width), np.uint8)
        column, row = np.rint(blobs_px).astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        free[row[inside], column[inside]] = 0
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        self._away = np.full((height + 1, width + 1), np.inf, np.float32)  # the last row and column stand for outside
        self._away[:-1, :-1] = (distance / self.tolerance_px) ** 2
        self._map = np.maximum(0, 1 - self._away)

    def of(self, where: Array, ratio: Array | None = None) -> Array:
        """Sum over the points of each candidate: (..., n, 2) to (...).

        Args:
            where: the points, px.
            ratio: (n,) by which the tolerance of each is larger; None for 1.
        """
        height, width = self._map.shape
        column, row = (np.rint(where[..., axis]) for axis in (0, 1))
        inside = (column >= 0) & (column < width - 1) & (row >= 0) & (row < height - 1)
        column, row = (
            np.where(inside, a, last).astype(np.intp) for a, last in ((column, width - 1), (row, height - 1))
        )
        if ratio is None or (ratio == 1).all():
            return np.asarray(self._map[row, column].sum(axis=-1))
        return np.asarray(np.maximum(0, 1 - self._away[row, column] / ratio**2).sum(axis=-1))


def _search_from(
    scores: Scores, points: Array, anchor: int, first: int, start: MountedCamera, azimuth_hint_deg: float
) -> tuple[float, MountedCamera]:
    """(score, camera) of the best candidate in which a pattern dot, the anchor, lies on a blob near the middle.

    Args:
        scores: of the blobs in the picture.
        points: (N, 3) dots of the pattern, mm, endcap frame, in the order of the pattern.
        anchor: number of the pattern dot: the tip, or one of ring 1.
        first: number of dots in ring 1.
        start: camera that the candidates are variations of.
        azimuth_hint_deg: middle of the azimuths tried, which reach 90 degrees to both sides.
    """
    blobs, spacing = scores.blobs_px, scores.spacing_px
    pattern = start.project(points)
    step = float(np.median(np.linalg.norm(pattern[1 : 1 + first] - pattern[0], axis=1)))
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
