"""Expected picture of a design: its dots, the edge of the picture, and whether the dots suffice for a calibration.

The lens is that of the camera module (:mod:`cad.lens`), on the axis at the design's pupil height, in the whole
sensor's frame of 640 x 480. The sensing side has a camera model of its own, which fab must not import; a test compares
the two for many designs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from cad.dots import Dot, dot_pattern, dot_position_mm
from cad.lens import camera_module
from cad.params import EndcapParams
from cad.pattern import rings_text

Point = tuple[float, float]
DISC_DEG = 86.4  # off the axis: the released lens has the 331 px there at which photos show the shell end (M, CAM04)
OUTLINE_POINTS = 32  # of a dot in the picture
FRAME_PX = (640.0, 480.0)
SQUARE_PX = 480.0  # P, NET01: centre square of the released pipeline
FEWEST = 7  # centres that a calibration by one photo needs at the least (sensing.calibration.dots.FEWEST_TO_FIT)


def camera_pixels(params: EndcapParams) -> dict[Dot, tuple[float, float]]:
    """Expected positions of the dots that the lens sees (x right, y down, frame of 640 x 480), px.

    Args:
        params: the design.
    """
    places = {dot: dot_position_mm(params, dot) for dot in dot_pattern(params)}
    return {dot: pixel for dot, place in places.items() if (pixel := _pixel(params, place)) is not None}


def dot_outline_px(params: EndcapParams, dot: Dot) -> list[Point]:
    """Points of the edge of a dot in the picture, those alone that the lens sees, px.

    Args:
        params: the design.
        dot: of its pattern.
    """
    polar, azimuth = math.radians(dot.polar_deg), math.radians(dot.azimuth_deg)
    radius = params.inner_radius_mm
    wide = math.asin(params.dot_radius_mm / radius)
    points = []
    for turn in (2 * math.pi * k / OUTLINE_POINTS for k in range(OUTLINE_POINTS)):
        along, across = math.sin(wide) * math.cos(turn), math.sin(wide) * math.sin(turn)
        outward = math.cos(wide) * math.sin(polar) + along * math.cos(polar)
        x = outward * math.cos(azimuth) - across * math.sin(azimuth)
        y = outward * math.sin(azimuth) + across * math.cos(azimuth)
        z = math.cos(wide) * math.cos(polar) - along * math.sin(polar)
        points.append(_pixel(params, (radius * x, radius * y, params.centre_height_mm + radius * z)))
    return [point for point in points if point is not None]


def seen_dots(params: EndcapParams) -> int:
    """Number of dots whose centres lie in the picture: between the middles of its outermost pixels.

    Args:
        params: the design.

    Raises:
        ParameterError, FileError: see :func:`cad.lens.camera_module`.
    """
    return dots_in(camera_pixels(params).values(), FRAME_PX[0] - 1, FRAME_PX[1] - 1)


def few_dots_words(params: EndcapParams) -> str | None:
    """Warning for a design whose camera cannot be calibrated; ``None`` where it can.

    Args:
        params: the design.
    """
    seen = seen_dots(params)
    if seen >= FEWEST:
        return None
    return (
        f"dots={rings_text(params.dot_rings)}: the picture shows {seen} dots, and a camera is calibrated by {FEWEST} "
        "or more: take more rings, or more dots in each"
    )


def dots_in(pixels: Iterable[tuple[float, float]], width: float, height: float) -> int:
    """Number of points in a centred rectangle of the frame.

    Args:
        pixels: (x, y) in the frame, px.
        width: of the rectangle, px.
        height: of the rectangle, px.
    """
    return sum(abs(x - FRAME_PX[0] / 2) <= width / 2 and abs(y - FRAME_PX[1] / 2) <= height / 2 for x, y in pixels)


def lens_px(off_axis: float) -> float:
    """Distance from the frame's centre, px: Kannala and Brandt 2006, doi:10.1109/TPAMI.2006.153, radial terms.

    Args:
        off_axis: angle from the optical axis, rad; no more than the module's ``max_half_angle_deg``.
    """
    module = camera_module()
    radial = 1.0 + sum(k * off_axis ** (2 * power) for power, k in enumerate(module.k, start=1))
    return module.focal_per_row * FRAME_PX[1] * off_axis * radial


def disc_px() -> float:
    """Radius at which the picture of the shell ends: with the shell, or before it with the circle of the lens."""
    return lens_px(math.radians(min(DISC_DEG, camera_module().circle_deg)))


def edge_px() -> tuple[float, float]:
    """Least and largest radius at which the bright disc ends: with the shell, or with the circle of the lens."""
    return disc_px(), lens_px(math.radians(camera_module().circle_deg))


def edge_cuts_px(radius: float) -> tuple[float | None, float | None]:
    """Distances from a corner at which a circle cuts the upper and lower, and the left and right edge of the frame.

    Args:
        radius: of the circle about the frame's centre, px.

    Returns:
        Two distances, px; None where the circle does not cut that edge.
    """
    half_width, half_height = FRAME_PX[0] / 2, FRAME_PX[1] / 2

    def from_corner(along: float, across: float) -> float | None:
        return along - math.sqrt(radius**2 - across**2) if across < radius < math.hypot(along, across) else None

    return from_corner(half_width, half_height), from_corner(half_height, half_width)


def _pixel(params: EndcapParams, place_mm: tuple[float, float, float]) -> Point | None:
    """Pixel of a point in the endcap frame; None where the lens does not see it."""
    x, y, z = place_mm
    off_axis = math.atan2(math.hypot(x, y), z - params.camera_height_mm)
    if math.degrees(off_axis) > camera_module().max_half_angle_deg:
        return None
    reach, azimuth = lens_px(off_axis), math.atan2(y, x)
    return FRAME_PX[0] / 2 + reach * math.cos(azimuth), FRAME_PX[1] / 2 + reach * math.sin(azimuth)
