"""Compiled inner loops of :mod:`sensing.patches` and :mod:`sensing.recovery` (numba, cached on disk).

They take plain arrays of fixed types: image uint8; centre, texture, weight, slope, descent, gain, energy float32 as in
:class:`sensing.patches.Patches`; displacement and stretch float64. Units: pixels of the working picture.
"""

# mypy: ignore-errors
from __future__ import annotations

import numba
import numpy as np

SATURATED = 252  # gray levels from here on tell nothing: blob or overexposure
STOP_PX = 0.01  # a step this small ends the iteration
COARSE_PX = 0.15  # once a step is this small the window's stretch is taken into account
BEND_SCORE = 0.7  # a window that fits worse says nothing about its stretch
BEND_AGAIN = 0.08  # a misfit larger than this is measured a second time from the new start
FLAT_STRETCH = 0.01  # less stretch than this is neglected: 0.07 px at the window's edge, none in its middle
GAIN_LEAST = 0.15  # a window with less than this share of the reference's contrast is no dot
_JIT = {"cache": True, "nogil": True, "fastmath": True}


@numba.njit(**_JIT)
def align_windows(
    image, centre, half, texture, weight, slope, descent, shear, gain, energy,
    which, displacement, stretch, iterations, quality,
):  # fmt: skip
    """Align the windows ``which``: overwrites displacement, stretch, quality (correlation; 0 where none is found)."""
    height, width = image.shape
    value = np.empty((2 * half + 1) ** 2, np.float32)
    turn = np.empty(4, np.float32)
    for row in range(which.size):
        i = which[row]
        if energy[i] <= 0:
            continue
        x, y = np.float32(displacement[i, 0]), np.float32(displacement[i, 1])
        a, b = np.float32(1 + stretch[i, 0, 0]), np.float32(stretch[i, 0, 1])
        c, d = np.float32(stretch[i, 1, 0]), np.float32(1 + stretch[i, 1, 1])
        flat = max(abs(a - 1) + abs(b), abs(c) + abs(d - 1)) < FLAT_STRETCH
        coarse = True  # far from the goal the cheap sampling without stretch is good enough
        bends = 2
        score = np.float32(0)
        for step in range(iterations):
            cx, cy = centre[i, 0] + x, centre[i, 1] + y
            if not (-half < cx < width + half and -half < cy < height + half):
                score = np.float32(-2)
                break
            reach = half * max(abs(a) + abs(b), abs(c) + abs(d))
            whole = reach <= cx < width - 1 - reach and reach <= cy < height - 1 - reach
            if whole and (flat or coarse):
                whole = _sample_flat(image, cx, cy, half, value) < SATURATED
            elif whole:
                whole = _sample_stretched(image, cx, cy, a, b, c, d, half, value) < SATURATED
            strength = np.float32(0)
            if whole:
                sx, sy, strength, score = _plain_step(value, texture[i], weight[i], descent[i], gain[i], energy[i])
            else:
                _sample_masked(image, cx, cy, a, b, c, d, half, value)
                sx, sy, score = _masked_step(value, texture[i], weight[i], slope[i])
            if score < -1:  # no contrast at all: further steps are meaningless
                break
            longest = max(abs(sx), abs(sy))
            if longest > 3:
                sx, sy = sx * 3 / longest, sy * 3 / longest
            x -= a * sx + b * sy
            y -= c * sx + d * sy
            settled = flat or not coarse or not whole
            coarse = coarse and longest > COARSE_PX
            if longest < COARSE_PX and settled and whole and bends > 0 and score > BEND_SCORE:
                bends -= 1
                misfit = _stretch_misfit(value, shear[i], strength, turn)
                a, b, c, d = (
                    a - a * turn[0] - b * turn[2], b - a * turn[1] - b * turn[3],
                    c - c * turn[0] - d * turn[2], d - c * turn[1] - d * turn[3],
                )  # fmt: skip
                if misfit > BEND_AGAIN and step < iterations - 2:
                    flat = False
                    continue
                bends = 0
            if longest < STOP_PX and settled:
                break
        if score >= -1:
            quality[i] = score
            displacement[i, 0], displacement[i, 1] = x, y
            stretch[i, 0, 0], stretch[i, 0, 1], stretch[i, 1, 0], stretch[i, 1, 1] = a - 1, b, c, d - 1


@numba.njit(**_JIT)
def _stretch_misfit(value, shear, strength, turn):
    """Fills ``turn`` with the 2 x 2 misfit of the window's stretch (clipped); returns its largest entry."""
    largest = np.float32(0)
    for m in range(4):
        total = np.float32(0)
        for k in range(value.size):
            total += shear[m, k] * value[k]
        turn[m] = min(max(total / strength, np.float32(-0.3)), np.float32(0.3))
        largest = max(largest, abs(turn[m]))
    return largest


@numba.njit(**_JIT)
def _sample_flat(image, cx, cy, half, value):
    """Bilinear window without stretch into ``value``: the same four weights everywhere. Returns the brightest."""
    side = 2 * half + 1
    x0, y0 = int(cx) - half, int(cy) - half
    fx, fy = np.float32(cx - int(cx)), np.float32(cy - int(cy))
    one = np.float32(1)
    p, q, r, s = (one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy
    brightest = np.float32(0)
    for j in range(side):
        upper = image[y0 + j, x0 : x0 + side + 1]
        lower = image[y0 + j + 1, x0 : x0 + side + 1]
        line = value[j * side : (j + 1) * side]
        for k in range(side):
            v = (
                p * np.float32(upper[k]) + q * np.float32(upper[k + 1])
                + r * np.float32(lower[k]) + s * np.float32(lower[k + 1])
            )  # fmt: skip
            line[k] = v
            brightest = max(brightest, v)
    return brightest


@numba.njit(**_JIT)
def _sample_stretched(image, cx, cy, a, b, c, d, half, value):
    """Bilinear window with stretch into ``value``; the caller knows that it lies inside. Returns the brightest."""
    k = 0
    brightest = np.float32(0)
    for j in range(-half, half + 1):
        px, py = cx + b * j - a * half, cy + d * j - c * half
        for _ in range(2 * half + 1):
            x0, y0 = np.uint32(px), np.uint32(py)
            fx, fy = px - np.float32(x0), py - np.float32(y0)
            p, q = np.float32(image[y0, x0]), np.float32(image[y0, x0 + np.uint32(1)])
            y1 = y0 + np.uint32(1)
            r, s = np.float32(image[y1, x0]), np.float32(image[y1, x0 + np.uint32(1)])
            top = p + fx * (q - p)
            v = top + fy * (r + fx * (s - r) - top)
            value[k] = v
            brightest = max(brightest, v)
            k += 1
            px += a
            py += c
    return brightest


@numba.njit(**_JIT)
def _sample_masked(image, cx, cy, a, b, c, d, half, value):
    """Bilinear window with stretch into ``value``; pixels beyond the frame or saturated become -1."""
    height, width = image.shape
    k = 0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            px, py = cx + a * i + b * j, cy + c * i + d * j
            value[k] = -1
            if 0 <= px < width - 1 and 0 <= py < height - 1:
                x0, y0 = int(px), int(py)
                fx, fy = px - x0, py - y0
                p, q = np.float32(image[y0, x0]), np.float32(image[y0, x0 + 1])
                r, s = np.float32(image[y0 + 1, x0]), np.float32(image[y0 + 1, x0 + 1])
                top = p + fx * (q - p)
                v = top + fy * (r + fx * (s - r) - top)
                if v < SATURATED:
                    value[k] = v
            k += 1


@numba.njit(**_JIT)
def _plain_step(value, texture, weight, descent, gain, energy):
    """(step x, step y, gain, correlation) of a window that is whole; correlation -2 if there is no contrast."""
    sx = sy = g = mean = square = cross = np.float32(0)
    for k in range(value.size):
        v = value[k]
        wv = weight[k] * v
        sx += descent[0, k] * v
        sy += descent[1, k] * v
        g += gain[k] * v
        mean += wv
        square += wv * v
        cross += wv * texture[k]
    if g < GAIN_LEAST:
        return np.float32(0), np.float32(0), g, np.float32(-2)
    return sx / g, sy / g, g, cross / np.sqrt(max(square - mean * mean, np.float32(1e-3)) * energy)


@numba.njit(**_JIT)
def _masked_step(value, texture, weight, slope):
    """The same by normal equations over the pixels that can be seen: columns T_x, T_y, T, 1."""
    normal = np.zeros((4, 5))
    seen = 0.0
    for k in range(value.size):
        if value[k] < 0 or weight[k] <= 0:
            continue
        w = weight[k]
        seen += w
        row = (slope[k, 0], slope[k, 1], texture[k], np.float32(1), value[k])
        for m in range(4):
            for n in range(m, 5):
                normal[m, n] += w * row[m] * row[n]
    if seen < 0.4:
        return np.float32(0), np.float32(0), np.float32(-2)
    spread_t = normal[2, 2] - normal[2, 3] ** 2 / seen
    cross = normal[2, 4] - normal[2, 3] * normal[3, 4] / seen
    square = 0.0
    for k in range(value.size):
        if value[k] >= 0 and weight[k] > 0:
            square += weight[k] * value[k] * value[k]
    spread_i = square - normal[3, 4] ** 2 / seen
    if spread_t < 1.0 or spread_i < 1e-3:
        return np.float32(0), np.float32(0), np.float32(-2)
    score = cross / np.sqrt(spread_t * spread_i)
    for m in range(4):
        for n in range(m):
            normal[m, n] = normal[n, m]
        normal[m, m] += 1e-4 * (1 + normal[m, m])
    for m in range(4):
        for n in range(m + 1, 4):
            factor = normal[n, m] / normal[m, m]
            for o in range(m, 5):
                normal[n, o] -= factor * normal[m, o]
    answer = np.zeros(4)
    for m in range(3, -1, -1):
        total = normal[m, 4]
        for n in range(m + 1, 4):
            total -= normal[m, n] * answer[n]
        answer[m] = total / normal[m, m]
    if answer[2] < GAIN_LEAST:
        return np.float32(0), np.float32(0), np.float32(-2)
    return np.float32(answer[0] / answer[2]), np.float32(answer[1] / answer[2]), np.float32(score)


@numba.njit(**_JIT)
def correlation_map(image, centre, half, texture, weight, energy, which, reach, stride):
    """(len(which), n, n) correlation of windows at whole-pixel displacements -reach..reach in steps of ``stride``.

    Every second pixel of the window is used; a displacement whose window leaves the frame scores 0.
    """
    height, width = image.shape
    count = 2 * (reach // stride) + 1
    size = 2 * half + 1
    result = np.zeros((which.size, count, count), np.float32)
    for row in range(which.size):
        i = which[row]
        if energy[i] <= 0:
            continue
        for iy in range(count):
            for ix in range(count):
                x0 = int(centre[i, 0]) + (ix - count // 2) * stride
                y0 = int(centre[i, 1]) + (iy - count // 2) * stride
                total = mean = square = cross = texture_mean = texture_square = np.float32(0)
                for j in range(0, size, 2):
                    y = y0 + j - half
                    if y < 0 or y >= height:
                        continue
                    for k in range(0, size, 2):
                        x = x0 + k - half
                        if x < 0 or x >= width:
                            continue
                        w = weight[i, j * size + k]
                        t = texture[i, j * size + k]
                        v = np.float32(image[y, x])
                        total += w
                        mean += w * v
                        square += w * v * v
                        cross += w * v * t
                        texture_mean += w * t
                        texture_square += w * t * t
                if total > 0.12:  # of about 0.25: at least half the window is seen
                    spread = square - mean * mean / total
                    spread_t = texture_square - texture_mean * texture_mean / total
                    if spread > 0.2 and spread_t > 0.2:
                        result[row, iy, ix] = (cross - mean * texture_mean / total) / np.sqrt(spread * spread_t)
    return result
