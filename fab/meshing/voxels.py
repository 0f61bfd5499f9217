"""Voxels of meshes, and dilation by a ball (millimetres).

A voxel is inside a mesh if its centre is. Distances between voxel centres are exact up to a limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh


@dataclass(frozen=True)
class VoxelBox:
    """Axis-aligned box of cubic voxels.

    Attributes:
        low: (3,) centre of the first voxel, mm.
        shape: numbers of voxels along x, y, z.
        step_mm: side of a voxel, mm.
    """

    low: np.ndarray
    shape: tuple[int, int, int]
    step_mm: float

    @staticmethod
    def around(low: np.ndarray, high: np.ndarray, step_mm: float) -> VoxelBox:
        """Box whose voxel centres cover ``low..high``, slightly off round numbers so that no ray meets an edge.

        Args:
            low: (3,) lowest corner, mm.
            high: (3,) highest corner, mm.
            step_mm: side of a voxel, mm.
        """
        shape = np.ceil((np.asarray(high) - low) / step_mm).astype(int) + 1
        shift = step_mm * np.array([0.0713, 0.0389, 0.0])
        return VoxelBox(np.asarray(low) - shift, (int(shape[0]), int(shape[1]), int(shape[2])), step_mm)

    def axis(self, k: int) -> np.ndarray:
        """Coordinates of the centres along one axis, mm."""
        return self.low[k] + self.step_mm * np.arange(self.shape[k])


def inside(mesh: trimesh.Trimesh, box: VoxelBox) -> np.ndarray:
    """Voxels whose centre lies in a closed mesh: (nx, ny, nz) bool, from the crossings of rays along z.

    Each triangle marks the vertical rays through its projection; the signs of its normals sum up to inside or outside.
    """
    corners = (mesh.triangles - box.low) / box.step_mm  # (m, 3, 3) in voxels
    first = np.maximum(np.ceil(corners[..., :2].min(axis=1)), 0).astype(np.int64)
    last = np.minimum(np.floor(corners[..., :2].max(axis=1)), np.array(box.shape[:2]) - 1).astype(np.int64)
    spans = np.maximum(last - first + 1, 0)
    count = spans[:, 0] * spans[:, 1]
    owner = np.repeat(np.arange(len(count)), count)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    ray = first[owner] + np.column_stack([rank // spans[owner, 1], rank % spans[owner, 1]])  # (rays, 2)
    a, b, c = (corners[:, k] for k in range(3))
    area = _cross(b - a, c - a)  # twice the signed area of the projection
    to_a, to_b, to_c = (corner[owner, :2] - ray for corner in (a, b, c))
    weights = [_cross(q, r) for q, r in ((to_b, to_c), (to_c, to_a), (to_a, to_b))]
    turn = np.sign(area)[owner]
    hit = (turn != 0) & np.logical_and.reduce([weight * turn > 0 for weight in weights])
    owner, ray, turn = owner[hit], ray[hit], turn[hit]
    height = sum(w[hit] * corner[owner, 2] for w, corner in zip(weights, (a, b, c), strict=True)) / area[owner]
    above = np.clip(np.ceil(height), 0, box.shape[2]).astype(np.int64)  # first voxel above the crossing
    columns = (ray[:, 0] * box.shape[1] + ray[:, 1]) * (box.shape[2] + 1) + above
    size = box.shape[0] * box.shape[1] * (box.shape[2] + 1)
    steps = np.bincount(columns[turn < 0], minlength=size).astype(np.int8)
    steps -= np.bincount(columns[turn > 0], minlength=size).astype(np.int8)
    return np.cumsum(steps.reshape(*box.shape[:2], -1), axis=2, dtype=np.int8)[..., :-1] > 0


def within(solid: np.ndarray, radius: float) -> np.ndarray:
    """Voxels closer than ``radius`` (in voxels) to a solid voxel's centre; exact, computed axis by axis.

    Args:
        solid: (nx, ny, nz) bool.
        radius: distance in voxels, at most 15, so that squares fit into a byte.
    """
    reach = int(np.ceil(radius))
    far = np.uint8(min(255, reach**2 + 1))
    square = np.where(solid, np.uint8(0), far)
    for axis in range(3):
        nearest = square.copy()
        for shift in range(1, reach + 1):
            step = np.uint8(shift**2)
            moved = np.minimum(square, far - step)
            moved += step
            for sign in (1, -1):
                to, source = [slice(None)] * 3, [slice(None)] * 3
                to[axis], source[axis] = (slice(shift, None), slice(None, -shift))[::sign]
                np.minimum(nearest[tuple(to)], moved[tuple(source)], out=nearest[tuple(to)])
        square = nearest
    return square < radius**2


def _cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
