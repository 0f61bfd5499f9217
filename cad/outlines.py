"""Plane faces for outlines of prisms (x, y) and half sections of bodies of revolution (radius, height). Millimetres.

Boolean operations on plane faces are faster and more reliable than the same operations on the solids made from them.
"""

from __future__ import annotations

from build123d import Face, Plane, Rot, Vector, Wire

import cad.serial_booleans  # noqa: F401 - before the first boolean
from cad.errors import GeometryError


def polygon(points: list[tuple[float, float]]) -> Face:
    """Polygonal face from its corners (x, y), mm."""
    return Face(Wire.make_polygon([Vector(x, y, 0) for x, y in points], close=True))


def rectangle(left: float, right: float, low: float, high: float) -> Face:
    """Rectangle with sides along the axes.

    Args:
        left: smallest x (in a half section: radius), mm.
        right: largest x, mm.
        low: smallest y (in a half section: height), mm.
        high: largest y, mm.
    """
    return polygon([(left, low), (right, low), (right, high), (left, high)])


def disc(centre: tuple[float, float], radius_mm: float) -> Face:
    """Circular face."""
    return Face(Wire.make_circle(radius_mm, Plane(origin=(*centre, 0))))


def common(first: Face, second: Face) -> Face:
    """Intersection of two faces, which must be one face; raises GeometryError where they do not meet."""
    shared = first.intersect(second)
    if not shared:
        raise GeometryError("two outlines of the mold do not meet: report D and T")
    return shared.faces()[0]


def upright(section: Face) -> Face:
    """Rotate a half section drawn as (radius, height) into the xz-plane, for a revolution about z."""
    return Rot(90, 0, 0) * section
