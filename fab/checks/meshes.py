"""Checks of every printed mesh, on the triangles read back from its STL, which are those that a slicer reads."""

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
from fab.meshing.mesh import is_oriented, to_manifold, unique_rows, volume_mm3
from fab.meshing.self_intersections import self_intersections

if TYPE_CHECKING:
    from build123d import Solid

VOLUME_RATIO = 1e-3  # largest accepted relative difference of volumes: mesh and solid,
STEP_VOLUME_RATIO = 1e-5  # solid and its STEP file
INTEGRAL_RATIO = 1e-5  # tolerance of OCCT's integral: repeats to 1e-7 after a round trip, its default to 1e-5 (cup)
HEAVY_TRIANGLES = 100_000  # from which a body counts as one with a gyroid
SECTION_MM2 = 1e-3  # E: a smaller section is the rounding of touching faces
ABOVE_MM = 0.05  # height of the cutting plane above the highest face without a twin
OVERLAP_MM3 = 1.0  # a hundredth of a printed dot: tessellation of touching faces


def mesh_checks(
    name: str, mesh: trimesh.Trimesh, solid_volume_mm3: float | None, uncrossed: bool = False
) -> list[Check]:
    """Checks that a mesh is watertight, manifold, one body, without self-intersections, and of the right volume.

    Args:
        name: name of the part.
        mesh: mesh as read back from the STL file, mm.
        solid_volume_mm3: volume of the solid, mm3; None where the mesh has more than the solid (gyroid).
        uncrossed: whether this same mesh was already searched for self-intersections without finding any.
    """
    closed = is_oriented(mesh)
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
    """Volume of a solid, mm3; the faces are subdivided until the integral converges to :data:`INTEGRAL_RATIO`."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(solid.wrapped, properties, INTEGRAL_RATIO)
    return float(properties.Mass())


def step_check(name: str, volumes_mm3: Sequence[float], path: Path) -> Check:
    """Check of a STEP file's volume against the solids; infinite where the solids read back are invalid or others.

    Args:
        name: first part of the check's name.
        volumes_mm3: volumes of the written solids (:func:`exact_volume_mm3`), mm3.
        path: the file.
    """
    from build123d import import_step

    read = import_step(path).solids()
    valid = len(read) == len(volumes_mm3) and all(solid.is_valid for solid in read)
    error = abs(sum(map(exact_volume_mm3, read)) / sum(volumes_mm3) - 1) if valid else float("inf")
    return Check(f"{name}.step_volume_error_ratio", error, high=STEP_VOLUME_RATIO)


def overlap_check(label: str, bodies: Sequence[manifold3d.Manifold]) -> Check:
    """Check of the volume that the parts of an assembly share, mm3: a sum over pairs, which is at least the total.

    Touching faces are allowed: two tessellations of one contact surface may share slivers, for which the limit leaves
    room. Bodies with a gyroid (half a million facets) are intersected once with the union of all others; two of them,
    whose faces coincide, by :func:`shared_mm3`.
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
    """Volume that two bodies share, mm3, where most faces of the second may be reversed faces of the first (twins).

    A boolean of such faces takes minutes and is avoided. The shared volume is bounded by faces without a twin, because
    at twins the bodies lie on opposite sides. Above the highest face of ``second`` without a twin all neighbours of
    twins are twins (an edge of a closed mesh has two faces), so that a shared volume can only enter there through the
    plane at that height. (A separate lump inside the other body could not be found; that each mesh is one body is
    checked elsewhere.) The bodies are therefore compared below the plane only, or as a whole where their sections in
    the plane intersect.
    """
    lone = ~twins(first, second)
    mesh = second.to_mesh()
    heights = np.asarray(mesh.vert_properties)[:, 2][np.asarray(mesh.tri_verts)[lone]]
    level = float(heights.max(initial=-np.inf)) + ABOVE_MM
    if math.isfinite(level) and (first.slice(level) ^ second.slice(level)).area() < SECTION_MM2:
        first, second = (body.trim_by_plane((0.0, 0.0, -1.0), -level) for body in (first, second))
    return first.volume() + second.volume() - (first + second).volume()  # for touching faces a union is faster


def twins(first: manifold3d.Manifold, second: manifold3d.Manifold) -> np.ndarray:
    """Mask of the second body's faces that are reversed faces of the first, with corners equal to the bit."""
    meshes = [body.to_mesh() for body in (first, second)]
    points = np.concatenate([np.asarray(mesh.vert_properties)[:, :3] for mesh in meshes]).astype(np.float32)
    _, number = unique_rows(points)
    start = len(meshes[0].vert_properties)
    mine = number[np.asarray(meshes[0].tri_verts)[:, ::-1]]
    theirs = number[start + np.asarray(meshes[1].tri_verts, dtype=np.int64)]
    return np.isin(_face_keys(theirs), _face_keys(mine))


def _face_keys(corners: np.ndarray) -> np.ndarray:
    """Keys of triangles (n, 3), which depend on the orientation but not on the first corner."""
    order = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
    turned = np.ascontiguousarray(np.take_along_axis(corners, order, axis=1).astype(np.int64))
    return turned.view("V24").ravel()
