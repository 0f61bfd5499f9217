"""A mesh of the shell that is not the simulator's: triangles on a conformal map, cut into quadratic bricks (mm).

Half of the shell, y >= 0, tip up, in the endcap frame. The surface is triangulated in its stereographic map by Persson
and Strang's truss (2004, doi:10.1137/S0036144503429121), fine where the plane presses and along the clamp; each
triangle is cut into three quadrangles, and each of those becomes a column of 20-node bricks (CalculiX's C3D20R: reduced
integration, because fully integrated quadratic elements are too stiff for a nearly incompressible solid).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

Array = NDArray[np.float64]
Index = NDArray[np.int64]
PATCH_MM = 18.0  # round the first touch, within which edges are fine
GROWTH = 0.22  # of edges with the way from what is fine
ROUNDS, PUSH, STEP = 60, 1.2, 0.2  # of the truss
CLAMP_MM, CLAMP_POWER = 16.0, 1.5  # toward the clamp bricks get thinner: its edge is singular
EDGES = ((0, 1), (1, 2), (2, 0))


@dataclass(frozen=True)
class Grain:
    """How fine the mesh is: edges of bricks, half of the truss's.

    Attributes:
        touch_mm, clamp_mm, far_mm: where the plane presses, along the clamp, between. layers: through the wall.
    """

    touch_mm: float
    clamp_mm: float
    far_mm: float
    layers: int


GRAINS = {
    "draft": Grain(7.0, 8.5, 12.5, 2),
    "coarse": Grain(5.0, 6.0, 9.0, 2),
    "middle": Grain(3.6, 4.3, 6.5, 2),
    "fine": Grain(2.6, 3.1, 4.7, 2),
}


@dataclass(frozen=True)
class Shell:
    """The solid: two concentric spheres, cut and clamped at a height.

    Attributes:
        outer_mm, inner_mm: radii. centre_mm: height of their centre. clamp_mm: height of the clamp.
    """

    outer_mm: float
    inner_mm: float
    centre_mm: float
    clamp_mm: float

    def rim_rad(self, radius_mm: float) -> float:
        """Polar angle at which a concentric sphere meets the clamp."""
        return math.acos((self.clamp_mm - self.centre_mm) / radius_mm)


@dataclass(frozen=True)
class BrickMesh:
    """Nodes and bricks.

    Attributes:
        points: (n, 3) mm. bricks: (e, 20) in CalculiX's order, inner face first. top: (q,) bricks that own the outer
            surface. inner: (q, 8) nodes of the inner surface's quadrangles, corners first.
        clamp, mirror: nodes on the clamp and on y = 0.
    """

    points: Array
    bricks: Index
    top: Index
    inner: Index
    clamp: Index
    mirror: Index


def triangulated(shell: Shell, tilt_deg: float, grain: Grain) -> tuple[Array, Index]:
    """Points (n, 2) on the stereographic map of the mid surface, and triangles (t, 3).

    Args:
        shell: the solid. tilt_deg: polar angle of first touch. grain: of the bricks.
    """
    radius = (shell.outer_mm + shell.inner_mm) / 2
    rim = math.tan(shell.rim_rad(radius) / 2)
    touch = np.array([math.sin(math.radians(tilt_deg)), 0.0, math.cos(math.radians(tilt_deg))])

    def edge(at: Array) -> Array:
        direction = _direction(at)
        touched = radius * np.arccos(np.clip(direction @ touch, -1, 1)) - PATCH_MM
        clamped = radius * (shell.rim_rad(radius) - np.arccos(np.clip(direction[:, 2], -1, 1)))
        near = (grain.touch_mm + GROWTH * np.maximum(touched, 0), grain.clamp_mm + GROWTH * np.maximum(clamped, 0))
        wanted = 2 * np.minimum(np.minimum(*near), grain.far_mm)
        return wanted / radius * (1 + (at**2).sum(axis=1)) / 2

    points = _scattered(rim, edge)
    for _ in range(ROUNDS):
        triangles = _cut(points, rim)
        bars = np.unique(np.sort(np.concatenate([triangles[:, list(pair)] for pair in EDGES]), axis=1), axis=0)
        along = points[bars[:, 0]] - points[bars[:, 1]]
        length, wanted = np.linalg.norm(along, axis=1), edge(points[bars].mean(axis=1))
        wanted *= PUSH * math.sqrt((length**2).sum() / (wanted**2).sum())
        force = (np.maximum(wanted - length, 0) / length)[:, None] * along
        move = np.zeros_like(points)
        np.add.at(move, bars[:, 0], force)
        np.add.at(move, bars[:, 1], -force)
        points = _within(points + STEP * move, rim)
    near = 0.35 * edge(points)
    points[:, 1] = np.where(points[:, 1] < near, 0.0, points[:, 1])
    size = np.linalg.norm(points, axis=1)
    points *= np.where(rim - size < near, rim / np.maximum(size, 1e-12), 1.0)[:, None]
    return points, _cut(points, rim)


def brick_mesh(shell: Shell, tilt_deg: float, grain: Grain) -> BrickMesh:
    """The half shell, fine round the first touch at a tilt.

    Args:
        shell: the solid. tilt_deg: polar angle of first touch, on the meridian y = 0. grain: of the bricks.
    """
    flat, quads = _quadrangles(*triangulated(shell, tilt_deg, grain))
    sides, which = np.unique(
        np.sort(quads[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
    )
    middle, corners = len(flat) + which.reshape(-1, 4), len(flat)
    surface = _rimmed(np.concatenate([flat, flat[sides].mean(axis=1)]), sides, corners)
    on_rim = np.linalg.norm(surface, axis=1) > np.linalg.norm(surface, axis=1).max() - 1e-9
    levels = [_level(shell, surface, on_rim, k / (2 * grain.layers)) for k in range(2 * grain.layers + 1)]
    count = len(surface)
    bricks = []
    for layer in range(grain.layers):
        low, mid, high = (count * (2 * layer + k) for k in range(3))
        bricks.append(np.concatenate([low + quads, high + quads, low + middle, high + middle, mid + quads], axis=1))
    cells, used = _packed(np.concatenate(bricks))
    points = np.concatenate(levels)[used]
    back = np.full(count * len(levels), -1)
    back[used] = np.arange(len(used))
    return BrickMesh(
        points, cells, np.arange((grain.layers - 1) * len(quads), grain.layers * len(quads)),
        back[np.concatenate([quads, middle], axis=1)], np.flatnonzero(np.tile(on_rim, len(levels))[used]),
        np.flatnonzero(np.abs(points[:, 1]) < 1e-9),
    )  # fmt: skip


def _quadrangles(flat: Array, triangles: Index) -> tuple[Array, Index]:
    """Three quadrangles (3 t, 4) of every triangle (t, 3), and their corners."""
    sides, which = np.unique(
        np.sort(triangles[:, [list(pair) for pair in EDGES]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
    )
    middle, inside = len(flat) + which.reshape(-1, 3), len(flat) + len(sides) + np.arange(len(triangles))
    points = _rimmed(np.concatenate([flat, flat[sides].mean(axis=1)]), sides, len(flat))
    points = np.concatenate([points, flat[triangles].mean(axis=1)])
    return points, np.concatenate(
        [np.stack([triangles[:, k], middle[:, k], inside, middle[:, k - 1]], axis=1) for k in range(3)]
    )


def _rimmed(points: Array, sides: Index, corners: int) -> Array:
    """Points whose first ``corners`` are corners, then the middles of sides: those between two on the rim put on it."""
    size = np.linalg.norm(points[:corners], axis=1)
    rim = size.max()
    outer = corners + np.flatnonzero((size[sides] > rim - 1e-9).all(axis=1))
    points[outer] *= (rim / np.linalg.norm(points[outer], axis=1))[:, None]
    return points


def _packed(cells: Index) -> tuple[Index, Index]:
    """Cells with their nodes numbered without gaps, and which nodes those are."""
    used, numbers = np.unique(cells, return_inverse=True)
    return numbers.reshape(cells.shape), used


def _direction(at: Array) -> Array:
    """(n, 3) unit vectors of points on the stereographic map."""
    square = (at**2).sum(axis=1)
    return np.column_stack([2 * at, 1 - square]) / (1 + square)[:, None]


def _level(shell: Shell, surface: Array, on_rim: NDArray[np.bool_], share: float) -> Array:
    """Nodes of one level, ``share`` of the way from the inner to the outer sphere, its rim on the clamp."""
    radius, mid = shell.inner_mm + share * (shell.outer_mm - shell.inner_mm), (shell.outer_mm + shell.inner_mm) / 2
    polar = 2 * np.arctan(np.linalg.norm(surface, axis=1)) * shell.rim_rad(radius) / shell.rim_rad(mid)
    left = np.maximum(shell.rim_rad(radius) - polar, 0) * radius / CLAMP_MM
    polar = np.where(left < 1, shell.rim_rad(radius) - CLAMP_MM / radius * left**CLAMP_POWER, polar)
    polar = np.where(on_rim, shell.rim_rad(radius), polar)
    azimuth = np.arctan2(surface[:, 1], surface[:, 0])
    x, y = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)
    y = np.where(surface[:, 1] == 0, 0.0, y)
    return radius * np.column_stack([x, y, np.cos(polar)]) + [0, 0, shell.centre_mm]


def _scattered(rim: float, edge: Callable[[Array], Array]) -> Array:
    """Starting points: a triangular lattice, thinned to the wanted spacing."""
    rng, spacing = np.random.default_rng(0), 0.02
    column, row = np.meshgrid(np.arange(-rim, rim, spacing), np.arange(0, rim, spacing * math.sqrt(3) / 2))
    column = column + spacing / 2 * (np.arange(len(row)) % 2)[:, None]
    grid = np.column_stack([column.ravel(), row.ravel()])
    grid = grid[np.linalg.norm(grid, axis=1) < rim]
    keep = rng.random(len(grid)) < (spacing / edge(grid)) ** 2
    return np.concatenate([[[-rim, 0.0], [rim, 0.0]], grid[keep]])


def _within(points: Array, rim: float) -> Array:
    points[:, 1] = np.maximum(points[:, 1], 0.0)
    size = np.linalg.norm(points, axis=1)
    points *= np.where(size > rim, rim / np.maximum(size, 1e-12), 1.0)[:, None]
    points[0], points[1] = (-rim, 0.0), (rim, 0.0)
    return points


def _cut(points: Array, rim: float) -> Index:
    """Triangles of the half disc, counter-clockwise, without slivers on its border."""
    found = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[found[:, k]] for k in range(3))
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    found = np.where((area > 0)[:, None], found, found[:, ::-1])
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return found[np.abs(area) > 0.05 * longest]
