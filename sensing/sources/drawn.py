"""A plain drawing of the dots, for tests, benches and a first try without camera or simulator.

It knows the dot pattern and an equidistant fisheye, nothing of mechanics: the simulator is the place for that.
Frame: image x to the right, y down; the dome's tip at ``centre_px``. Units: pixels of the drawing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.dots import Dot, dot_pattern, dot_position_mm
from cad.params import EndcapParams
from sensing.records import Image

RIM_RADIUS_PX = 331.0  # M, CAM04: the shell as a disc at 640 x 480; the 180 degree edge of the view
SUPERSAMPLE = 4


@dataclass(frozen=True)
class Drawing:
    """How to draw.

    Attributes:
        size: (width, height).
        centre_px: x, y of the axis.
        turn_rad: rotation of the pattern in the image.
        painted: share of the dots that got ink, picked by ``seed``.
        specks: small dark spots that are no dots.
        digit: a hand-written number near the centre; empty for none.
        seed: seed of everything random.
    """

    size: tuple[int, int] = (640, 480)
    centre_px: tuple[float, float] = (323.0, 236.0)
    turn_rad: float = 0.3
    painted: float = 1.0
    specks: int = 30
    digit: str = "4"
    seed: int = 0


def draw_dots(drawing: Drawing, params: EndcapParams | None = None) -> tuple[Image, NDArray[np.float64]]:
    """((H, W, 3) BGR picture, (N, 2) centres in px of the painted dots that lie inside the frame)."""
    params = params or EndcapParams(diameter_mm=130.0, wall_mm=8.0)
    rng = np.random.default_rng(drawing.seed)
    canvas = _bare_silicone(drawing, rng)
    ink = _fine_mask(drawing)
    centres = []
    for dot in dot_pattern(params):
        if rng.random() >= drawing.painted:
            continue
        outline = _dot_outline_px(dot, params, drawing)
        cv2.fillPoly(ink, [np.rint((outline + 0.5) * SUPERSAMPLE - 0.5).astype(np.int32)], 255)
        centres.append(outline.mean(axis=0))
    alpha = cv2.GaussianBlur(_shrink(ink), (0, 0), 0.8).astype(np.float32)[:, :, None] / 255
    colour = np.array((50.0, 55.0, 70.0)) + rng.normal(0, 6, canvas.shape)
    canvas = canvas * (1 - alpha) + colour * alpha
    image = np.clip(cv2.GaussianBlur(canvas, (0, 0), 0.7) + rng.normal(0, 1.0, canvas.shape), 0, 255)
    found = np.array(centres).reshape(-1, 2)
    inside = ((found >= 0) & (found <= np.array(drawing.size) - 1)).all(axis=1)
    return image.astype(np.uint8), found[inside]


def project_px(point_mm: NDArray[np.floating], params: EndcapParams, drawing: Drawing) -> NDArray[np.float64]:
    """(..., 2) pixels of points: r = f * angle from the axis, 90 degrees at the rim.

    Args:
        point_mm: (..., 3), endcap frame.
        params: the design.
        drawing: size, centre and turn of the picture.
    """
    point_mm = np.asarray(point_mm, float)
    lateral = np.hypot(point_mm[..., 0], point_mm[..., 1])
    angle = np.arctan2(lateral, point_mm[..., 2] - params.camera_height_mm)
    scale = RIM_RADIUS_PX * min(drawing.size) / 480.0
    radius = angle / (math.pi / 2) * scale
    azimuth = np.arctan2(point_mm[..., 1], point_mm[..., 0]) + drawing.turn_rad
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth)], axis=-1) + drawing.centre_px


def _dot_outline_px(dot: Dot, params: EndcapParams, drawing: Drawing) -> NDArray[np.float64]:
    """(24, 2) outline of a dot: a small circle on the inner sphere, projected."""
    centre = np.array(dot_position_mm(params, dot))
    normal = np.array(dot.direction)
    east = np.array([-math.sin(math.radians(dot.azimuth_deg)), math.cos(math.radians(dot.azimuth_deg)), 0.0])
    north = np.cross(normal, east)
    turn = np.linspace(0, 2 * math.pi, 24, endpoint=False)[:, None]
    return project_px(centre + params.dot_radius_mm * (np.cos(turn) * east + np.sin(turn) * north), params, drawing)


def _bare_silicone(drawing: Drawing, rng: np.random.Generator) -> NDArray[np.float64]:
    """Teal silicone lit from the rim, dark beyond the view, with specks, seams and a written digit."""
    width, height = drawing.size
    y, x = np.mgrid[0:height, 0:width].astype(float)
    scale = min(drawing.size) / 480.0
    radius = np.hypot(x - drawing.centre_px[0], y - drawing.centre_px[1]) / (RIM_RADIUS_PX * scale)
    light = (0.95 - 0.25 * radius**2) / (1 + np.exp((radius - 1.0) * 60))
    mottle = cv2.GaussianBlur(rng.normal(0, 1, (height, width)), (0, 0), 6 * scale)
    light = light * (1 + 0.02 * mottle / mottle.std())
    canvas = light[:, :, None] * np.array((190.0, 205.0, 150.0)) + 8
    spots = _fine_mask(drawing)
    for _ in range(drawing.specks):
        place = rng.uniform((0, 0), drawing.size)
        cv2.circle(spots, _subpixel(place), int(SUPERSAMPLE * scale * rng.uniform(0.5, 1.8)), 255, -1)
    if drawing.digit:
        corner = np.array(drawing.centre_px) + np.array((30.0, -35.0)) * scale
        cv2.putText(spots, drawing.digit, _subpixel(corner), 0, 0.6 * scale * SUPERSAMPLE, 255, 2 * SUPERSAMPLE)
    for turn in rng.uniform(0, 2 * math.pi, 3):
        start = np.array(drawing.centre_px) + 60 * scale * np.array((math.cos(turn), math.sin(turn)))
        end = np.array(drawing.centre_px) + 320 * scale * np.array((math.cos(turn + 0.2), math.sin(turn + 0.2)))
        cv2.line(spots, _subpixel(start), _subpixel(end), 40, SUPERSAMPLE)
    return canvas * (1 - 0.7 * _shrink(spots).astype(float)[:, :, None] / 255)


def _fine_mask(drawing: Drawing) -> Image:
    return np.zeros((drawing.size[1] * SUPERSAMPLE, drawing.size[0] * SUPERSAMPLE), np.uint8)


def _subpixel(place: NDArray[np.floating]) -> tuple[int, int]:
    return int(place[0] * SUPERSAMPLE), int(place[1] * SUPERSAMPLE)


def _shrink(mask: Image) -> Image:
    size = (mask.shape[1] // SUPERSAMPLE, mask.shape[0] // SUPERSAMPLE)
    return cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
