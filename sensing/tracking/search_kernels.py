"""Compiled inner loops of :mod:`sensing.tracking.recovery` (numba, cached on disk).

Units: pixels of the working picture.
"""

# mypy: ignore-errors
from __future__ import annotations

import numba
import numpy as np

from sensing.compiled import HELPER, KERNEL
from sensing.tracking.patch_kernels import MARGIN


@numba.njit(**KERNEL)
def correlation_map(image, centre, half, texture, weight, energy, which, reach, stride):
    """(len(which), n, n) correlation of windows at whole-pixel displacements -reach..reach in steps of ``stride``.

    Every second pixel of the window is used; a displacement under which half the window's weight or more is beyond
    the frame scores 0.

    Args:
        image: framed float32 picture of :func:`sensing.tracking.patch_kernels.smoothed`.
        centre: (N, 2) float32 whole-pixel centres.
        half: half width of the windows.
        texture: (N, M) float32, see :class:`sensing.tracking.patches.Patches`.
        weight: (N, M) float32.
        energy: (N,) float32.
        which: rows to search.
        reach: largest displacement.
        stride: step.
    """
    count = 2 * (reach // stride) + 1
    result = np.zeros((which.size, count, count), np.float32)
    side = half + 1  # of the thinned window
    t, w = np.empty(side * side, np.float32), np.empty(side * side, np.float32)
    v = np.empty(side * side, np.float32)
    for row in range(which.size):
        i = which[row]
        if energy[i] <= 0:
            continue
        for j in range(side):
            for k in range(side):
                t[j * side + k] = texture[i, 2 * j * (2 * half + 2) + 2 * k]
                w[j * side + k] = weight[i, 2 * j * (2 * half + 2) + 2 * k]
        for iy in range(count):
            for ix in range(count):
                x0 = int(centre[i, 0]) + (ix - count // 2) * stride - half + MARGIN
                y0 = int(centre[i, 1]) + (iy - count // 2) * stride - half + MARGIN
                _gather(image, x0, y0, side, v)
                result[row, iy, ix] = _correlation(v, t, w)
    return result


@numba.njit(**HELPER)
def _gather(image, x0, y0, side, v):
    """Every second pixel of a window into ``v``; -1 beyond picture and frame (the frame itself is negative)."""
    height, width = image.shape
    whole = x0 >= 0 and x0 + 2 * side - 2 < width
    for j in range(side):
        y = y0 + 2 * j
        goal = v[j * side : (j + 1) * side]
        if whole and 0 <= y < height:
            line = image[y, x0 : x0 + 2 * side - 1]
            for k in range(side):
                goal[k] = line[2 * k]
        else:
            for k in range(side):
                x = x0 + 2 * k
                goal[k] = image[y, x] if 0 <= x < width and 0 <= y < height else np.float32(-1)


@numba.njit(**HELPER)
def _correlation(v, t, w):
    """Weighted correlation of gray levels (negative: unseen) with a texture; 0 where too little is seen or flat."""
    total = mean = square = cross = texture_mean = texture_square = np.float32(0)
    for k in range(v.size):
        a = w[k] if v[k] >= 0 else np.float32(0)
        g = v[k] - np.float32(128)
        total += a
        mean += a * g
        square += a * g * g
        cross += a * g * t[k]
        texture_mean += a * t[k]
        texture_square += a * t[k] * t[k]
    if total < 0.12:  # of about 0.25: less than half the window is seen
        return np.float32(0)
    spread = square - mean * mean / total
    spread_t = texture_square - texture_mean * texture_mean / total
    if spread < 0.2 or spread_t < 0.2:
        return np.float32(0)
    return (cross - mean * texture_mean / total) / np.sqrt(spread * spread_t)


@numba.njit(**KERNEL)
def best_rigid_motion(centre, place, score, picks, agree, shortest, stretch):
    """(3,) turn and shift (about the origin) that most dots have a candidate for; none (zeros) wins ties.

    Args:
        centre: (N, 2) float64 dots at rest.
        place: (N, C, 2) float64 candidate displacements.
        score: (N, C) float64 of the candidates; 0 where there is none.
        picks: (T, 4) int64: two dots and their candidates, for each trial.
        agree: a candidate within this of the motion counts with its score.
        shortest: pairs nearer than this show no turn.
        stretch: pairs whose distance changes by more than this share are no pair.
    """
    best = np.array([0.0, 0.0, 0.0])
    best_votes = 1.05 * _votes(centre, place, score, 1.0, 0.0, 0.0, 0.0, agree)
    for trial in range(len(picks)):
        i, j, a, b = picks[trial]
        if i == j or score[i, a] == 0 or score[j, b] == 0:
            continue
        arm = centre[j] - centre[i]
        new = arm + place[j, b] - place[i, a]
        square = arm[0] ** 2 + arm[1] ** 2
        ratio = np.sqrt((new[0] ** 2 + new[1] ** 2) / max(square, 1e-9))
        if square < shortest**2 or abs(ratio - 1) > stretch:
            continue
        cos = (arm[0] * new[0] + arm[1] * new[1]) / (square * ratio)
        sin = (arm[0] * new[1] - arm[1] * new[0]) / (square * ratio)
        middle = (centre[i] + centre[j]) / 2
        goal = middle + (place[i, a] + place[j, b]) / 2
        x = goal[0] - cos * middle[0] + sin * middle[1]
        y = goal[1] - sin * middle[0] - cos * middle[1]
        votes = _votes(centre, place, score, cos, sin, x, y, agree)
        if votes > best_votes:
            best_votes = votes
            best[0], best[1], best[2] = np.arctan2(sin, cos), x, y
    return best


@numba.njit(**HELPER)
def _votes(centre, place, score, cos, sin, x, y, agree):
    total = 0.0
    for i in range(len(centre)):
        u = cos * centre[i, 0] - sin * centre[i, 1] + x - centre[i, 0]
        v = sin * centre[i, 0] + cos * centre[i, 1] + y - centre[i, 1]
        best = 0.0
        for c in range(place.shape[1]):
            if (place[i, c, 0] - u) ** 2 + (place[i, c, 1] - v) ** 2 < agree**2:
                best = max(best, score[i, c])
        total += best
    return total
