"""Structured hexahedral meshes: the shell's O-grid, and the blocks of the verification (mm).

The shell's disc (tip at the centre, clamp at radius 1) is a core of ``core x core`` quads inside ``rings`` rings of
``4 core`` quads, mirrored exactly in y = 0. Rings shrink toward the clamp, because the bonded edge of a nearly
incompressible solid is singular and its error shows as a shift of the whole dome.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cad.errors import GeometryError, ParameterError
from sensing.simulator.solid.element import Array, shape_hex, volume_rule
from sensing.simulator.solid.geometry import ShellGeometry

Index = NDArray[np.int64]
CORE_SHARE = 0.8  # length of the core's elements over that of the free rings
ROUNDING = 0.6  # 0 keeps the core square (bad corners outside), 1 makes it a circle (bad corners inside)
CLAMP_GRADING = (0.75, 0.45, 0.22, 0.1)  # lengths of the last rings over the free ones, the clamp last


@dataclass(frozen=True)
class MeshDensity:
    """Numbers of elements in the shell's mesh.

    Attributes:
        core: elements along a side of the core, even so that y = 0 is a mesh line.
        rings: rings round the core.
        layers: elements through the wall.

    Raises:
        ParameterError: odd or too small numbers.
    """

    core: int = 6
    rings: int = 9
    layers: int = 1

    def __post_init__(self) -> None:
        if self.core < 2 or self.core % 2 or self.rings < len(CLAMP_GRADING) + 1 or self.layers < 1:
            raise ParameterError(
                f"core={self.core}, rings={self.rings}, layers={self.layers} is no mesh: core must be even and at "
                f"least 2, rings at least {len(CLAMP_GRADING) + 1}, layers at least 1",
                name="density",
                value=(self.core, self.rings, self.layers),
            )


# Named densities, coarse to fine.
DENSITIES = {
    "draft": MeshDensity(4, 7, 1),
    "data": MeshDensity(6, 9, 1),
    "fine": MeshDensity(8, 13, 1),
    "reference": MeshDensity(10, 15, 1),
    "converged": MeshDensity(14, 20, 2),
}


@dataclass(frozen=True)
class HexMesh:
    """Points (n, 3) and hex27 cells (e, 27); ``outer`` and ``inner`` list the cells that own such a face."""

    points: Array
    cells: Index
    outer: Index
    inner: Index

    def __post_init__(self) -> None:
        local, _ = volume_rule()
        _, grad = shape_hex(local)
        jacobians = np.linalg.det(np.einsum("gak,eai->egik", grad, self.points[self.cells]))
        if not jacobians.min() > 0:
            raise GeometryError(
                f"mesh: {int((jacobians.min(axis=1) <= 0).sum())} of {len(self.cells)} elements are turned inside "
                "out: the geometry crosses itself or is too flat for this density"
            )


def shell_mesh(geometry: ShellGeometry, density: MeshDensity, half: bool = False) -> HexMesh:
    """Mesh of the shell.

    Args:
        geometry: the shell.
        density: numbers of elements.
        half: whether only y >= 0 is meshed, for paths in the mirror plane.
    """
    quads = _disc_quads(density)  # (q, 9, 2)
    if half:
        quads = quads[quads[:, 4, 1] > 0]
    levels = np.linspace(0.0, 1.0, 2 * density.layers + 1)
    blocks = [
        np.concatenate([_on_shell(geometry, quads, levels[2 * layer + k]) for k in range(3)], axis=1)
        for layer in range(density.layers)
    ]
    count = len(quads)
    return merge(
        np.concatenate(blocks),
        outer=np.arange(count) + count * (density.layers - 1),
        inner=np.arange(count),
    )


def box_mesh(counts: tuple[int, int, int], size: tuple[float, float, float]) -> HexMesh:
    """Box from the origin with ``counts`` elements along each side; outer and inner are its z faces."""
    axes = [np.linspace(0, length, 2 * n + 1) for n, length in zip(counts, size, strict=True)]
    cells = []
    for k in range(counts[2]):
        for j in range(counts[1]):
            for i in range(counts[0]):
                x, y, z = (axis[2 * m : 2 * m + 3] for axis, m in zip(axes, (i, j, k), strict=True))
                zz, yy, xx = np.meshgrid(z, y, x, indexing="ij")
                cells.append(np.stack([xx, yy, zz], axis=-1).reshape(27, 3))
    layer = counts[0] * counts[1]
    total = layer * counts[2]
    return merge(np.array(cells), outer=np.arange(total - layer, total), inner=np.arange(layer))


def sphere_octant_mesh(inner_mm: float, outer_mm: float, across: int, layers: int) -> HexMesh:
    """Octant x, y, z >= 0 of a thick sphere: three patches of a cubed sphere.

    Args:
        inner_mm, outer_mm: inner and outer radius, mm.
        across: number of elements along an edge of a patch.
        layers: number of elements through the wall.
    """
    lattice = np.tan(np.linspace(0.0, math.pi / 4, 2 * across + 1))
    radii = np.linspace(inner_mm, outer_mm, 2 * layers + 1)
    cells = []
    for layer in range(layers):
        for axis in range(3):
            for j in range(across):
                for i in range(across):
                    u, v = np.meshgrid(lattice[2 * i : 2 * i + 3], lattice[2 * j : 2 * j + 3])
                    face = np.roll(np.stack([u, v, np.ones_like(u)], axis=-1).reshape(9, 3), axis, axis=1)
                    face /= np.linalg.norm(face, axis=1, keepdims=True)
                    cells.append(np.concatenate([r * face for r in radii[2 * layer : 2 * layer + 3]]))
    each = 3 * across * across
    return merge(np.array(cells), outer=np.arange(each) + each * (layers - 1), inner=np.arange(each))


def merge(cell_points: Array, outer: Index, inner: Index) -> HexMesh:
    """Mesh of cells with points of their own; points nearer than 1e-6 of the size are joined.

    Args:
        cell_points: points of each cell (e, 27, 3), mm.
        outer, inner: numbers of the cells that own such a face.
    """
    flat = cell_points.reshape(-1, 3)
    pitch = 1e-6 * float(np.ptp(flat, axis=0).max())
    keys = np.round(flat / pitch + 0.25).astype(np.int64)  # the offset keeps exact zeros away from a rounding threshold
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return HexMesh(flat[first], inverse.reshape(len(cell_points), 27).astype(np.int64), outer, inner)


def _on_shell(geometry: ShellGeometry, quads: Array, level: float) -> Array:
    """Disc points (q, 9, 2) mapped to the sphere at ``level`` (0..1) through the wall; the edge lies on the clamp."""
    radius = geometry.inner_radius_mm + level * geometry.wall_mm
    middle = geometry.clamp_polar_rad(geometry.mid_radius_mm)
    share = np.hypot(quads[..., 0], quads[..., 1])
    polar = share * middle + (geometry.clamp_polar_rad(radius) - middle) * share**4
    azimuth = np.arctan2(quads[..., 1], quads[..., 0])
    direction = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1)
    return radius * direction + np.array(geometry.centre_mm)


def _disc_quads(density: MeshDensity) -> Array:
    """Quads (q, 9, 2) of the unit disc."""
    lengths = np.ones(density.rings)
    lengths[-len(CLAMP_GRADING) :] = CLAMP_GRADING
    unit = 1.0 / (lengths.sum() + CORE_SHARE * density.core / 2)
    core_radius = 1.0 - unit * lengths.sum()
    edges = np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
    steps = np.linspace(-1.0, 1.0, 2 * density.core + 1)
    quads = []
    for j in range(density.core):
        for i in range(density.core):
            u, v = np.meshgrid(steps[2 * i : 2 * i + 3], steps[2 * j : 2 * j + 3])
            quads.append(_core_point(u, v, core_radius).reshape(9, 2))
    for low, high in pairwise(edges):
        ring = np.array([low, (low + high) / 2, high])
        for side in range(4):
            for j in range(density.core):
                quads.append(_ring_quad(ring, steps[2 * j : 2 * j + 3], side, core_radius))
    return np.array(quads)


def _core_point(u: Array, v: Array, radius: float) -> Array:
    square = np.stack([u, v], axis=-1)
    circle = np.stack([u * np.sqrt(1 - v * v / 2), v * np.sqrt(1 - u * u / 2)], axis=-1)
    return radius * ((1 - ROUNDING) * square + ROUNDING * circle)


def _ring_quad(ring: Array, steps: Array, side: int, core_radius: float) -> Array:
    outward, along = np.meshgrid(ring, steps)  # first local axis outward, second along the side: right-handed
    start = _core_point(np.ones_like(along), along, core_radius)
    angle = along * math.pi / 4
    end = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    point = ((1 - outward[..., None]) * start + outward[..., None] * end).reshape(9, 2)
    for _ in range(side):
        point = np.stack([-point[:, 1], point[:, 0]], axis=-1)  # a quarter turn, exact
    return point
