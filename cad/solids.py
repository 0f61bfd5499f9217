"""The few kernel operations that every part is made of, with the traps of the kernel handled once.

Millimetres. Every function returns valid solids or raises :class:`cad.errors.GeometryError`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from build123d import Axis, Face, Plane, Rot, Shape, Solid

from cad.errors import GeometryError

SEAM_DEG = 5.0  # revolved surfaces begin here: on the meridian of dots their seam would run through the bumps


def revolved(profile: Face) -> Solid:
    """Turn a half section in the xz-plane (x >= 0) about the z axis."""
    return Rot(0, 0, SEAM_DEG) * Solid.revolve(profile, 360.0, Axis.Z)


def drill(place: tuple[float, float], radius_mm: float, bottom_mm: float, top_mm: float) -> Solid:
    """An upright cylinder.

    Args:
        place: (x, y) of the axis, mm. radius_mm: of the cylinder. bottom_mm, top_mm: z of its ends.
    """
    return Solid.make_cylinder(radius_mm, top_mm - bottom_mm, Plane(origin=(*place, bottom_mm)))


def cut_holes(body: Shape, tools: Iterable[Solid]) -> Shape:
    """Subtract many tools in one boolean operation."""
    tools = list(tools)
    return body.cut(*tools) if tools else body


def intersected(body: Shape, tool: Solid, name: str) -> Solid:
    """What two solids share, where that is one solid.

    Args:
        body, tool: the two. name: of the part, for the message.

    Raises:
        GeometryError: none or several solids, or the kernel gave up (it answers with no shape at all).
    """
    try:
        shared = body.intersect(tool)
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
