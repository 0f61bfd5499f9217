"""Finds the painted dots in the undeformed picture, once; which dots are painted is not known beforehand.

A dot is a dark, filled, roughly elliptic blob on bright silicone, all of about one size. Contrast is measured against
the blob's own surroundings (morphological closing), so lamp gradients and vignetting do not matter, and the dark
beyond the view is no blob. Specks are too small, written digits too thin, seams too long.

Units: pixels of the picture handed in; x to the right, y down.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from cad.params import EndcapParams
from sensing.camera.dot_look import dot_look
from sensing.records import Image
from sensing.tracking.nearest import nearest_other

DIAMETER_SHARE = 0.037  # E: a dot's diameter over the picture's short side (18 of 480 px on the released photos)
CONTRAST = 0.13  # E: least darkness against the surroundings; the palest painted dots of the photos have 0.2
DARK_GRAY = 12.0  # gray levels added to the surroundings: no contrast out of sensor noise in the dark
CROWDED = 0.55  # E: closer than this share of the usual spacing is a piece of a digit or a smear beside a dot,
PITCH = 0.75  # E: unless the design has dots that close: the share of its least pitch that two of them keep
LEAST_FILL = 0.72  # E: share of the moment ellipse that a dot fills; digits and strokes fill half or less


class NoDotsError(EndcapError):
    """A reference picture without dots."""


@dataclass(frozen=True)
class Dots:
    """Dots of the undeformed picture.

    Attributes:
        position_px: (N, 2) centres x, y.
        diameter_px: (N,) of the circle of the same area (for a dot cut by the frame, of its visible part).
        cut: (N,) bool, True where the frame's edge cuts the dot.
    """

    position_px: NDArray[np.float64]
    diameter_px: NDArray[np.float64]
    cut: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.position_px)

    def only(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Dots:
        """Some of the dots: a mask, or their numbers."""
        return Dots(self.position_px[which], self.diameter_px[which], self.cut[which])


def find_dots(gray: Image, least: int = 1, source: str = "reference", params: EndcapParams | None = None) -> Dots:
    """All dots of a gray picture (H, W), sorted by row then column of their centres.

    Args:
        gray: uint8 picture; at least 120 px on its short side (dots of 5 px).
        least: how many dots there must be.
        source: named in the error.
        params: the design, whose dots are looked for; None for dots that look like the released ones.

    Raises:
        NoDotsError: fewer than ``least`` dots.
    """
    look, short = dot_look(params), min(gray.shape)
    expected = DIAMETER_SHARE * short * look.scale
    contrast, background = _contrast(gray, expected)
    blobs = _blobs(contrast, expected)
    if len(blobs):
        column, row = np.rint(blobs[:, :2]).astype(int).T
        lit = background[row, column] > np.where(blobs[:, 3] > 0, 0.5, 0.25) * np.percentile(background, 90)
        blobs = blobs[lit]
    if len(blobs):
        usual = np.median(blobs[~blobs[:, 3].astype(bool), 2]) if (blobs[:, 3] == 0).any() else expected
        limit = np.where(blobs[:, 3] > 0, 0.4, 0.6) * usual
        blobs = _apart(
            blobs[(blobs[:, 2] > limit) & (blobs[:, 2] < 1.8 * usual)], float(usual), PITCH * look.least_pitch * short
        )
    if len(blobs) < least:
        raise NoDotsError(
            f"{source}: {len(blobs)} dots found, at least {least} needed: is the lamp on, the picture sharp, "
            f"and the inner surface painted?"
        )
    blobs = blobs[np.lexsort((blobs[:, 0], np.rint(blobs[:, 1])))] if len(blobs) else blobs.reshape(0, 4)
    return Dots(blobs[:, :2], blobs[:, 2], blobs[:, 3].astype(bool))


def _contrast(gray: Image, expected: float) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """(darkness of every pixel against the silicone around it, 0..1; gray level of that silicone)."""
    reach = max(3, int(expected * 1.6))
    pad = 2 * reach
    framed = cv2.copyMakeBorder(gray, pad, pad, pad, pad, cv2.BORDER_REPLICATE)
    blurred: Image = cv2.GaussianBlur(framed, (0, 0), max(0.6, expected / 12))
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    background: Image = cv2.morphologyEx(blurred, cv2.MORPH_CLOSE, kernel).astype(np.float32)  # of bytes: quicker
    smooth = blurred.astype(np.float32)
    contrast = (background - smooth) / (background + DARK_GRAY)
    return contrast[pad:-pad, pad:-pad], background[pad:-pad, pad:-pad]


def _blobs(contrast: NDArray[np.floating], expected: float) -> NDArray[np.float64]:
    """(N, 4) x, y, diameter, cut of the filled blobs of about the expected size."""
    mask: Image = (contrast > CONTRAST).astype(np.uint8)
    opening = max(2, round(expected * 0.3))
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3)))
    mask = _filled(mask, expected)
    padded = cv2.copyMakeBorder(mask, opening, opening, opening, opening, cv2.BORDER_REPLICATE)
    mask = np.ascontiguousarray(_opened(padded, opening)[opening:-opening, opening:-opening])
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask)
    found = []
    for index in range(1, count):
        x, y, w, h, area = stats[index]
        diameter = float(np.sqrt(4 * area / np.pi))
        if not 0.35 * expected < diameter < 2.5 * expected:
            continue
        patch = label[y : y + h, x : x + w] == index
        cut = x == 0 or y == 0 or x + w == mask.shape[1] or y + h == mask.shape[0]
        if cut or _is_dot(patch):
            weight = np.where(patch, np.maximum(contrast[y : y + h, x : x + w], 0), 0)  # a glint counts nothing
            rows, columns = np.mgrid[0:h, 0:w]
            total = weight.sum()
            found.append((x + (weight * columns).sum() / total, y + (weight * rows).sum() / total, diameter, cut))
    return np.array(found, float).reshape(-1, 4)


def _opened(mask: Image, size_px: int) -> Image:
    """Morphological opening by an ellipse. OpenCV's own shifts the mask by a pixel where the size is even."""
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size_px, size_px))
    back = size_px - 1 - size_px // 2  # the middle of the kernel turned by half a turn
    return cv2.dilate(cv2.erode(mask, kernel), cv2.flip(kernel, -1), anchor=(back, back)).astype(np.uint8)


def _filled(mask: Image, expected: float) -> Image:
    """The mask without holes smaller than a dot: ink that mirrors the lamp shows as a dark ring."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(1 - mask, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < np.pi / 4 * expected**2
    return np.where(small[label], 1, mask).astype(np.uint8)


def _apart(blobs: NDArray[np.float64], usual: float, kept_px: float) -> NDArray[np.float64]:
    """Blobs without those that crowd another: of two too close, the one whose size is less usual is no dot.

    Args:
        blobs: (N, 4) x, y, diameter, cut.
        usual: diameter, px.
        kept_px: dots of the design may lie as close as this.
    """
    while len(blobs) > 3:
        nearest, other = nearest_other(blobs[:, :2])
        close = np.flatnonzero(nearest < min(CROWDED * float(np.median(nearest)), kept_px))
        if len(close) == 0:
            break
        pair = np.unique(np.concatenate([close, other[close]]))
        odd = np.abs(np.log(blobs[pair, 2] / usual)) + blobs[pair, 3]
        blobs = np.delete(blobs, pair[int(odd.argmax())], axis=0)
    return blobs


def _is_dot(patch: NDArray[np.bool_]) -> bool:
    """Filled and not too long: compares the area with that of the ellipse of the same second moments."""
    rows, columns = np.nonzero(patch)
    spread = np.cov(np.stack([columns, rows])) + np.eye(2) / 12  # a pixel has a moment of its own
    small, large = np.linalg.eigvalsh(spread)
    fill = len(rows) / (4 * np.pi * np.sqrt(small * large))
    return bool(fill > LEAST_FILL and large < 12 * small)
