"""Kernel operations from which all parts are made, with workarounds for faults of the kernel.

Millimetres. Every function returns valid solids or raises :class:`cad.errors.GeometryError`.

Notes:
    OCCT's booleans modify their arguments: edges get new tolerances and parameter curves. The core's body of D=103.27,
    from which pieces had been cut, kept its volume, but its mesh was 2.9 % too small at any tolerance. A solid that is
    used after a boolean is therefore copied for it (1 ms).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from build123d import Axis, Face, Plane, Rot, Shape, Solid

import cad.serial_booleans  # noqa: F401 - before the first boolean
from cad.errors import GeometryError

SEAM_DEG = 5.0  # azimuth at which revolved surfaces begin: on the dots' meridian their seam would cross bumps


def revolved(profile: Face) -> Solid:
    """Revolve a half section in the xz-plane (x >= 0) about the z axis."""
    return Rot(0, 0, SEAM_DEG) * Solid.revolve(profile, 360.0, Axis.Z)


def drill(place: tuple[float, float], radius_mm: float, bottom_mm: float, top_mm: float) -> Solid:
    """Cylinder along z.

    Args:
        place: (x, y) of the axis, mm.
        radius_mm: radius of the cylinder, mm.
        bottom_mm: z of its lower end, mm.
        top_mm: z of its upper end, mm.
    """
    return Solid.make_cylinder(radius_mm, top_mm - bottom_mm, Plane(origin=(*place, bottom_mm)))


def copied(solid: Solid) -> Solid:
    """Deep copy of a solid, for a boolean that may modify it."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

    return Solid(BRepBuilderAPI_Copy(solid.wrapped).Shape())


def cut_holes(body: Shape, tools: Iterable[Solid]) -> Shape:
    """Subtract many tools in one boolean operation; the tools are not changed, the body may be."""
    tools = [copied(tool) for tool in tools]
    return body.cut(*tools) if tools else body


def intersected(body: Solid, tool: Solid, name: str) -> Solid:
    """Intersection of two solids, which must be one solid; neither argument is changed.

    Args:
        body: one solid.
        tool: the other one.
        name: name of the part, for the message.

    Raises:
        GeometryError: the result is no solid or several, or the kernel failed and returned no shape.
    """
    try:
        shared = copied(body).intersect(copied(tool))
    except ValueError as error:
        raise GeometryError(f"{name}: the CAD kernel cannot intersect two solids ({error}): report D and T") from error
    return one_solid(shared, name)


def fused(body: Solid, others: Iterable[Solid]) -> Solid:
    """Add many solids in one boolean operation."""
    return one_solid(body.fuse(*others), "fuse")


def one_solid(shape: Shape | Sequence[Shape] | None, name: str) -> Solid:
    """The only solid in the result of a boolean.

    Raises:
        GeometryError: there is no solid, more than one, or an invalid one.
    """
    shapes = [shape] if isinstance(shape, Shape) else shape or []
    solids = [solid for item in shapes for solid in item.solids()]
    if len(solids) != 1 or not solids[0].is_valid:
        state = f"{len(solids)} solids" if len(solids) != 1 else "an invalid solid"
        raise GeometryError(f"{name}: the CAD kernel returned {state} where one was expected: report D and T")
    return solids[0]
