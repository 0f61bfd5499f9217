"""Checks of every printed mesh, on the triangles read back from its STL: what the slicer will get."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import manifold3d
import trimesh

from fab.checks.check import Check
from fab.meshing.mesh import to_manifold
from fab.meshing.self_intersections import self_intersections

VOLUME_RATIO = 1e-3  # mesh against solid
STEP_VOLUME_RATIO = 1e-5  # solid against its STEP file: OCCT's own integrals repeat to 5e-6 after a round trip
HEAVY_TRIANGLES = 100_000
OVERLAP_MM3 = 1.0  # a hundredth of a printed dot: tessellation of touching faces, nothing a print could feel


def mesh_checks(name: str, mesh: trimesh.Trimesh, solid_volume_mm3: float | None) -> list[Check]:
    """Watertight, manifold, one body, free of self-intersections, and of the right volume.

    Args:
        name: the part's name.
        mesh: as read back from the STL file.
        solid_volume_mm3: volume to compare with; None where the mesh has more than the solid (gyroid).
    """
    closed = bool(mesh.is_watertight and mesh.is_winding_consistent)
    checks = [
        Check(f"{name}.watertight", float(closed), low=1),
        Check(f"{name}.bodies", float(len(to_manifold(mesh).decompose())) if closed else 0.0, 1, 1),
        Check(f"{name}.self_intersections", float(self_intersections(mesh)), high=0),
    ]
    if solid_volume_mm3 is not None:
        error = abs(mesh.volume / solid_volume_mm3 - 1)
        checks.append(Check(f"{name}.mesh_volume_error_ratio", error, high=VOLUME_RATIO))
    return checks


def step_check(name: str, volumes_mm3: Sequence[float], path: Path) -> Check:
    """Volume of a STEP file, read back, against its solids; infinite where other or invalid solids were read."""
    from build123d import import_step

    read = import_step(path).solids()
    valid = len(read) == len(volumes_mm3) and all(solid.is_valid for solid in read)
    error = abs(sum(solid.volume for solid in read) / sum(volumes_mm3) - 1) if valid else float("inf")
    return Check(f"{name}.step_volume_error_ratio", error, high=STEP_VOLUME_RATIO)


def overlap_check(label: str, bodies: Sequence[manifold3d.Manifold]) -> Check:
    """Volume that the parts of an assembly share, in mm3: summed over pairs, so at least that of all together.

    Faces that touch are allowed: two tessellations of one contact surface may share slivers, which the limit bounds.
    Bodies with a gyroid (half a million facets) are met once by the union of all others, not by each of them.
    """
    light = [body for body in bodies if body.num_tri() < HEAVY_TRIANGLES]
    heavy = [body for body in bodies if body.num_tri() >= HEAVY_TRIANGLES]
    union = manifold3d.Manifold.batch_boolean(light, manifold3d.OpType.Add)
    shared = sum(body.volume() for body in light) - union.volume()
    shared += sum((union ^ body).volume() for body in heavy)
    for first, second in combinations(heavy, 2):  # shell and gyroid fit face to face: a union is six times cheaper
        shared += first.volume() + second.volume() - (first + second).volume()
    return Check(f"{label}.overlap_mm3", shared, high=OVERLAP_MM3)
