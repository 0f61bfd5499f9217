"""Plane faces: outlines of prisms (x, y) and half sections of revolved bodies (radius, height). Millimetres.

Boolean operations on plane faces are quicker and safer than the same operations on the solids made from them.
"""

from __future__ import annotations

from build123d import Face, Plane, Rot, Vector, Wire

import cad.serial_booleans  # noqa: F401 - before the first boolean
from cad.errors import GeometryError


def polygon(points: list[tuple[float, float]]) -> Face:
    """A face from its corners."""
    return Face(Wire.make_polygon([Vector(x, y, 0) for x, y in points], close=True))


def rectangle(left: float, right: float, low: float, high: float) -> Face:
    """An upright rectangle.

    Args:
        left, right: smallest and largest x (in a half section: radius), mm.
        low, high: smallest and largest y (in a half section: height), mm.
    """
    return polygon([(left, low), (right, low), (right, high), (left, high)])


def disc(centre: tuple[float, float], radius_mm: float) -> Face:
    """A round face."""
    return Face(Wire.make_circle(radius_mm, Plane(origin=(*centre, 0))))


def common(first: Face, second: Face) -> Face:
    """What two faces share, where that is one face."""
    shared = first.intersect(second)
    if not shared:
        raise GeometryError("two outlines of the mold do not meet: report D and T")
    return shared.faces()[0]


def upright(section: Face) -> Face:
    """Turn a half section drawn as (radius, height) into the xz-plane, ready to be revolved about z."""
    return Rot(90, 0, 0) * section
