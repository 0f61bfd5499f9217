"""Thinnest wall of a printed part, between its faces and from its inner edges (millimetres).

Where two surfaces of a part come nearest to each other, their common normal runs through the wall: between two faces
that are parallel there, or from an inner edge (a hole's bottom rim, a groove's corner) square onto a face. So rays go
inward from every face along its normal, and from every inner edge between the normals of its two faces; a ray that
meets the far side square has measured a wall. Faces that meet at an angle end in an outer edge, which a printer rounds:
from there no ray meets a face square.

Not seen: a wall between two inner edges, or one that ends in a corner.
"""

from __future__ import annotations

import numpy as np
import trimesh

from fab.checks.check import Check

MIN_WALL_MM = 0.8  # two lines of a 0.4 mm nozzle
SQUARE = (
    0.98  # cosine, 11 degrees: facets of an M2 hole lie 9 from it (chord 0.01), faces of a feather edge 15 and more
)
INNER_EDGE_RAD = 0.35  # flatter ones are between facets of one surface, and their faces' own rays see as much
EDGE_DIRECTIONS = 13  # over the angle between the normals of its faces: 8 degrees apart at a right angle
EDGE_PLACES = (0.1, 0.5, 0.9)  # along an edge
LEAST_AREA_MM2 = 1e-9  # of a face whose normal means something
OFF_MM = 1e-3  # a ray starts so deep, not on its own face


def min_wall_check(name: str, mesh: trimesh.Trimesh) -> Check:
    """Thinnest wall of a part against what a printer can make.

    Args:
        name: of the part.
        mesh: closed.
    """
    return Check(f"{name}.min_wall_mm", min_wall_mm(mesh), low=MIN_WALL_MM)


def min_wall_mm(mesh: trimesh.Trimesh) -> float:
    """Thinnest wall of a closed mesh; infinite where no two surfaces face each other.

    Args:
        mesh: closed, faces outward.
    """
    from_faces, from_edges = _face_rays(mesh), _edge_rays(mesh)
    starts, ways = (np.concatenate(both) for both in zip(from_faces, from_edges, strict=True))
    hit = mesh.ray.intersects_first(starts + OFF_MM * ways, ways)
    across = np.einsum("ij,ij->i", mesh.face_normals[hit], ways)
    square = (hit >= 0) & (across > SQUARE)
    ahead = mesh.triangles[hit[square], 0] - starts[square]  # to the plane of the face that the ray meets
    depths = np.einsum("ij,ij->i", mesh.face_normals[hit[square]], ahead) / across[square]
    return float(depths.min(initial=np.inf))


def _face_rays(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """From the middle of each face inward: starts (n, 3), unit directions (n, 3)."""
    kept = mesh.area_faces > LEAST_AREA_MM2
    return mesh.triangles_center[kept], -mesh.face_normals[kept]


def _edge_rays(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """From each inner edge into the part: starts (n, 3), unit directions (n, 3)."""
    inner = ~mesh.face_adjacency_convex & (mesh.face_adjacency_angles > INNER_EDGE_RAD)
    first, last = mesh.vertices[mesh.face_adjacency_edges[inner]].swapaxes(0, 1)
    one, other = -mesh.face_normals[mesh.face_adjacency[inner]].swapaxes(0, 1)
    starts, ways = [], []
    for share in np.linspace(0.0, 1.0, EDGE_DIRECTIONS):
        way = (1 - share) * one + share * other
        length = np.linalg.norm(way, axis=1, keepdims=True)
        turned = length[:, 0] > OFF_MM  # not back to back
        for place in EDGE_PLACES:
            starts.append((first + place * (last - first))[turned])
            ways.append((way / np.maximum(length, OFF_MM))[turned])
    return np.concatenate(starts), np.concatenate(ways)
