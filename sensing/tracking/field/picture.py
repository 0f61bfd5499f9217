"""Draws a field over its picture: image, dots coloured by quality, arrows, cells without support shaded."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from sensing.records import DotTracks, Image, ShearField
from sensing.tracking.gelslim import CROP_PX

WIDTH_PX = 1280  # pictures are enlarged to about this width
ARROWS = 18  # across the field; the paper's figure shows 18 x 18
GREEN, RED, BLUE, WHITE = (80, 200, 60), (60, 60, 230), (230, 120, 40), (255, 255, 255)


def draw_field(image: Image, field: ShearField, tracks: DotTracks | None = None, gain: float | None = None) -> Image:
    """(H', W', 3) BGR picture.

    Args:
        image: the frame, (H, W, 3) BGR.
        field: its field, with channels u and v.
        tracks: dots to draw: green to red by falling quality, blue cross where lost.
        gain: arrow length over true length; if not given, such that the longest arrow spans about one cell and a half.
    """
    scale = WIDTH_PX / image.shape[1]
    canvas = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    canvas = (canvas * 0.75).astype(np.uint8)
    side = min(image.shape[:2]) * scale
    corner = ((canvas.shape[1] - side) / 2, (canvas.shape[0] - side) / 2)
    _shade_invalid(canvas, field, corner, side)
    if tracks is not None:
        _draw_tracks(canvas, tracks, scale)
    if "u" in field.names and "v" in field.names:
        used = _draw_arrows(canvas, field, corner, side, gain)
        good = "" if tracks is None else f", {int((~tracks.lost).sum())}/{len(tracks.ids)} dots"
        text = f"arrows x{used:.3g}, largest {_length(field).max():.2f} px of {CROP_PX}{good}"
        cv2.rectangle(canvas, (0, canvas.shape[0] - 38), (12 + 13 * len(text), canvas.shape[0]), (40, 40, 40), -1)
        cv2.putText(canvas, text, (12, canvas.shape[0] - 14), cv2.FONT_HERSHEY_SIMPLEX, 0.7, WHITE, 1, cv2.LINE_AA)
    return canvas


def _length(field: ShearField) -> NDArray[np.float32]:
    return np.where(field.valid, np.hypot(field.channel("u"), field.channel("v")), 0.0)


def _shade_invalid(canvas: Image, field: ShearField, corner: tuple[float, float], side: float) -> None:
    mask = cv2.resize(field.valid.astype(np.uint8), (int(side), int(side)), interpolation=cv2.INTER_NEAREST)
    x, y = int(corner[0]), int(corner[1])
    area = canvas[y : y + int(side), x : x + int(side)]
    area[mask == 0] = area[mask == 0] // 2 + np.array((40, 0, 40), np.uint8)
    cv2.rectangle(canvas, (x, y), (x + int(side) - 1, y + int(side) - 1), WHITE, 1)


def _draw_tracks(canvas: Image, tracks: DotTracks, scale: float) -> None:
    for place, quality, lost in zip(tracks.position_px, tracks.quality, tracks.lost, strict=True):
        x, y = (round((c + 0.5) * scale) for c in place)
        if lost:
            cv2.drawMarker(canvas, (x, y), BLUE, cv2.MARKER_TILTED_CROSS, 14, 2, cv2.LINE_AA)
            continue
        share = float(np.clip((quality - 0.5) / 0.5, 0, 1))
        colour = tuple(share * g + (1 - share) * r for g, r in zip(GREEN, RED, strict=True))
        cv2.circle(canvas, (x, y), int(8 * scale), colour, 2, cv2.LINE_AA)


def _draw_arrows(
    canvas: Image, field: ShearField, corner: tuple[float, float], side: float, gain: float | None
) -> float:
    u, v = field.channel("u"), field.channel("v")
    height, width = u.shape
    step = -(-max(height, width) // ARROWS)
    rows, columns = range(step // 2, height, step), range(step // 2, width, step)
    per_px = side / CROP_PX
    if gain is None:
        gain = float(np.clip(1.5 * CROP_PX / ARROWS / max(float(_length(field).max()), 1e-6), 1, 20))
    for row in rows:
        for column in columns:
            if not field.valid[row, column]:
                continue
            x = corner[0] + (column + 0.5) * side / width
            y = corner[1] + (row + 0.5) * side / height
            tip = (round(x + u[row, column] * per_px * gain), round(y + v[row, column] * per_px * gain))
            cv2.arrowedLine(canvas, (round(x), round(y)), tip, (0, 220, 255), 2, cv2.LINE_AA, tipLength=0.25)
    return gain
