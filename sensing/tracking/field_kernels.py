"""Compiled inner loops of :mod:`sensing.tracking.field_operator` (numba, cached on disk): one pass a matrix and frame.

Units: whatever the displacements have; matrices as in :class:`sensing.tracking.field_operator.FieldOperator`.
"""

# mypy: ignore-errors
from __future__ import annotations

import numba
import numpy as np

from sensing.compiled import HELPER, KEEPS_NAN, SHORT


@numba.njit(**SHORT)
def stretch_at_dots(gradient, moved, limit):
    """(N, 2, 2) d displacement_i / d x_j at the dots, cut to -limit..limit.

    Args:
        gradient: (2 N, N) of the operator.
        moved: (N, 2) displacements.
        limit: largest size of a number.
    """
    count = len(moved)
    x, y = moved[:, 0].copy(), moved[:, 1].copy()
    result = np.empty((count, 2, 2))
    for axis in range(2):
        for i in range(count):
            u, v = _products(gradient[axis * count + i], x, y)
            result[i, 0, axis] = min(max(u, -limit), limit)
            result[i, 1, axis] = min(max(v, -limit), limit)
    return result


@numba.njit(**SHORT)
def cells_of_dots(to_cells, moved):
    """(2, H * W) float32 mean displacement of the cells from displacements (N, 2)."""
    cells = np.zeros((2, to_cells.shape[1]), np.float32)
    for i in range(len(moved)):
        _add(cells, to_cells[i], np.float32(moved[i, 0]), np.float32(moved[i, 1]))
    return cells


@numba.njit(**SHORT | {"fastmath": KEEPS_NAN})
def add_surprise(cells, bend, predicted, stretch, least, scatters):
    """Adds to ``cells`` what the measured stretch says beyond the prediction's usual scatter.

    What is within ``scatters`` times the median contradiction (or ``least``) is shrunk to nothing, smoothly, as James
    and Stein do.

    Args:
        cells: (2, H * W) float32, changed.
        bend: (2 N, H * W) of the operator.
        predicted, stretch: (N, 2, 2); a dot whose measured stretch is NaN says nothing.
        least: least contradiction that counts.
        scatters: or this many times the median one.
    """
    count = len(stretch)
    square = np.zeros(count)
    for i in range(count):
        if not np.isnan(stretch[i, 0, 0]):
            for k in range(2):
                for m in range(2):
                    square[i] += (stretch[i, k, m] - predicted[i, k, m]) ** 2
    usual = max(least, scatters * np.sqrt(np.median(square))) ** 2
    for i in range(count):
        if square[i] > usual:
            share = 1 - usual / square[i]
            for axis in range(2):
                u, v = stretch[i, 0, axis] - predicted[i, 0, axis], stretch[i, 1, axis] - predicted[i, 1, axis]
                _add(cells, bend[axis * count + i], np.float32(share * u), np.float32(share * v))


@numba.njit(**HELPER)
def _add(cells, line, u, v):
    right, down = cells[0], cells[1]
    for k in range(line.size):
        right[k] += u * line[k]
        down[k] += v * line[k]


@numba.njit(**SHORT)
def judge_dots(precision, moved, quality, spacing, sure, trust, fewest, most):
    """Which dots are inliers, (N,) bool: those that match the reference and that the others do not contradict.

    Args:
        precision: (N, N) float64 Q of :class:`sensing.tracking.field_operator.FieldOperator`.
        moved: (N, 2) float64 displacements; the rows of lost dots are overwritten by what the live ones predict.
        quality: (N,) float64 correlation with the reference; cut to 1, and 0 for dots that the others contradict.
        spacing: (N,) float64 distance to the next dot.
        sure: quality under which a dot is lost, and from which it is trusted most.
        trust: leave-one-out residual over the spacing that an inlier may have at these two.
        fewest: stop dropping when so few are left.
        most: drop at most so many, worst first.

    Notes:
        Taking dot i out of a Gaussian model is one step of elimination: Q' = Q - Q[:, i] Q[i, :] / Q_ii. With Q' the
        residual of dot j among the rest is (Q' d)_j / Q'_jj. The rows used for elimination, in reverse order, then
        predict the lost dots: d_i = -sum_k Q'_ik d_k / Q'_ii.
    """
    count = len(quality)
    live, limit = quality > sure[0], np.empty(count)
    for i in range(count):
        share = min(max((quality[i] - sure[0]) / max(sure[1] - sure[0], 1e-9), 0.0), 1.0)
        limit[i] = (trust[0] + share * (trust[1] - trust[0])) * spacing[i]
        quality[i] = min(quality[i], 1.0)
    rest = precision.copy()
    x, y, present = np.where(live, moved[:, 0], 0.0), np.where(live, moved[:, 1], 0.0), np.ones(count, np.bool_)
    order = np.empty(count, np.int64)
    gone = 0
    for i in range(count):
        if not live[i]:
            _eliminate(rest, i, present)
            order[gone] = i
            gone += 1
    for _ in range(most):
        if count - gone < fewest:
            break
        worst, excess = _worst(rest, x, y, present, limit)
        if excess <= 1:
            break
        live[worst], quality[worst] = False, 0.0
        x[worst] = y[worst] = 0.0
        _eliminate(rest, worst, present)
        order[gone] = worst
        gone += 1
    _fill(rest, order[:gone], x, y, moved)
    return live


@numba.njit(**HELPER)
def _fill(rest, order, x, y, moved):
    """Puts the dots of ``order`` (as they were taken out) where those that stayed predict them."""
    for n in range(len(order) - 1, -1, -1):
        i = order[n]
        u, v = _products(rest[i], x, y)
        x[i], y[i] = -u / rest[i, i], -v / rest[i, i]
        moved[i, 0], moved[i, 1] = x[i], y[i]


@numba.njit(**HELPER)
def _eliminate(rest, i, present):
    """Takes dot i out of ``rest``; its row stays as it was, and its column becomes zero in the rows that remain."""
    present[i] = False
    source = rest[i]
    for row in range(len(rest)):
        if present[row]:
            line = rest[row]
            factor = line[i] / source[i]
            for k in range(len(rest)):
                line[k] -= factor * source[k]
            line[i] = 0.0


@numba.njit(**HELPER)
def _worst(rest, x, y, present, trust):
    """(dot, its leave-one-out residual over what is trusted) of the dot that the others contradict most."""
    worst, largest = 0, 0.0
    for i in range(len(present)):
        if present[i]:
            u, v = _products(rest[i], x, y)
            excess = np.sqrt(u * u + v * v) / (rest[i, i] * trust[i])
            if excess > largest:
                worst, largest = i, excess
    return worst, largest


@numba.njit(**HELPER)
def _products(line, x, y):
    u = v = 0.0
    for k in range(len(line)):
        u += line[k] * x[k]
        v += line[k] * y[k]
    return u, v
