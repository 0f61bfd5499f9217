"""Checks of every printed mesh, on the triangles read back from its STL: what the slicer will get."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import manifold3d
import numpy as np
import trimesh

from fab.checks.check import Check
from fab.meshing.mesh import to_manifold, unique_rows, volume_mm3
from fab.meshing.self_intersections import self_intersections

if TYPE_CHECKING:
    from build123d import Solid

VOLUME_RATIO = 1e-3  # mesh against solid
STEP_VOLUME_RATIO = 1e-5  # solid against its STEP file
INTEGRAL_RATIO = 1e-5  # where OCCT's integral ends: repeats to 1e-7 after a round trip, its plain one to 1e-5 (the cup)
HEAVY_TRIANGLES = 100_000
SECTION_MM2 = 1e-3  # E: a section this small is the rounding of faces that touch
ABOVE_MM = 0.05  # a plane is laid this far above the faces that do not match
OVERLAP_MM3 = 1.0  # a hundredth of a printed dot: tessellation of touching faces, nothing a print could feel


def mesh_checks(
    name: str, mesh: trimesh.Trimesh, solid_volume_mm3: float | None, uncrossed: bool = False
) -> list[Check]:
    """Watertight, manifold, one body, free of self-intersections, and of the right volume.

    Args:
        name: the part's name.
        mesh: as read back from the STL file.
        solid_volume_mm3: volume to compare with; None where the mesh has more than the solid (gyroid).
        uncrossed: whether this very mesh has been searched for self-intersections already, and none were found.
    """
    closed = bool(mesh.is_watertight and mesh.is_winding_consistent)
    checks = [
        Check(f"{name}.watertight", float(closed), low=1),
        Check(f"{name}.bodies", float(len(to_manifold(mesh).decompose())) if closed else 0.0, 1, 1),
        Check(f"{name}.self_intersections", 0.0 if uncrossed else float(self_intersections(mesh)), high=0),
    ]
    if solid_volume_mm3 is not None:
        error = abs(volume_mm3(mesh) / solid_volume_mm3 - 1)
        checks.append(Check(f"{name}.mesh_volume_error_ratio", error, high=VOLUME_RATIO))
    return checks


def exact_volume_mm3(solid: Solid) -> float:
    """Volume of a solid, its faces divided until the integral stands."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid.wrapped, properties, INTEGRAL_RATIO)
    return float(properties.Mass())


def step_check(name: str, volumes_mm3: Sequence[float], path: Path) -> Check:
    """Volume of a STEP file, read back, against its solids; infinite where other or invalid solids were read.

    Args:
        name: first part of the check's name.
        volumes_mm3: of the solids that were written (:func:`exact_volume_mm3`).
        path: of the file.
    """
    from build123d import import_step

    read = import_step(path).solids()
    valid = len(read) == len(volumes_mm3) and all(solid.is_valid for solid in read)
    error = abs(sum(map(exact_volume_mm3, read)) / sum(volumes_mm3) - 1) if valid else float("inf")
    return Check(f"{name}.step_volume_error_ratio", error, high=STEP_VOLUME_RATIO)


def overlap_check(label: str, bodies: Sequence[manifold3d.Manifold]) -> Check:
    """Volume that the parts of an assembly share, in mm3: summed over pairs, so at least that of all together.

    Faces that touch are allowed: two tessellations of one contact surface may share slivers, which the limit bounds.
    Bodies with a gyroid (half a million facets) are met once by the union of all others, not by each of them; two of
    them, which fit face to face, by :func:`shared_mm3`.
    """
    light = [body for body in bodies if body.num_tri() < HEAVY_TRIANGLES]
    heavy = [body for body in bodies if body.num_tri() >= HEAVY_TRIANGLES]
    union = manifold3d.Manifold.batch_boolean(light, manifold3d.OpType.Add)
    shared = sum(body.volume() for body in light) - union.volume()
    shared += sum((union ^ body).volume() for body in heavy)
    for first, second in combinations(heavy, 2):
        shared += shared_mm3(first, second)
    return Check(f"{label}.overlap_mm3", shared, high=OVERLAP_MM3)


def shared_mm3(first: manifold3d.Manifold, second: manifold3d.Manifold) -> float:
    """Volume that two bodies share, where most of the second's faces may be those of the first turned round.

    The boolean of such faces costs minutes, and need not be made. What the bodies share is bounded by faces of either
    that have no such twin: at twins, the bodies lie on opposite sides. Above the highest face of ``second`` without a
    twin, twins have twins for neighbours (an edge of a closed mesh has two faces), so nothing shared begins there: it
    would have to come up through the plane at that height (a loose lump inside the other body would not: that each mesh
    is one body is a check of its own). So the bodies are compared below the plane only, and whole
    where their sections in the plane meet.
    """
    lone = ~twins(first, second)
    mesh = second.to_mesh()
    heights = np.asarray(mesh.vert_properties)[:, 2][np.asarray(mesh.tri_verts)[lone]]
    level = float(heights.max(initial=-np.inf)) + ABOVE_MM
    if math.isfinite(level) and (first.slice(level) ^ second.slice(level)).area() < SECTION_MM2:
        first, second = (body.trim_by_plane((0.0, 0.0, -1.0), -level) for body in (first, second))
    return first.volume() + second.volume() - (first + second).volume()  # of faces that touch, a union is the quicker


def twins(first: manifold3d.Manifold, second: manifold3d.Manifold) -> np.ndarray:
    """Faces (mask) of the second body that are faces of the first turned round, corner for corner to the bit."""
    meshes = [body.to_mesh() for body in (first, second)]
    points = np.concatenate([np.asarray(mesh.vert_properties)[:, :3] for mesh in meshes]).astype(np.float32)
    _, number = unique_rows(points)
    start = len(meshes[0].vert_properties)
    mine = number[np.asarray(meshes[0].tri_verts)[:, ::-1]]
    theirs = number[start + np.asarray(meshes[1].tri_verts, dtype=np.int64)]
    return np.isin(_face_keys(theirs), _face_keys(mine))


def _face_keys(corners: np.ndarray) -> np.ndarray:
    """A key for each triangle (n, 3), the same from whichever corner it is read, but not in the other sense."""
    order = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.ascontiguousarray(np.take_along_axis(corners, order, axis=1).astype(np.int64))
    return turned.view("V24").ravel()
