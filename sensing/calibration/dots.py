"""Dots of a photo for calibration: a small finder, and pairs with the dots of the pattern.

The finder works on one undeformed photo and is meant for calibration only (tracking has its own). Pixels as in
:mod:`sensing.camera.model`.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern, dot_position_mm
from cad.errors import EndcapError, FileError, ParameterError
from cad.params import EndcapParams
from cad.pattern import rings_text
from cad.plain_numbers import stored_number
from sensing.camera.dot_look import dot_look
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera

WHOLE_PX = 14.0  # a dot whose centre is this far from the picture's edge, at 480 rows, is seen whole
REFERENCE_HEIGHT_PX = 480  # blob sizes below are for a dot of 14 px at this image height
BLUR_PX = 1.0  # standard deviation of the smoothing before the search, at 480 rows
BACKGROUND_PX = 37  # odd window of the median that removes dots: over twice a dot, under the dot spacing
MOST_WINDOW_PX = 255  # of OpenCV's median, which counts pixels in 16 bits: beyond it is wrong, then it raises an error
MIN_CONTRAST = 0.22  # relative to the silicone around it; ink measures 0.35 to 0.8, stains and seams under 0.15
AREA_PX = (35.0, 520.0)  # of a blob at 480 rows that may be a dot
FEWEST_TO_FIT = 7  # dots: 14 coordinates for the 11 parameters of a camera
FEWEST, FEWEST_SHARE = 20, 0.75  # dots that a photo must show; of a design with fewer, the share of those seen
MOST_PX = 1e5  # of a place in a picture
ALONE = 1.5  # a dot whose nearest neighbour is this many times farther than usual may be missed by as much more


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


def find_dots(image_bgr: NDArray[np.uint8], params: EndcapParams | None = None) -> Array:
    """Centres (n, 2) of the dark blobs of an undeformed photo, weighted by contrast, in px.

    Args:
        image_bgr: (h, w, 3) photo. Blue and green are used: ink near the tip glints orange and is bright in red.
        params: the design, whose dots are looked for; None for dots that look like the released ones.
    """
    return find_blobs(image_bgr, params)[0]


def find_blobs(image_bgr: NDArray[np.uint8], params: EndcapParams | None = None) -> tuple[Array, Array]:
    """Centres (n, 2) as :func:`find_dots`, and radii (n,) of circles of the blobs' areas, in px."""
    scale = image_bgr.shape[0] / REFERENCE_HEIGHT_PX
    gray = image_bgr[..., :2].astype(np.float32).mean(-1)
    gray = cv2.GaussianBlur(gray, (0, 0), BLUR_PX * scale)
    size = scale * dot_look(params).scale
    window = round(BACKGROUND_PX * size / 2) * 2 + 1
    background = _median(np.clip(gray, 0, 255).astype(np.uint8), window).astype(np.float32)
    contrast = (background - gray) / np.maximum(background, 25)
    count, labels, stats, _ = cv2.connectedComponentsWithStats((contrast > MIN_CONTRAST).astype(np.uint8))
    area = stats[:, cv2.CC_STAT_AREA] / size**2
    weight = np.maximum(contrast, 0).ravel()
    rows, columns = np.indices(labels.shape)
    total = np.maximum(np.bincount(labels.ravel(), weight, count), 1e-9)  # a black picture has no weight
    centres = np.stack(
        [np.bincount(labels.ravel(), weight * axis.ravel(), count) / total for axis in (columns, rows)], -1
    )
    left, top, width, height = stats[:, :4].T
    whole = (left > 0) & (top > 0) & (left + width < labels.shape[1]) & (top + height < labels.shape[0])
    keep = (area > AREA_PX[0]) & (area < AREA_PX[1]) & whole  # a dot cut by the frame has its centre elsewhere
    return centres[keep], np.sqrt(area[keep] / np.pi) * size


def _median(gray: NDArray[np.uint8], window: int) -> NDArray[np.uint8]:
    """Median over a window of an odd side in px; over larger ones than OpenCV counts, that of a reduced picture."""
    if window <= MOST_WINDOW_PX:
        return cv2.medianBlur(gray, window).astype(np.uint8)
    factor = math.ceil(window / MOST_WINDOW_PX)
    height, width = gray.shape
    small = cv2.resize(gray, (width // factor, height // factor), interpolation=cv2.INTER_AREA)
    return cv2.resize(cv2.medianBlur(small, window // factor | 1), (width, height)).astype(np.uint8)


def read_dots(path: str | Path) -> Array:
    """Blob centres (n, 2) from a CSV with the columns u_px and v_px.

    Raises:
        FileError: missing file or columns, or text that is not a number (naming the line).
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as stream:
            table = csv.DictReader(stream)
            values = [(_pixel(row["u_px"]), _pixel(row["v_px"])) for row in table]
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror})") from error
    except (KeyError, ValueError, csv.Error) as error:
        raise FileError(
            f"{path}: line {table.line_num}: need numbers in the columns u_px and v_px ({error})"
        ) from error
    return np.array(values, dtype=float).reshape(-1, 2)


def _pixel(text: str | None) -> float:
    value = stored_number(text)
    if abs(value) > MOST_PX:
        raise ParameterError(f"{value:g} px is outside any picture")
    return value


def pattern_points(params: EndcapParams) -> tuple[Array, NDArray[np.intp]]:
    """Positions (n, 3) of the pattern's dots in the endcap frame (mm) and their ring numbers (n,)."""
    dots = dot_pattern(params)
    return np.array([dot_position_mm(params, dot) for dot in dots]), np.array([dot.ring for dot in dots])


def sees_whole(camera: MountedCamera, points: Array) -> NDArray[np.bool_]:
    """(n,) dots far enough from the picture's edge to be seen whole.

    Args:
        camera: the camera.
        points: (n, 3) of the pattern, endcap frame, mm.
    """
    return camera.sees(points, WHOLE_PX * camera.camera.height_px / REFERENCE_HEIGHT_PX)


def spacing_px(blobs_px: Array) -> float:
    """Median distance of a blob to its nearest neighbour: about one polar step."""
    distance = np.linalg.norm(blobs_px[:, None] - blobs_px[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    return float(np.median(distance.min(axis=1)))


def fewest_dots(camera: MountedCamera, points: Array) -> int:
    """How many dots a photo must show to calibrate by: 20, or three quarters of those that a camera sees if fewer.

    Args:
        camera: the nominal one.
        points: (n, 3) dots of the pattern, endcap frame, mm.
    """
    return min(FEWEST, max(FEWEST_TO_FIT, math.ceil(FEWEST_SHARE * int(camera.sees(points).sum()))))


def more_dots_words(camera: MountedCamera, params: EndcapParams, otherwise: str) -> str:
    """What to do where a photo shows too few dots.

    Args:
        camera: the nominal one.
        params: the design.
        otherwise: where the design has enough of them for this lens.
    """
    seen = int(camera.sees(pattern_points(params)[0]).sum())
    if seen >= FEWEST_TO_FIT:
        return otherwise
    return f"this lens sees {seen} of the design's dots ({rings_text(params.dot_rings)}): more rings, or more in each"


def neighbour_ratio(camera: MountedCamera, points: Array) -> Array:
    """(n,) distance of each dot to its nearest neighbour in the picture over the median; 1 where it is not alone.

    Args:
        camera: the camera.
        points: (n, 3) dots of the pattern, endcap frame, mm.
    """
    pixels, seen = camera.project(points), camera.sees(points)
    ratio = np.ones(len(points))
    if seen.sum() > 1:
        away = np.linalg.norm(pixels[seen, None] - pixels[None, seen], axis=-1)
        np.fill_diagonal(away, np.inf)
        nearest = away.min(axis=1)
        ratio[seen] = nearest / np.median(nearest)
    return np.where(ratio > ALONE, ratio, 1.0)


def possible_pairs(mounted: MountedCamera, points: Array, blobs_px: Array) -> int:
    """How many pairs there can be: blobs, or dots that the camera sees.

    Args:
        mounted: the camera.
        points: (n, 3) dots of the pattern, endcap frame, mm.
        blobs_px: (m, 2) blob centres.
    """
    return min(len(blobs_px), int(mounted.sees(points).sum()))


def mutual_nearest(
    blobs_px: Array, mounted: MountedCamera, points: Array, use: NDArray[np.bool_], tolerance_px: float | Array
) -> DotPairs:
    """Pairs that are each other's nearest, within a tolerance.

    Args:
        blobs_px: (m, 2) found dots.
        mounted: the camera.
        points: (n, 3) of the pattern, endcap frame, mm.
        use: (n,) the pattern's dots to consider.
        tolerance_px: largest distance of a pair, of all or (n,) of each.
    """
    predicted = mounted.project(points)
    candidates = np.flatnonzero(use & np.isfinite(predicted[:, 0]))
    if not len(candidates) or not len(blobs_px):
        return DotPairs(np.zeros(0, np.intp), np.zeros(0, np.intp))
    distance = np.linalg.norm(predicted[candidates, None] - blobs_px[None], axis=-1)  # (candidates, blobs)
    blob = distance.argmin(axis=1)
    own = np.arange(len(candidates))
    allowed = np.broadcast_to(tolerance_px, len(points))[candidates]
    near = (distance[own, blob] <= allowed) & (distance.argmin(axis=0)[blob] == own)
    return DotPairs(candidates[near], blob[near])
