"""Compiled fits of few numbers to the motions of some two hundred dots, of every picture.

In numpy their small steps cost twenty times what they compute.
"""

# mypy: ignore-errors
from __future__ import annotations

import numba
import numpy as np

from sensing.compiled import HELPER, SHORT

ROUNDS = 3  # of fitting, each without the dots that the last one left farthest
TRIM = 2.5  # medians of what a fit leaves; dots beyond are left out of the next
LEAST = 3  # dots that a fit keeps


@numba.njit(**HELPER)
def _third_largest(values, count):
    first = second = third = 0.0
    for i in range(count):
        value = values[i]
        if value > first:
            first, second, third = value, first, second
        elif value > second:
            second, third = value, second
        elif value > third:
            third = value
    return third


@numba.njit(**SHORT)
def similarity(before, after, lost, centre_x, centre_y):
    """The similarity that takes most dots to where they are, robust by rounds of trimming.

    Complex numbers: after = a before + b with positions from the centre, a = scale exp(i turn); least squares.

    Args:
        before, after: (N, 2) float64, px.
        lost: (N,) bool, left out.
        centre_x, centre_y: of the picture, px.

    Returns:
        Shift at the picture's centre, x and y, px; turn, rad; scale; third largest length that the fit leaves, px.
    """
    count = 0
    for i in range(len(lost)):
        count += not lost[i]
    z, w, left = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    count = 0
    for i in range(len(lost)):
        if not lost[i]:
            z[count, 0], z[count, 1] = before[i, 0] - centre_x, before[i, 1] - centre_y
            w[count, 0], w[count, 1] = after[i, 0] - centre_x, after[i, 1] - centre_y
            count += 1
    shift_x = shift_y = a_x = a_y = 0.0
    limit = 0.0
    for attempt in range(ROUNDS):
        kept, z_x, z_y, w_x, w_y = 0, 0.0, 0.0, 0.0, 0.0
        for i in range(count):
            if attempt == 0 or left[i] <= limit:
                kept += 1
                z_x, z_y, w_x, w_y = z_x + z[i, 0], z_y + z[i, 1], w_x + w[i, 0], w_y + w[i, 1]
        if kept < LEAST:
            break
        z_x, z_y, w_x, w_y = z_x / kept, z_y / kept, w_x / kept, w_y / kept
        along = across = spread = 0.0
        for i in range(count):
            if attempt == 0 or left[i] <= limit:
                x, y, u, v = z[i, 0] - z_x, z[i, 1] - z_y, w[i, 0] - w_x, w[i, 1] - w_y
                along, across, spread = along + x * u + y * v, across + x * v - y * u, spread + x * x + y * y
        a_x, a_y = along / max(spread, 1e-9), across / max(spread, 1e-9)
        shift_x, shift_y = w_x - a_x * z_x + a_y * z_y, w_y - a_x * z_y - a_y * z_x
        for i in range(count):
            x = w[i, 0] - a_x * z[i, 0] + a_y * z[i, 1] - shift_x
            y = w[i, 1] - a_x * z[i, 1] - a_y * z[i, 0] - shift_y
            left[i] = np.sqrt(x * x + y * y)
        limit = max(TRIM * np.median(left), 1e-9)
    return shift_x, shift_y, np.arctan2(a_y, a_x), np.sqrt(a_x * a_x + a_y * a_y), _third_largest(left, count)


@numba.njit(**SHORT)
def fitted_change(moved, modes, used, before):
    """Least squares of three numbers to the motions of dots: moved = modes change.

    Args:
        moved: (n, 2) float64, px.
        modes: (n, 2, 3) float64.
        used: (n,) bool.
        before: (3,) float64, another change.

    Returns:
        The change (3,), and third largest lengths, px: of what it leaves, of what ``before`` leaves, of the motions.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for i in range(len(used)):
        if used[i]:
            for k in range(2):
                for row in range(3):
                    right[row] += modes[i, k, row] * moved[i, k]
                    for column in range(row, 3):
                        normal[row, column] += modes[i, k, row] * modes[i, k, column]
    a, b, c, d, e, f = normal[0, 0], normal[0, 1], normal[0, 2], normal[1, 1], normal[1, 2], normal[2, 2]
    # Cramer's rule: the axis is a sixth as sensitive as the sides, so this is well posed.
    aa, ab, ac, bb, bc, cc = d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b
    size = a * aa + b * ab + c * ac
    change = np.empty(3)
    change[0] = (aa * right[0] + ab * right[1] + ac * right[2]) / size
    change[1] = (ab * right[0] + bb * right[1] + bc * right[2]) / size
    change[2] = (ac * right[0] + bc * right[1] + cc * right[2]) / size
    left, news, most, count = np.empty(len(used)), np.empty(len(used)), np.empty(len(used)), 0
    for i in range(len(used)):
        if used[i]:
            x, y = moved[i, 0], moved[i, 1]
            u = x - modes[i, 0, 0] * change[0] - modes[i, 0, 1] * change[1] - modes[i, 0, 2] * change[2]
            v = y - modes[i, 1, 0] * change[0] - modes[i, 1, 1] * change[1] - modes[i, 1, 2] * change[2]
            p = x - modes[i, 0, 0] * before[0] - modes[i, 0, 1] * before[1] - modes[i, 0, 2] * before[2]
            q = y - modes[i, 1, 0] * before[0] - modes[i, 1, 1] * before[1] - modes[i, 1, 2] * before[2]
            left[count], news[count], most[count] = np.hypot(u, v), np.hypot(p, q), np.hypot(x, y)
            count += 1
    return change, _third_largest(left, count), _third_largest(news, count), _third_largest(most, count)
