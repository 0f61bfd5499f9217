"""Check of the thinnest wall of a printed part, between its faces and from its inner edges (millimetres).

At the least distance between two surfaces of a part their common normal runs through the wall: between two faces that
are parallel there, or from an inner edge (a hole's bottom rim, a groove's corner) normal to a face. Rays therefore go
inward from every face along its normal, and from every inner edge in directions between the normals of its two faces;
the length of a ray that is normal to the far side is a wall thickness. Faces that meet at an angle form an outer edge,
which a printer rounds; no ray from there is normal to a face.

Where booleans leave two corners of a mesh nearer than a hundredth of its tolerance, the sliver between them has any
normal, and its long sides would count as inner edges: such corners are one here, and what slivers remain send no rays.

A wall between two inner edges, or one that ends in a corner, is not found.
"""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fab.checks.check import Check

MIN_WALL_MM = 0.8  # two lines of a 0.4 mm nozzle
SQUARE = (
    0.98  # cosine, 11 degrees: facets of an M2 hole lie 9 from it (chord 0.01), faces of a feather edge 15 and more
)
INNER_EDGE_RAD = 0.35  # flatter edges lie between facets of one surface, for which the faces' own rays suffice
EDGE_DIRECTIONS = 13  # between the normals of its faces: 8 degrees apart at a right angle
EDGE_PLACES = (0.1, 0.5, 0.9)  # starts of the rays, as fractions of the edge
LEAST_HEIGHT_MM = 1e-3  # of a face with a reliable normal: STL gives corners to 1.5e-5 mm, which turn it by 1 degree
SAME_MM = 1e-4  # distance of corners that are one: ten times that to which STL gives them
OFF_MM = 1e-3  # depth at which a ray starts, off its own face


def min_wall_check(name: str, mesh: trimesh.Trimesh) -> Check:
    """Check of a part's thinnest wall against the least wall that a printer can make.

    Args:
        name: name of the part.
        mesh: closed mesh, mm.
    """
    return Check(f"{name}.min_wall_mm", min_wall_mm(mesh), low=MIN_WALL_MM)


def min_wall_mm(mesh: trimesh.Trimesh) -> float:
    """Thinnest wall of a closed mesh, mm; infinite where no two surfaces are opposite each other.

    Args:
        mesh: closed mesh with outward faces, mm.
    """
    mesh = _without_needles(mesh)
    firm = _is_firm(mesh)
    from_faces, from_edges = _face_rays(mesh, firm), _edge_rays(mesh, firm)
    starts, ways = (np.concatenate(both) for both in zip(from_faces, from_edges, strict=True))
    hit = mesh.ray.intersects_first(starts + OFF_MM * ways, ways)
    across = np.einsum("ij,ij->i", mesh.face_normals[hit], ways)
    square = (hit >= 0) & (across > SQUARE)
    ahead = mesh.triangles[hit[square], 0] - starts[square]  # vector to the plane of the face that the ray meets
    depths = np.einsum("ij,ij->i", mesh.face_normals[hit[square]], ahead) / across[square]
    return float(depths.min(initial=np.inf))


def _without_needles(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh with corners nearer than :data:`SAME_MM` as one, without the faces that lose a corner in that way."""
    near = cKDTree(mesh.vertices).query_pairs(SAME_MM, output_type="ndarray")
    if not len(near):
        return mesh
    count = len(mesh.vertices)
    links = coo_matrix((np.ones(len(near)), near.T), (count, count))
    _, first, group = np.unique(connected_components(links, directed=False)[1], return_index=True, return_inverse=True)
    faces = first[group][mesh.faces]
    kept = (faces != faces[:, [1, 2, 0]]).all(axis=1)
    return trimesh.Trimesh(mesh.vertices, faces[kept], process=False)


def _is_firm(mesh: trimesh.Trimesh) -> np.ndarray:
    """(faces,) whether the height of a face over its longest side lets its normal be relied on."""
    longest = mesh.edges_unique_length[mesh.faces_unique_edges].max(axis=1)
    return np.asarray(2 * mesh.area_faces > LEAST_HEIGHT_MM * longest)


def _face_rays(mesh: trimesh.Trimesh, firm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays from the middle of each firm face inward: starts (n, 3), unit directions (n, 3)."""
    return mesh.triangles_center[firm], -mesh.face_normals[firm]


def _edge_rays(mesh: trimesh.Trimesh, firm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays from each inner edge between firm faces into the part: starts (n, 3), unit directions (n, 3)."""
    inner = ~mesh.face_adjacency_convex & (mesh.face_adjacency_angles > INNER_EDGE_RAD)
    inner &= firm[mesh.face_adjacency].all(axis=1)
    first, last = mesh.vertices[mesh.face_adjacency_edges[inner]].swapaxes(0, 1)
    one, other = -mesh.face_normals[mesh.face_adjacency[inner]].swapaxes(0, 1)
    starts, ways = [], []
    for share in np.linspace(0.0, 1.0, EDGE_DIRECTIONS):
        way = (1 - share) * one + share * other
        length = np.linalg.norm(way, axis=1, keepdims=True)
        turned = length[:, 0] > OFF_MM  # not opposite normals
        for place in EDGE_PLACES:
            starts.append((first + place * (last - first))[turned])
            ways.append((way / np.maximum(length, OFF_MM))[turned])
    return np.concatenate(starts), np.concatenate(ways)
