"""Closed mesh of a sheet ``-c < distance < c`` sampled on a zone's grid.

Separate marching cubes of +c and of -c give the sheet's two sides (those of |distance| - c would lose a wall thinner
than a cell). On the grid's end faces, the strip between the sides is closed cell by cell on the same corners, so that
the mesh is closed to the bit. Corners are identified by their grid edge, also where the last azimuth meets the first.

Notes:
    Every corner of the mesh has a key: node number times 7, plus axis (0..2) of the edge it lies on at level -c, plus
    3 + axis at level +c, or plus 6 for the node itself (corners of end faces). Corners inside a cell are negative.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import trimesh
from skimage.measure import marching_cubes

from cad.errors import GeometryError
from fab.meshing.mesh import is_closed
from fab.meshing.zone_grid import ZoneGrid

SNAP = 0.03  # of a step: nodes closer to a level are moved away from it, to avoid slivers
_NODE = 6  # last digit of a node's own key, see above
_WHOLE = 2e-3  # marching cubes' float32 node numbers are good to 1e-4; the snap keeps crossings 1e-2 off the nodes
# End faces as (axis across it, node at its first (0) or last (-1) end, the two axes in it, in outward order).
_END_FACES = ((1, 0, 0, 2), (1, -1, 2, 0), (2, 0, 1, 0), (2, -1, 0, 1))


def sheet_mesh(grid: ZoneGrid, distance: np.ndarray, half_wall_mm: float) -> trimesh.Trimesh:
    """Closed mesh of the sheet with outward faces, coordinates rounded to float32 as in an STL.

    Args:
        grid: the nodes.
        distance: (turn, h, shares) signed distance to the sheet's middle surface, mm.
        half_wall_mm: half the sheet's wall c, mm.

    Raises:
        GeometryError: the mesh is not closed.
    """
    snap = SNAP * grid.step_mm
    field = _unambiguous(_snapped(distance.astype(np.float32), half_wall_mm, snap), half_wall_mm, snap)
    field = np.concatenate([field, field[:1]])  # (turn + 1, h, shares)
    keys, places, faces = [], [], []
    for side in (0, 1):
        numbers, corners = _side(field, half_wall_mm, side)
        key = _keys(grid, numbers, side)
        keys.append(key)
        places.append(numbers)
        faces.append(key[corners])
    ends = np.concatenate([_end_face(grid, field, half_wall_mm, *end) for end in _END_FACES])
    nodes = np.unique(ends[ends % 7 == _NODE])
    keys.append(nodes)
    places.append(np.column_stack(np.unravel_index(nodes // 7, grid.shape)).astype(np.float64))
    return _assembled(grid, np.concatenate(keys), np.concatenate(places), np.concatenate([*faces, ends]))


def _snapped(field: np.ndarray, half_wall: float, snap: float) -> np.ndarray:
    for level in (-half_wall, half_wall):
        gap = field - np.float32(level)
        moved = np.float32(level) + np.where(gap < 0, -np.float32(snap), np.float32(snap))
        field = np.where(np.abs(gap) < snap, moved, field)
    return field


def _unambiguous(field: np.ndarray, half_wall: float, snap: float) -> np.ndarray:
    """Field without ambiguous end-face cells (corners alternate about a level): the nearest corner changes sides."""
    field = field.copy()
    for _ in range(8):
        clean = True
        for axis, end, *_ in _END_FACES:
            face = np.moveaxis(field, axis, 0)[end]  # a view: (turn, n)
            for level in (np.float32(-half_wall), np.float32(half_wall)):
                clean &= _settle(face, level, np.float32(snap))
        if clean:
            return field
    raise GeometryError("the gyroid's ends stay ambiguous on this grid: use a finer step_mm")


def _settle(face: np.ndarray, level: np.float32, snap: np.float32) -> bool:
    """Remove ambiguous cells for one level on one end face, in place; True if there were none."""
    turn = face.shape[0]
    rows, columns = np.meshgrid(np.arange(turn), np.arange(face.shape[1] - 1), indexing="ij")
    rows = np.stack([rows, (rows + 1) % turn, (rows + 1) % turn, rows], axis=-1)
    columns = np.stack([columns, columns, columns + 1, columns + 1], axis=-1)
    gap = face[rows, columns] - level
    below = gap < 0
    bad = (below[..., 0] == below[..., 2]) & (below[..., 1] == below[..., 3]) & (below[..., 0] != below[..., 1])
    if not bad.any():
        return True
    pick = np.abs(gap[bad]).argmin(axis=1)[:, None]
    row, column = (np.take_along_axis(index[bad], pick, axis=1)[:, 0] for index in (rows, columns))
    face[row, column] = level + np.where(face[row, column] < level, snap, -snap)
    return False


def _side(field: np.ndarray, half_wall: float, side: int) -> tuple[np.ndarray, np.ndarray]:
    """One side of the sheet: fractional node numbers (n, 3) of its corners, and outward faces."""
    level = half_wall if side else -half_wall
    numbers, corners, _, _ = marching_cubes(field, level, gradient_direction="descent" if side else "ascent")
    return numbers.astype(np.float64), corners


def _keys(grid: ZoneGrid, numbers: np.ndarray, side: int) -> np.ndarray:
    """Keys of corners by the grid edge on which they lie; corners inside a cell have negative keys."""
    whole = np.abs(numbers - np.round(numbers)) < _WHOLE
    start = np.where(whole, np.round(numbers), np.floor(numbers)).astype(np.int64)
    start[:, 0] %= grid.turn
    key = np.ravel_multi_index(tuple(start.T), grid.shape) * 7 + (~whole).argmax(axis=1) + 3 * side
    inside = np.flatnonzero(whole.sum(axis=1) != 2)
    key[inside] = -1 - side - 2 * np.arange(len(inside))
    return key


def _end_face(
    grid: ZoneGrid, field: np.ndarray, half_wall: float, axis: int, end: int, one: int, two: int
) -> np.ndarray:
    """Triangles (n, 3) of keys that close the sheet on one end face."""
    count = np.array(field.shape)
    first, second = np.meshgrid(np.arange(count[one] - 1), np.arange(count[two] - 1), indexing="ij")
    ring = []  # the cell's boundary, counter-clockwise seen from outside: corner, then crossings of the edge after it
    steps = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))
    for (a, b), (c, d) in pairwise(steps):
        here, there = (_node(axis, end % count[axis], {one: first + i, two: second + j}) for i, j in ((a, b), (c, d)))
        ring += _edge_keys(grid, field, half_wall, here, there, one if a != c else two)
    return _fans(np.stack([column.ravel() for column in ring], axis=-1))


def _node(axis: int, end: int, others: dict[int, np.ndarray]) -> list[np.ndarray]:
    shape = next(iter(others.values())).shape
    return [np.full(shape, end) if k == axis else others[k] for k in range(3)]


def _edge_keys(
    grid: ZoneGrid, field: np.ndarray, half_wall: float, here: list[np.ndarray], there: list[np.ndarray], along: int
) -> list[np.ndarray]:
    """Keys of the corner ``here`` and of the crossings on the edge to ``there``, in order; -1 where there is none."""
    value, after = field[tuple(here)], field[tuple(there)]
    low = [np.minimum(a, b) for a, b in zip(here, there, strict=True)]
    node, edge = (
        np.ravel_multi_index((index[0] % grid.turn, index[1], index[2]), grid.shape) * 7 for index in (here, low)
    )
    corner = np.where(np.abs(value) < half_wall, node + _NODE, -1)
    crossings = [
        np.where((value < level) != (after < level), edge + along + 3 * side, -1)
        for side, level in enumerate((-half_wall, half_wall))
    ]
    rising = value < after
    return [corner, np.where(rising, crossings[0], crossings[1]), np.where(rising, crossings[1], crossings[0])]


def _fans(rings: np.ndarray) -> np.ndarray:
    """Triangulate polygons (n, 12) of keys (-1: empty) as fans, which are valid with at most two corners on an edge."""
    rings = rings[(rings >= 0).sum(axis=1) >= 3]
    order = np.argsort(rings < 0, axis=1, kind="stable")
    rings = np.take_along_axis(rings, order, axis=1)
    fans = [rings[:, [0, k, k + 1]][rings[:, k + 1] >= 0] for k in range(1, rings.shape[1] - 1)]
    return np.concatenate(fans)


def _assembled(grid: ZoneGrid, keys: np.ndarray, places: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    unique, first = np.unique(keys, return_index=True)
    points = grid.at(places[first]).astype(np.float32).astype(np.float64)
    corners = np.searchsorted(unique, faces)
    if (unique[np.minimum(corners, len(unique) - 1)] != faces).any():
        raise GeometryError("the gyroid's end faces miss its sides: use a finer step_mm")
    mesh = trimesh.Trimesh(points, corners, process=False, validate=False)
    if not is_closed(mesh):
        raise GeometryError("the gyroid sheet does not close: use a finer step_mm")
    return mesh
