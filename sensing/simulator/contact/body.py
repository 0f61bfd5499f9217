"""What a rigid body is to the contact kernels: a kind, a radius, a point and an axis (mm, at its first touch)."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from sensing.simulator.solid.element import Array


class BodyKind(IntEnum):
    """Signed distances that :mod:`sensing.simulator.contact.kernels` knows."""

    PLANE = 0
    SPHERE = 1
    EDGE = 2


class Body(NamedTuple):
    """A body as compiled loops take it.

    Attributes:
        kind: a :class:`BodyKind`, as a plain integer.
        radius_mm: radius of sphere or edge; not used for the plane.
        point_mm: point on the plane, centre of the sphere, or point on the edge's axis (3,).
        axis: unit normal of the plane away from the shell's outside, or unit direction of the edge's axis (3,).
    """

    kind: int
    radius_mm: float
    point_mm: Array
    axis: Array
