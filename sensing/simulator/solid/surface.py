"""The inner surface that the camera sees: its points along any direction and their displacements (mm, endcap frame).

Directions are unit vectors from the sphere's centre. States are solved with the contact on azimuth 0; a contact at
azimuth phi is the same state turned about the axis, so u_phi(X) = R(phi) u(R(-phi) X).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from cad.dots import dot_pattern
from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.simulator.solid.element import INNER_FACE, Array, shape_quad
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import HexMesh, Index
from sensing.simulator.solid.shell import ShellModel

# A tracked window shows the mean displacement of this ring round the dot's centre; radius in radii of the dot (M:
# bench/bench_wrench.py tracking). The ring is that wide because a window also weighs what lies outside the ink, and
# because a round outline shows only the motion across it: of a bulge, one and a half times what its mean would.
OUTLINE_RADII, OUTLINE_POINTS = 1.75, 8
CANDIDATES = 8  # nearest faces that are searched for a direction
EDGE_TOLERANCE = 1e-6  # local coordinate by which a point may lie outside a face
ON_RAY = 1e-9  # relative miss of the ray at which Newton's iteration stops
MIRROR_MM = 1e-6  # distance from y = 0 within which a point is its own mirror image


@dataclass(frozen=True)
class SurfaceSampler:
    """Interpolation from nodes to chosen points of the inner surface.

    Attributes:
        nodes: node numbers of each point's face (k, 9).
        weights: shape functions there (k, 9).
        flip: -1 where the point lies on the mirrored half, else 1 (k,).
        turn: rotation about the axis from azimuth 0 to the contact's azimuth (3, 3).
    """

    nodes: Index
    weights: Array
    flip: Array
    turn: Array

    def sample(self, field: Array) -> Array:
        """Values (k, 3) of a nodal vector field (n, 3), turned to the contact's azimuth."""
        values = np.einsum("ka,kai->ki", self.weights, field[self.nodes])
        values[:, 1] *= self.flip
        return values @ self.turn.T


@dataclass(frozen=True)
class InnerSurface:
    """The whole inner surface of a mesh, on which every level gives its displacement field, in one numbering.

    Attributes:
        geometry: geometry of the shell.
        position: points at rest (k, 3), mm.
        face: biquadratic faces (f, 9), by numbers of these points.
        nodes: numbers of these points among the nodes of the mesh (k,).
        flip: (k,) -1 for points in the mirrored half of the mesh, 1 for the others.
    """

    geometry: ShellGeometry
    position: Array
    face: Index
    nodes: Index
    flip: Array

    def field(self, displacement: Array) -> Array:
        """Displacement (k, 3) of the surface, for that of the mesh's nodes (n, 3)."""
        values = displacement[self.nodes]
        values[:, 1] *= self.flip
        return values

    def renumbered(self, other: InnerSurface) -> InnerSurface:
        """This surface in the numbering of another one on the same mesh (whole or half)."""
        apart, place = cKDTree(self.position).query(other.position)
        if not apart.max() < MIRROR_MM:
            raise ParameterError("surfaces of different meshes cannot share a numbering", name="other", value=other)
        return InnerSurface(self.geometry, other.position, other.face, self.nodes[place], self.flip[place])

    def sampler(self, directions: Array, azimuth_deg: float = 0.0) -> SurfaceSampler:
        """Sampler of fields (k, 3) on this surface (see :func:`surface_sampler`)."""
        return _sampler(self.geometry, self.position, self.face, False, directions, azimuth_deg)

    def interpolation(self, points_mm: Array) -> csr_matrix:
        """Sparse (t, k) matrix from fields on this surface to points (t, 3) of the undeformed inner sphere, mm."""
        offset = np.asarray(points_mm, dtype=float) - np.array(self.geometry.centre_mm)
        found = self.sampler(offset / np.linalg.norm(offset, axis=1, keepdims=True))
        starts = np.arange(len(offset) + 1) * found.nodes.shape[1]
        shape = (len(offset), len(self.position))
        return csr_matrix((found.weights.ravel(), found.nodes.ravel(), starts), shape=shape)


def inner_surface(model: ShellModel) -> InnerSurface:
    """Inner surface of a whole model, or of both halves of a half model."""
    mesh = model.solid.mesh
    nodes, inverse = np.unique(mesh.cells[mesh.inner][:, INNER_FACE], return_inverse=True)
    face, position = inverse.reshape(-1, 9).astype(np.int64), mesh.points[nodes]
    if not model.half:
        return InnerSurface(model.geometry, position, face, nodes, np.ones(len(nodes)))
    mirrored = position * [1.0, -1.0, 1.0]
    apart = position[:, 1] > MIRROR_MM
    twin = np.where(apart, np.cumsum(apart) - 1 + len(nodes), np.arange(len(nodes)))
    turned = twin[face].reshape(-1, 3, 3)[:, :, ::-1].reshape(-1, 9)  # undo the reversal by the mirror
    return InnerSurface(
        model.geometry,
        np.concatenate([position, mirrored[apart]]),
        np.concatenate([face, turned]),
        np.concatenate([nodes, nodes[apart]]),
        np.concatenate([np.ones(len(nodes)), -np.ones(int(apart.sum()))]),
    )


def dot_directions(geometry: ShellGeometry) -> Array:
    """Directions (m, 3) of the painted dots, in the order of :func:`cad.dots.dot_pattern`.

    The pattern depends only on inner radius, view rim, rings and size, which a shell of any wall has.
    """
    return np.array([dot.direction for dot in dot_pattern(cast(EndcapParams, geometry))])


def outline_directions(geometry: ShellGeometry) -> Array:
    """Directions (m * OUTLINE_POINTS, 3) of a ring of points round every painted dot, dot by dot."""
    return ring_directions(dot_directions(geometry), geometry)


def ring_directions(outward: Array, geometry: ShellGeometry) -> Array:
    """Directions (m * OUTLINE_POINTS, 3) of a ring of points round dots at directions (m, 3), dot by dot."""
    aside = np.where(np.abs(outward[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    east = np.cross(outward, aside)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(OUTLINE_POINTS)[:, None] / OUTLINE_POINTS
    ring = np.cos(angle) * east[:, None] + np.sin(angle) * np.cross(outward, east)[:, None]
    found = outward[:, None] + OUTLINE_RADII * geometry.dot_radius_mm / geometry.inner_radius_mm * ring
    return np.asarray((found / np.linalg.norm(found, axis=2, keepdims=True)).reshape(-1, 3))


def turn_about_axis(azimuth_deg: float) -> Array:
    """Rotation about z (3, 3)."""
    c, s = math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turn_wrench(wrench: Array, azimuth_deg: float) -> Array:
    """Wrench (..., 6) of a state solved at azimuth 0, for a contact at another azimuth."""
    turn = turn_about_axis(azimuth_deg)
    return np.concatenate([wrench[..., :3] @ turn.T, wrench[..., 3:] @ turn.T], axis=-1)


def surface_sampler(model: ShellModel, directions: Array, azimuth_deg: float = 0.0) -> SurfaceSampler:
    """Sampler at directions on the inner surface, for a contact at an azimuth.

    Args:
        model: half or whole model.
        directions: unit vectors from the sphere's centre (k, 3).
        azimuth_deg: azimuth of the contact, degrees.

    Raises:
        ParameterError: a direction that meets the clamp before the inner surface.
    """
    mesh: HexMesh = model.solid.mesh
    faces = mesh.cells[mesh.inner][:, INNER_FACE]
    return _sampler(model.geometry, mesh.points, faces, model.half, directions, azimuth_deg)


def _sampler(
    geometry: ShellGeometry, points: Array, faces: Index, half: bool, directions: Array, azimuth_deg: float
) -> SurfaceSampler:
    turn = turn_about_axis(azimuth_deg)
    wanted = np.asarray(directions, dtype=float) @ turn  # R(-phi) d
    flip = np.where(wanted[:, 1] < 0, -1.0, 1.0) if half else np.ones(len(wanted))
    wanted = wanted * np.stack([np.ones_like(flip), flip, np.ones_like(flip)], axis=1)
    relative = points[faces] - np.array(geometry.centre_mm)  # (f, 9, 3)
    tree = cKDTree(relative[:, 4] / np.linalg.norm(relative[:, 4], axis=1, keepdims=True))
    _, near = tree.query(wanted, k=min(CANDIDATES, len(faces)))
    best = np.full(len(wanted), np.inf)
    local = np.zeros((len(wanted), 2))
    chosen = np.zeros(len(wanted), dtype=np.int64)
    for candidate in near.T:
        lost = np.flatnonzero(best > 1)  # in none of the searched faces
        found, missed = _invert(relative[candidate[lost]], wanted[lost])
        excess = np.where(missed, np.inf, np.abs(found).max(axis=1))
        better = excess < best[lost]
        place = lost[better]
        best[place], local[place], chosen[place] = excess[better], found[better], candidate[place]
    if not best.max() <= 1 + EDGE_TOLERANCE:
        worst = int(best.argmax())
        raise ParameterError(
            f"direction={np.round(directions[worst], 4).tolist()} does not meet the inner surface: it must lie within "
            f"{math.degrees(geometry.clamp_polar_rad(geometry.inner_radius_mm)):.1f} degrees of the tip",
            name="direction",
            value=worst,
        )
    weights, _ = shape_quad(np.clip(local, -1, 1))
    return SurfaceSampler(faces[chosen], weights, flip, turn)


def _invert(corners: Array, wanted: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Local coordinates (k, 2) where faces (k, 9, 3) cross directions (k, 3), and whether they converged (k,).

    Newton's method on the two tangential components of the point.
    """
    helper = np.where(np.abs(wanted[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(wanted, helper)
    tangents = np.stack([first, np.cross(wanted, first)], axis=1)  # (k, 2, 3)
    local = np.zeros((len(wanted), 2))
    for _ in range(8):
        value, grad = shape_quad(local)
        point = np.einsum("ka,kai->ki", value, corners)
        jacobian = np.einsum("kti,kai,kas->kts", tangents, corners, grad)
        change = np.linalg.solve(jacobian, np.einsum("kti,ki->kt", tangents, point)[..., None])[..., 0]
        local = np.clip(local - change, -3.0, 3.0)
    point = np.einsum("ka,kai->ki", shape_quad(local)[0], corners)
    along = np.einsum("ki,ki->k", point, wanted)
    return local, ~(np.linalg.norm(point - along[:, None] * wanted, axis=1) < ON_RAY * along)
