"""The few kernel operations that every part is made of, with the traps of the kernel handled once.

Millimetres. Every function returns valid solids or raises :class:`cad.errors.GeometryError`.

Notes:
    OCCT's booleans write into their arguments: edges get new tolerances and parameter curves. A core's body of
    D=103.27 from which pieces had been cut kept its volume but was meshed 2.9 % too small, at any tolerance. What is
    still needed after a boolean is therefore copied for it (1 ms).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from build123d import Axis, Face, Plane, Rot, Shape, Solid

import cad.serial_booleans  # noqa: F401 - before the first boolean
from cad.errors import GeometryError

SEAM_DEG = 5.0  # revolved surfaces begin here: on the meridian of dots their seam would run through the bumps


def revolved(profile: Face) -> Solid:
    """Turn a half section in the xz-plane (x >= 0) about the z axis."""
    return Rot(0, 0, SEAM_DEG) * Solid.revolve(profile, 360.0, Axis.Z)


def drill(place: tuple[float, float], radius_mm: float, bottom_mm: float, top_mm: float) -> Solid:
    """An upright cylinder.

    Args:
        place: (x, y) of the axis, mm.
        radius_mm: of the cylinder.
        bottom_mm, top_mm: z of its ends.
    """
    return Solid.make_cylinder(radius_mm, top_mm - bottom_mm, Plane(origin=(*place, bottom_mm)))


def copied(solid: Solid) -> Solid:
    """The same solid with nothing shared, for a boolean that may write into it."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

    return Solid(BRepBuilderAPI_Copy(solid.wrapped).Shape())


def cut_holes(body: Shape, tools: Iterable[Solid]) -> Shape:
    """Subtract many tools, which stay as they are, in one boolean operation; the body is used up."""
    tools = [copied(tool) for tool in tools]
    return body.cut(*tools) if tools else body


def intersected(body: Solid, tool: Solid, name: str) -> Solid:
    """What two solids share, where that is one solid; both stay as they are.

    Args:
        body, tool: the two.
        name: of the part, for the message.

    Raises:
        GeometryError: none or several solids, or the kernel gave up (it answers with no shape at all).
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
    """Take the only solid out of what a boolean returned.

    Raises:
        GeometryError: none or several solids, or an invalid one.
    """
    shapes = [shape] if isinstance(shape, Shape) else shape or []
    solids = [solid for item in shapes for solid in item.solids()]
    if len(solids) != 1 or not solids[0].is_valid:
        state = f"{len(solids)} solids" if len(solids) != 1 else "an invalid solid"
        raise GeometryError(f"{name}: the CAD kernel returned {state} where one was expected: report D and T")
    return solids[0]
