"""The inner surface as triangles, and the interpolation of displacements from other nodes.

A square grid is mapped to a disc (Shirley and Chiu 1997, doi:10.1080/10867651.1997.10487479) and the disc to the
sphere with radius = polar angle, so cells have nearly one size and no pole has narrow triangles. Endcap frame, mm.
Texture coordinates are the disc's: (polar cos azimuth, polar sin azimuth) in radians, polar angle from the tip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from cad.errors import ParameterError
from cad.params import EndcapParams

Array = NDArray[np.float64]
QUADRATIC = 6  # coefficients of a quadratic polynomial in two coordinates


@dataclass(frozen=True)
class SurfaceMesh:
    """Triangulated inner surface, undeformed.

    Attributes:
        vertices_mm: (n, 3), endcap frame.
        disc: (n, 2) texture coordinates, radians.
        triangles: (m, 3) vertex numbers, anticlockwise seen from inside.
        rim_polar: polar angle at which the surface ends, radians.
    """

    vertices_mm: Array
    disc: Array
    triangles: NDArray[np.int32]
    rim_polar: float


def rim_polar(params: EndcapParams) -> float:
    """Polar angle (radians) where the inner surface meets the top of the TPU flange."""
    cosine = (params.flange_thickness_mm - params.centre_height_mm) / params.inner_radius_mm
    return math.acos(max(-1.0, min(1.0, cosine)))


def sphere_points(params: EndcapParams, disc: Array) -> Array:
    """Points (..., 3) of the undeformed inner sphere at disc coordinates (..., 2), endcap frame, mm."""
    polar = np.linalg.norm(disc, axis=-1)
    sine = np.sinc(polar / np.pi)[..., None] * disc
    unit = np.concatenate([sine, np.cos(polar)[..., None]], -1)
    return params.inner_radius_mm * unit + [0.0, 0.0, params.centre_height_mm]


def surface_mesh(params: EndcapParams, cells: int) -> SurfaceMesh:
    """The inner surface from the tip to the flange with ``cells`` x ``cells`` quads, each cut in two."""
    axis = np.linspace(-1, 1, cells + 1)
    a, b = (grid.ravel() for grid in np.meshgrid(axis, axis))
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    safe = np.where(radius == 0, 1, radius)
    angle = np.where(wide, np.pi / 4 * b / safe, np.pi / 2 - np.pi / 4 * a / safe)
    rim = rim_polar(params)
    disc = rim * np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    p, q, r, s = corner, corner + 1, corner + cells + 2, corner + cells + 1
    triangles = np.vstack([np.stack([p, q, r], -1), np.stack([p, r, s], -1)])
    return SurfaceMesh(sphere_points(params, disc), disc, triangles.astype(np.int32), rim)


@numba.njit(cache=True)
def vertex_normals(vertices_mm: Array, triangles: NDArray[np.int32]) -> Array:
    """Unit normals (n, 3) pointing into the dome, averaged over the triangles by area."""
    normals = np.zeros_like(vertices_mm)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = vertices_mm[k, 0], vertices_mm[k, 1], vertices_mm[k, 2]
        bx, by, bz = vertices_mm[j, 0], vertices_mm[j, 1], vertices_mm[j, 2]
        ax, ay, az = ax - vertices_mm[i, 0], ay - vertices_mm[i, 1], az - vertices_mm[i, 2]
        bx, by, bz = bx - vertices_mm[i, 0], by - vertices_mm[i, 1], bz - vertices_mm[i, 2]
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        for v in (i, j, k):
            normals[v, 0] += cx
            normals[v, 1] += cy
            normals[v, 2] += cz
    for v in range(normals.shape[0]):
        length = max(np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2), 1e-300)
        normals[v] /= length
    return normals


def interpolation_matrix(params: EndcapParams, from_mm: Array, to_mm: Array, neighbours: int = 14) -> csr_matrix:
    """Sparse (t, n) matrix from values at undeformed surface nodes to those at points of the surface.

    Moving least squares with a quadratic polynomial in the tangent plane of each target: exact for quadratics and third
    order in the node spacing. No connectivity is needed, so any mesh of the mechanics can be used.

    Args:
        params: the design.
        from_mm: undeformed nodes of the inner surface (n, 3), mm.
        to_mm: points of the undeformed inner surface (t, 3), mm.
        neighbours: number of nodes for each point.

    Raises:
        ParameterError: fewer than ``neighbours`` nodes, numbers that are not finite, nodes off the inner sphere by
            over 1 % of its radius, or so many at one place that a point's neighbours hold no quadratic.
    """
    centre, radius = np.array([0, 0, params.centre_height_mm]), params.inner_radius_mm
    nodes = np.asarray(from_mm, dtype=float)
    if nodes.ndim != 2 or nodes.shape[-1] != 3 or len(nodes) < neighbours or not np.isfinite(nodes).all():
        raise ParameterError(
            f"surface nodes of shape {nodes.shape}: need finite numbers of shape (n, 3) with n of at least {neighbours}"
        )
    source = nodes - centre
    off = float(np.abs(np.linalg.norm(source, axis=1) / radius - 1).max())
    if off > 0.01:
        raise ParameterError(
            f"surface nodes up to {100 * off:.1f} % off the inner sphere of {radius:g} mm: pass undeformed nodes in mm"
        )
    target = np.asarray(to_mm, dtype=float) - centre
    distance, index = cKDTree(source).query(target, k=neighbours)
    _require_apart(nodes, index)
    first = _tangents(target)
    offsets = source[index] - target[:, None]
    x, y = (np.einsum("tkc,tc->tk", offsets, first[:, axis]) / distance[:, -1:] for axis in (0, 1))
    basis = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1)
    weight = np.exp(-2.0 * (distance / distance[:, -1:]) ** 2)
    rows = np.linalg.pinv(basis * weight[..., None])[:, 0] * weight
    starts = np.arange(len(target) + 1) * neighbours
    return csr_matrix((rows.ravel(), index.ravel(), starts), shape=(len(target), len(source)))


def _require_apart(nodes: Array, index: NDArray[np.int64]) -> None:
    """Refuse neighbours (t, k) at fewer distinct places than a quadratic has coefficients."""
    places = np.unique(nodes, axis=0, return_inverse=True)[1].ravel()
    apart = 1 + (np.diff(np.sort(places[index], axis=1), axis=1) > 0).sum(axis=1)
    worst = int(apart.argmin())
    if apart[worst] < QUADRATIC:
        x, y, z = nodes[index[worst, 0]]
        raise ParameterError(
            f"surface nodes: different places among the {index.shape[1]} nearest to ({x:.1f}, {y:.1f}, {z:.1f}) mm: "
            f"{apart[worst]}, need {QUADRATIC} or more: give each node once"
        )


def _tangents(directions: Array) -> Array:
    """Two orthonormal tangents (t, 2, 3) at each direction."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    helper = np.where(np.abs(unit[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    first = np.cross(unit, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(unit, first)], 1)
