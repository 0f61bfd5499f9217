"""Compiled loops of :mod:`sensing.live.core.gate`: in numpy, their small calls cost twenty times the arithmetic."""

# mypy: ignore-errors
from __future__ import annotations

import numba
import numpy as np

from sensing.compiled import SHORT


@numba.njit(**SHORT)
def best_tear(reference, position, lost, least_side):
    """The row at which a picture torn in two explains most of the dots' displacements: one mean above, one below.

    Args:
        reference, position: (N, 2) float64, px.
        lost: (N,) bool.
        least_side: dots on either side at least.

    Returns:
        Row of the first dot below, part of the squared displacements that both means explain (0 without enough dots or
        without displacement), and the step of the means there, x and y, px.
    """
    order, count = np.empty(len(lost), np.int64), 0
    for i in range(len(lost)):  # by rows, in which the dots nearly are
        if lost[i]:
            continue
        place = count
        while place > 0 and reference[order[place - 1], 1] > reference[i, 1]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = i
        count += 1
    all_x = all_y = energy = 0.0
    for k in range(count):
        x, y = position[order[k], 0] - reference[order[k], 0], position[order[k], 1] - reference[order[k], 1]
        all_x, all_y, energy = all_x + x, all_y + y, energy + x * x + y * y
    row, most, step_x, step_y = 0.0, 0.0, 0.0, 0.0
    upper_x = upper_y = 0.0
    for above in range(1, count - least_side + 1):
        last = order[above - 1]
        upper_x += position[last, 0] - reference[last, 0]
        upper_y += position[last, 1] - reference[last, 1]
        if above < least_side:
            continue
        lower_x, lower_y, below = all_x - upper_x, all_y - upper_y, count - above
        explained = (upper_x**2 + upper_y**2) / above + (lower_x**2 + lower_y**2) / below
        if below > 0 and explained > most:
            row, most = reference[order[above], 1], explained
            step_x, step_y = abs(lower_x / below - upper_x / above), abs(lower_y / below - upper_y / above)
    return row, most / energy if energy > 0 else 0.0, step_x, step_y


@numba.njit(**SHORT)
def block_means(gray, step, rows, columns):
    """(rows * columns,) float32 means of equal blocks of a picture, minus the mean of all blocks.

    Args:
        gray: (H, W) uint8.
        step: every so many pixels are read, along both axes.
        rows, columns: numbers of blocks.
    """
    height, width = (gray.shape[0] - 1) // step + 1, (gray.shape[1] - 1) // step + 1
    edges = np.array([j * width // columns for j in range(columns + 1)])
    means, total = np.empty(rows * columns, np.float32), 0.0
    sums = np.empty(columns, np.int64)
    for i in range(rows):
        top, bottom = i * height // rows, (i + 1) * height // rows
        sums[:] = 0
        for y in range(top, bottom):
            line = gray[y * step]
            for j in range(columns):
                for x in range(edges[j], edges[j + 1]):
                    sums[j] += line[x * step]
        for j in range(columns):
            mean = sums[j] / max((bottom - top) * (edges[j + 1] - edges[j]), 1)
            means[i * columns + j] = mean
            total += mean
    means -= np.float32(total / means.size)
    return means
