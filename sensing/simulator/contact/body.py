"""Rigid bodies as the contact kernels take them: kind, radius, point and axis (mm, at first touch)."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from sensing.simulator.solid.element import Array

Distance = Callable[..., float]
Triple = tuple[float, float, float]


class BodyKind(IntEnum):
    """Signed distances that :mod:`sensing.simulator.contact.kernels` has."""

    PLANE = 0
    SPHERE = 1
    EDGE = 2
    ROUGH = 3


PLUGIN = 100  # kinds from here on are plug-ins', in the order in which they were first used
_DISTANCES: list[Distance] = []  # signed distances of plug-ins; the index is the kind minus PLUGIN


def plugin_kind(distance: Distance) -> int:
    """The number of a plug-in's signed distance."""
    if distance not in _DISTANCES:
        _DISTANCES.append(distance)
    return PLUGIN + _DISTANCES.index(distance)


def plugin_distance(kind: int) -> Distance | None:
    """The signed distance of a body's kind; None for a :class:`BodyKind`."""
    return _DISTANCES[kind - PLUGIN] if kind >= PLUGIN else None


class Body(NamedTuple):
    """A body as compiled loops take it: plain numbers, which the compiler keeps in registers (half the time of arrays).

    Attributes:
        kind: a :class:`BodyKind` or a plug-in's number, as a plain integer.
        radius_mm: radius of sphere or edge, or of the crests of rough ground; not used for the plane.
        point_mm: point on the plane, centre of the sphere, point on the edge's axis, or the crest that touches first.
        axis: unit normal of plane or rough ground away from the shell's outside, or direction of the edge's axis.
        along: unit vector in the tangent plane along which the crests of rough ground stand in rows.
    """

    kind: int
    radius_mm: float
    point_mm: Triple
    axis: Triple
    along: Triple


def body_at(kind: int, radius_mm: float, point_mm: Array, axis: Array, along: Array) -> Body:
    """A body from arrays.

    Args:
        kind, radius_mm: fields of :class:`Body`.
        point_mm: (3,) point of the body, mm, as in :class:`Body`.
        axis: (3,) axis of the body, of length 1.
        along: (3,) direction of the rows of crests, of length 1.
    """
    (x, y, z), (u, v, w), (a, b, c) = point_mm.tolist(), axis.tolist(), along.tolist()
    return Body(int(kind), float(radius_mm), (x, y, z), (u, v, w), (a, b, c))
