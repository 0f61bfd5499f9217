"""Checks of the mold core's bumps, which are found on its meshes and compared with the pattern of dots.

The pattern is not used to find them: corners above the inner sphere are joined into patches, along the edges of facets
and over all pieces, because a seam may cross a bump. Millimetres, endcap frame.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from cad.dots import dot_pattern
from cad.mold.layout import MoldLayout
from cad.pattern import LEAST_BRIDGE_MM
from fab.checks.check import Check

RISE_MM = 0.03  # least height above the sphere: more than a facet's chord error, less than any bump
REACH_MM = LEAST_BRIDGE_MM / 2  # distance at which corners are joined: halves of a cut bump, but no two bumps
# Least cosine between a facet's normal and the radius. Flanks of bumps are inclined by at most 33 degrees (0.83); the
# core's joints have walls parallel to the axis, at most 0.77 of the inner radius from it at any size.
FACING = 0.8
POSITION_MM = 0.05  # largest accepted errors of a bump's summit,
HEIGHT_MM = 0.03  # of its height above the inner sphere,
RADIUS_MM = 0.1  # and of its circle on the inner sphere


def bump_checks(layout: MoldLayout, pieces: Iterable[trimesh.Trimesh]) -> list[Check]:
    """Checks of the number of bumps and of their worst errors of position, height and radius.

    A sphere is fitted to each patch; its summit and its intersection with the inner sphere are those of the bump.
    """
    params = layout.params
    risen, edges = _risen(layout, pieces)
    patches = _patches(risen, edges, REACH_MM)
    directions = np.array([dot.direction for dot in dot_pattern(params)])
    count = Check("bumps.count", float(len(patches)), len(directions), len(directions))
    if not patches:
        return [count]
    bumps = np.array([_summit_and_radius(risen[patch], params.inner_radius_mm) for patch in patches])
    summits, radii = bumps[:, :3], bumps[:, 3]
    offsets, _ = cKDTree(directions * (params.inner_radius_mm + params.dent_depth_mm)).query(summits)
    heights = np.linalg.norm(summits, axis=1) - params.inner_radius_mm
    return [
        count,
        Check("bumps.position_error_mm", float(offsets.max()), high=POSITION_MM),
        Check("bumps.height_error_mm", float(np.abs(heights - params.dent_depth_mm).max()), high=HEIGHT_MM),
        Check("bumps.radius_error_mm", float(np.abs(radii - params.dot_radius_mm).max()), high=RADIUS_MM),
    ]


def _summit_and_radius(points: np.ndarray, inner_radius_mm: float) -> np.ndarray:
    """Sphere through a patch's points (n, 3): summit (x, y, z) and radius of its footprint, as four numbers in mm.

    Notes:
        Linear least squares for the sphere: |p|^2 = 2 c.p + (r^2 - |c|^2). The footprint follows from the law of
        cosines in the triangle of both spheres' centres and a point of their common circle.
    """
    system = np.column_stack([2 * points, np.ones(len(points))])
    solution = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    c, radius = solution[:3], np.sqrt(solution[3] + solution[:3] @ solution[:3])
    distance = np.linalg.norm(c)
    cosine = (distance**2 + inner_radius_mm**2 - radius**2) / (2 * distance * inner_radius_mm)
    footprint = inner_radius_mm * np.sqrt(max(0.0, 1 - cosine**2))
    return np.append(c * (1 + radius / distance), footprint)


def _risen(layout: MoldLayout, pieces: Iterable[trimesh.Trimesh]) -> tuple[np.ndarray, np.ndarray]:
    """Corners above the inner sphere (n, 3), relative to its centre, mm, and the edges between them (m, 2) as indices.

    Corners of the walls that a joint makes inside a bump do not belong to its surface: none of their facets face
    outward.
    """
    params = layout.params
    floor = params.flange_thickness_mm - params.centre_height_mm
    found, edges, start = [], [], 0
    for mesh in pieces:
        points = mesh.vertices - (0.0, 0.0, params.centre_height_mm)
        risen = (points[:, 2] > floor) & (np.linalg.norm(points, axis=1) > params.inner_radius_mm + RISE_MM)
        risen &= _facing_out(mesh, points)
        number = start + np.cumsum(risen) - 1
        found.append(points[risen])
        edges.append(number[mesh.edges_unique[risen[mesh.edges_unique].all(axis=1)]])
        start += len(found[-1])
    return np.concatenate(found), np.concatenate(edges)


def _facing_out(mesh: trimesh.Trimesh, points: np.ndarray) -> np.ndarray:
    """Mask (n,) of the corners with a facet that faces away from the inner sphere's centre.

    Args:
        mesh: mesh of the piece.
        points: (n, 3) corners of the mesh relative to the inner sphere's centre, mm.
    """
    normals = np.repeat(mesh.face_normals, 3, axis=0)
    corners = mesh.faces.ravel()
    out = np.einsum("ij,ij->i", normals, points[corners]) > FACING * np.linalg.norm(points[corners], axis=1)
    facing = np.zeros(len(points), dtype=bool)
    facing[corners[out]] = True
    return facing


def _patches(points: np.ndarray, edges: np.ndarray, reach_mm: float) -> list[np.ndarray]:
    """Connected groups of points as index arrays; edges or distances of at most ``reach_mm`` connect points."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    close = cKDTree(points).query_pairs(reach_mm, output_type="ndarray") if len(points) else np.empty((0, 2), int)
    pairs = np.concatenate([edges, close])
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points),) * 2)
    number, labels = connected_components(graph, directed=False)
    return [np.flatnonzero(labels == k) for k in range(number)]
