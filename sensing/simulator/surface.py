"""The inner surface that the camera sees: where any direction lies on it and how it moves (mm, endcap frame).

Directions are unit vectors from the sphere's centre. States are solved with the contact on azimuth 0; a contact at
azimuth phi is the same state turned about the axis, so u_phi(X) = R(phi) u(R(-phi) X).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from cad.dots import dot_pattern
from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.simulator.element import INNER_FACE, Array, shape_quad
from sensing.simulator.geometry import ShellGeometry
from sensing.simulator.mesh import Index
from sensing.simulator.shell import ShellModel
from sensing.simulator.turn import turn_about_axis

CANDIDATES = 8
EDGE_TOLERANCE = 1e-6
ON_RAY = 1e-9  # relative miss of the ray


@dataclass(frozen=True)
class SurfaceSampler:
    """Interpolation from nodes to chosen points of the inner surface.

    Attributes:
        nodes: (k, 9). weights: (k, 9). flip: -1 where the point lies on the mirrored half, else 1 (k,).
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


def dot_directions(geometry: ShellGeometry) -> Array:
    """Directions (m, 3) of the painted dots, in the order of :func:`cad.dots.dot_pattern`.

    The pattern asks only for inner radius and view rim, which a shell of any wall has.
    """
    return np.array([dot.direction for dot in dot_pattern(cast(EndcapParams, geometry))])


def surface_sampler(model: ShellModel, directions: Array, azimuth_deg: float = 0.0) -> SurfaceSampler:
    """Find directions (k, 3) on the inner surface, for a contact at an azimuth.

    Raises:
        ParameterError: a direction that meets the clamp before the inner surface.
    """
    turn = turn_about_axis(azimuth_deg)
    wanted = np.asarray(directions, dtype=float) @ turn  # R(-phi) d
    flip = np.where(wanted[:, 1] < 0, -1.0, 1.0) if model.half else np.ones(len(wanted))
    wanted = wanted * np.stack([np.ones_like(flip), flip, np.ones_like(flip)], axis=1)
    mesh = model.solid.mesh
    faces = mesh.cells[mesh.inner][:, INNER_FACE]
    relative = mesh.points[faces] - np.array(model.geometry.centre_mm)  # (f, 9, 3)
    tree = cKDTree(relative[:, 4] / np.linalg.norm(relative[:, 4], axis=1, keepdims=True))
    _, near = tree.query(wanted, k=min(CANDIDATES, len(faces)))
    best = np.full(len(wanted), np.inf)
    local = np.zeros((len(wanted), 2))
    chosen = np.zeros(len(wanted), dtype=np.int64)
    for candidate in near.T:
        found, missed = _invert(relative[candidate], wanted)
        excess = np.where(missed, np.inf, np.abs(found).max(axis=1))
        better = excess < best
        best[better], local[better], chosen[better] = excess[better], found[better], candidate[better]
    if not best.max() <= 1 + EDGE_TOLERANCE:
        worst = int(best.argmax())
        raise ParameterError(
            f"direction={np.round(directions[worst], 4).tolist()} does not meet the inner surface: it must lie within "
            f"{math.degrees(model.geometry.clamp_polar_rad(model.geometry.inner_radius_mm)):.1f} degrees of the tip",
            name="direction",
            value=worst,
        )
    weights, _ = shape_quad(np.clip(local, -1, 1))
    return SurfaceSampler(faces[chosen], weights, flip, turn)


def _invert(corners: Array, wanted: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Local coordinates (k, 2) where faces (k, 9, 3) cross directions (k, 3), and which were missed (k,).

    Newton on the two tangential parts of the point.
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
