"""Compiled inner loops of :mod:`sensing.tracking.field.operator` (numba, cached on disk): one pass per matrix, frame.

Units: whatever the displacements have; matrices as in :class:`sensing.tracking.field.operator.FieldOperator`.
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
def add_stretch_residual(cells, stretch_gain, predicted, stretch, least, medians):
    """Adds to ``cells`` the part of the stretch residuals (measured minus predicted) that exceeds their usual scatter.

    A residual r below the limit s, ``medians`` times the median norm but at least ``least``, adds nothing; a larger one
    is shrunk by 1 - s^2 / r^2 (positive-part James-Stein shrinkage: Efron and Morris 1973).

    Args:
        cells: (2, H * W) float32, changed.
        stretch_gain: (2 N, H * W) of the operator.
        predicted, stretch: (N, 2, 2); a dot whose measured stretch is NaN adds nothing and does not enter the median.
        least: least limit of the residual.
        medians: limit over the median residual.
    """
    count, measured = len(stretch), 0
    square, found = np.zeros(count), np.empty(count)
    for i in range(count):
        if not np.isnan(stretch[i, 0, 0]):
            for k in range(2):
                for m in range(2):
                    square[i] += (stretch[i, k, m] - predicted[i, k, m]) ** 2
            found[measured] = square[i]
            measured += 1
    if measured == 0:
        return
    limit = max(least, medians * np.sqrt(np.median(found[:measured]))) ** 2  # lost dots would lower the median
    for i in range(count):
        if square[i] > limit:
            share = 1 - limit / square[i]
            for axis in range(2):
                u, v = stretch[i, 0, axis] - predicted[i, 0, axis], stretch[i, 1, axis] - predicted[i, 1, axis]
                _add(cells, stretch_gain[axis * count + i], np.float32(share * u), np.float32(share * v))


@numba.njit(**HELPER)
def _add(cells, line, u, v):
    right, down = cells[0], cells[1]
    for k in range(line.size):
        right[k] += u * line[k]
        down[k] += v * line[k]


@numba.njit(**SHORT)
def find_inliers(precision, moved, quality, spacing, qualities, limits, fewest, most):
    """(N,) bool, inliers: dots that match the reference and whose leave-one-out residual is within its limit.

    Args:
        precision: (N, N) float64 Q of :class:`sensing.tracking.field.operator.FieldOperator`.
        moved: (N, 2) float64 displacements; the rows of outliers are overwritten by the prediction from the inliers.
        quality: (N,) float64 correlation with the reference; clipped to 1, and set to 0 for rejected dots.
        spacing: (N,) float64 distance to the nearest other dot, in the unit of the displacements.
        qualities: correlation under which a dot is lost, and that from which its limit is the larger one.
        limits: largest leave-one-out residual of an inlier over the spacing, at these two correlations.
        fewest: no dot is rejected when fewer than so many are left.
        most: largest number of rejected dots; the worst is rejected first.

    Notes:
        Taking dot i out of a Gaussian model is one step of elimination: Q' = Q - Q[:, i] Q[i, :] / Q_ii. With Q' the
        residual of dot j among the rest is (Q' d)_j / Q'_jj. The rows used for elimination, in reverse order, then
        predict the lost dots: d_i = -sum_k Q'_ik d_k / Q'_ii.
    """
    count = len(quality)
    live, limit = quality > qualities[0], np.empty(count)
    for i in range(count):
        share = min(max((quality[i] - qualities[0]) / max(qualities[1] - qualities[0], 1e-9), 0.0), 1.0)
        limit[i] = (limits[0] + share * (limits[1] - limits[0])) * spacing[i]
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
    """Overwrites the dots of ``order`` (the order of elimination) by the prediction from the dots that remain."""
    for n in range(len(order) - 1, -1, -1):
        i = order[n]
        u, v = _products(rest[i], x, y)
        x[i], y[i] = -u / rest[i, i], -v / rest[i, i]
        moved[i, 0], moved[i, 1] = x[i], y[i]


@numba.njit(**HELPER)
def _eliminate(rest, i, present):
    """Eliminates dot i from ``rest``: its row stays as it was, its column becomes zero in the rows that remain."""
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
def _worst(rest, x, y, present, limit):
    """(dot, residual over limit) of the dot whose leave-one-out residual is largest relative to its limit."""
    worst, largest = 0, 0.0
    for i in range(len(present)):
        if present[i]:
            u, v = _products(rest[i], x, y)
            excess = np.sqrt(u * u + v * v) / (rest[i, i] * limit[i])
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
