"""Checks of every printed mesh, on the triangles read back from its STL: what the slicer will get."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import trimesh

from cad.part import Part
from fab.check import Check
from fab.mesh import to_manifold
from fab.self_intersections import self_intersections

if TYPE_CHECKING:
    from build123d import Solid

VOLUME_RATIO = 1e-3  # mesh against solid
STEP_VOLUME_RATIO = 1e-6  # solid against its STEP file
OVERLAP_MM3 = 1.0  # a hundredth of a printed dot: tessellation of touching faces, nothing a print could feel


def mesh_checks(part: Part, mesh: trimesh.Trimesh, solid_volume_mm3: float | None) -> list[Check]:
    """Watertight, manifold, one body, free of self-intersections, and of the right volume.

    Args:
        part: whose mesh it is.
        mesh: as read back from the STL file.
        solid_volume_mm3: volume to compare with; None where the mesh has more than the solid (gyroid).
    """
    closed = bool(mesh.is_watertight and mesh.is_winding_consistent)
    checks = [
        Check(f"{part.name}.watertight", float(closed), low=1),
        Check(f"{part.name}.bodies", float(len(to_manifold(mesh).decompose())) if closed else 0.0, 1, 1),
        Check(f"{part.name}.self_intersections", float(self_intersections(mesh)), high=0),
    ]
    if solid_volume_mm3 is not None:
        error = abs(mesh.volume / solid_volume_mm3 - 1)
        checks.append(Check(f"{part.name}.mesh_volume_error_ratio", error, high=VOLUME_RATIO))
    return checks


def step_check(name: str, solids: Sequence[Solid], path: Path) -> Check:
    """Volume of a STEP file, read back, against its solids; infinite where other or invalid solids were read."""
    from build123d import import_step

    read = import_step(path).solids()
    valid = len(read) == len(solids) and all(solid.is_valid for solid in read)
    wanted = sum(solid.volume for solid in solids)
    error = abs(sum(solid.volume for solid in read) / wanted - 1) if valid else float("inf")
    return Check(f"{name}.step_volume_error_ratio", error, high=STEP_VOLUME_RATIO)


def overlap_checks(parts: Mapping[str, trimesh.Trimesh], label: str) -> list[Check]:
    """Largest volume that any two parts of an assembly share, in mm3.

    Faces that touch are allowed: two tessellations of one contact surface may share slivers, which the limit bounds.
    """
    bodies = {name: to_manifold(mesh) for name, mesh in sorted(parts.items())}
    names = list(bodies)
    worst = 0.0
    for i, first in enumerate(names):
        for second in names[i + 1 :]:
            worst = max(worst, (bodies[first] ^ bodies[second]).volume())
    return [Check(f"{label}.overlap_mm3", worst, high=OVERLAP_MM3)]
