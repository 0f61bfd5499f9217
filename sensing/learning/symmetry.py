"""The eight symmetries of the square, which the endcap has about its axis: rotated and mirrored fields and wrenches.

A camera on the axis sees a contact turned by 90 degrees as the field turned by 90 degrees; a mirror image of a contact
gives a mirrored field. Image x and y run along the endcap's x and y. Force is a vector; torque is a pseudo-vector, so a
mirror M takes it to det(M) M t.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError

COUNT = 8  # number of symmetries
REACH = 1.05  # of half a side; the corners lie beyond it, where no dot is and a field is extrapolated


def plane_map(number: int) -> NDArray[np.float64]:
    """(2, 2) matrix of a symmetry 0..7: number % 4 quarter turns (x to y), from 4 on after the mirror x to -x."""
    turn = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), number % 4)
    return turn @ np.diag([-1.0, 1.0]) if number >= 4 else turn


def disc_cells(shape: tuple[int, int]) -> NDArray[np.bool_]:
    """(H, W) whether the cell's centre lies in the disc that dots cover."""
    rows, columns = ((np.arange(count) + 0.5) * 2 / count - 1 for count in shape)
    return np.hypot(rows[:, None], columns[None]) <= REACH


def moved_wrenches(wrenches: NDArray[np.float64], number: int) -> NDArray[np.float64]:
    """(N, 6) wrenches about a point on the axis, transformed by a symmetry."""
    M = np.eye(3)
    M[:2, :2] = plane_map(number)
    torque = M * np.linalg.det(M)
    return np.concatenate([wrenches[:, :3] @ M.T, wrenches[:, 3:] @ torque.T], axis=1)


def moved_inputs(inputs: NDArray[np.float64], number: int, side: int) -> NDArray[np.float64]:
    """(N, 2 side side) fields of a square grid, transformed by a symmetry.

    Args:
        inputs: (N, 2 side side) fields.
        number: number of the symmetry, 0..7 (:func:`plane_map`).
        side: number of cells along a side of the grid.
    """
    order, sign = _permutation(number, side)
    return inputs[:, order] * sign


def symmetric_moments(
    inputs: NDArray[np.float64], wrenches: NDArray[np.float64], side: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """X'X (D, D) and X'Y (D, 6) summed over all eight copies of the samples, from those of the samples alone.

    Args:
        inputs: X (N, D), D = 2 side side.
        wrenches: Y (N, 6), N and N m.
        side: number of cells along a side of the grid.
    """
    moment, totals = inputs.T @ wrenches, np.zeros((inputs.shape[1], 6))
    for number in range(COUNT):
        order, sign = _permutation(number, side)
        totals += moved_wrenches(moment[order] * sign[:, None], number)
    return symmetric_gram(inputs.T @ inputs, side), totals


def symmetric_gram(gram: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """(D, D) sum over all eight copies of samples, from the X'X (D, D) of the samples alone.

    Args:
        gram: X'X of fields X (D = 2 side side).
        side: number of cells along a side of the square grid.
    """
    total = np.zeros_like(gram)
    for number in range(COUNT):
        order, sign = _permutation(number, side)
        total += gram[np.ix_(order, order)] * (sign[:, None] * sign)
    return total


def symmetric_cell_moments(moment: NDArray[np.float64], side: int) -> NDArray[np.float64]:
    """(D, C) sum over all eight copies of samples of X'Y, Y a number in every cell, from that of the samples alone.

    Args:
        moment: X'Y of fields X (N, D = 2 C) and cells Y (N, C = side side).
        side: number of cells along a side of the grid.
    """
    total = np.zeros_like(moment)
    for number in range(COUNT):
        order, sign = _permutation(number, side)
        total += moment[np.ix_(order, order[: side * side] % (side * side))] * sign[:, None]
    return total


@lru_cache(maxsize=64)
def _permutation(number: int, side: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Place and sign of every input after the symmetry M: the vector at M p is M times the vector at p."""
    if side < 1:
        raise ParameterError(f"side={side}: give a square field", name="side", value=side)
    M = plane_map(number)
    rows, columns = np.mgrid[0:side, 0:side]
    centred = np.stack([columns, rows], axis=-1) - (side - 1) / 2
    source = centred @ M + (side - 1) / 2  # p = M^-1 p' = M^T p'
    cell = np.rint(source).astype(int)
    flat = (cell[..., 1] * side + cell[..., 0]).ravel()
    order, sign = [], []
    for axis in range(2):  # new component `axis` is the old one that M maps to it
        old = int(np.abs(M[axis]).argmax())
        order.append(flat + old * side * side)
        sign.append(np.full(side * side, M[axis, old]))
    return np.concatenate(order), np.concatenate(sign)
