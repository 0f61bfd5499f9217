"""Compiled inner loops of :mod:`sensing.tracking.patches` (numba, cached on disk).

They take plain arrays of fixed types: image float32 with its frame as :func:`smoothed` gives it, the arrays of
:class:`sensing.tracking.patches.Patches`, displacement and stretch float64. A window has 2 half + 1 rows of 2 half + 2
columns (the last has no weight): whole vectors, and flat interpolation becomes one loop over the window without row
ends.
Units: pixels of the working picture.
"""

# mypy: ignore-errors
from __future__ import annotations

import numba
import numpy as np

from sensing.compiled import HELPER, KERNEL

SATURATED = 252  # gray levels from here on say nothing: blob or overexposure
COARSE_PX = 0.15  # once a step is this small the window's stretch is taken into account
BEND_SCORE = 0.7  # least correlation of a window from which its stretch is measured
BEND_AGAIN = 0.08  # a misfit larger than this is measured a second time from the new start
FLAT_STRETCH = 0.01  # less stretch than this is neglected: 0.07 px at the window's edge, none in its middle
GAIN_LEAST = 0.15  # a window with less than this share of the reference's contrast is no dot
LONGEST_STEP = 0.5  # over a window's half width
LEAST_SEEN = 0.4  # share of a window's weight that must lie inside the frame and be unsaturated
NOTHING = -2.0  # correlation of a window without contrast or beyond the frame
MARGIN = 24  # frame round the working picture, so that a window at its edge is sampled like any other
BEYOND = np.float32(-1e9)  # gray level there: any interpolation with it is negative, which means unseen


def framed(height, width):
    """An empty (H + 2 MARGIN, W + 2 MARGIN) float32 picture, framed by :data:`BEYOND`, for :func:`smooth_into`."""
    return np.full((height + 2 * MARGIN, width + 2 * MARGIN), BEYOND, np.float32)


def smoothed(gray):
    """A framed picture of its own from (H, W) uint8; see :func:`smooth_into`."""
    result = framed(*gray.shape)
    smooth_into(gray, result)
    return result


@numba.njit(**KERNEL)
def smooth_into(gray, result):
    """(H, W) uint8 into a framed float32 picture by the binomial 3 x 3 filter.

    Smoothing takes out the detail that bilinear sampling would distort; without it the answer is biased toward whole
    pixels (interpolated against sampled windows).
    """
    height, width = gray.shape
    column = np.empty(width + 2, np.uint16)
    for y in range(height):
        above, here, below = gray[max(y - 1, 0)], gray[y], gray[min(y + 1, height - 1)]
        inner = column[1:-1]
        for x in range(width):
            inner[x] = np.uint16(above[x]) + np.uint16(below[x]) + (np.uint16(here[x]) << np.uint16(1))
        column[0], column[width + 1] = column[1], column[width]
        left, right, line = column[:-2], column[2:], result[y + MARGIN, MARGIN : MARGIN + width]
        for x in range(width):
            total = left[x] + right[x] + (inner[x] << np.uint16(1))
            line[x] = np.float32(total) * np.float32(0.0625)


@numba.njit(**KERNEL)
def align_windows(
    image, centre, half, rows, shear, plain, energy, which, displacement, stretch, iterations, stop_px, quality
):
    """Align the windows ``which``: overwrites displacement, stretch and quality.

    Args:
        image: framed.
        centre, half, rows, shear, plain, energy: of :class:`sensing.tracking.patches.Patches`.
        which: rows of the windows to treat.
        displacement, stretch: (N, 2), px of the working picture, and (N, 2, 2); start and result.
        iterations: at most.
        stop_px: a step this small ends them.
        quality: (N,) zeros; receives the correlation, 0 where none is found.
    """
    side = 2 * half + 2
    raw = np.zeros(side * side + side + 8, np.float32)
    value = np.empty((side - 1) * side, np.float32)
    pose, turn = np.empty(6, np.float32), np.empty(4, np.float32)
    for row in range(which.size):
        i = which[row]
        if energy[i] <= 0:
            continue
        pose[0], pose[1] = displacement[i, 0], displacement[i, 1]
        pose[2], pose[3] = 1 + stretch[i, 0, 0], stretch[i, 0, 1]
        pose[4], pose[5] = stretch[i, 1, 0], 1 + stretch[i, 1, 1]
        score = _align_one(
            image, centre[i], half, rows[i], shear[i], plain[i], energy[i], iterations, stop_px, raw, value, pose, turn
        )
        if score >= -1:
            quality[i] = score
            displacement[i, 0], displacement[i, 1] = pose[0], pose[1]
            stretch[i, 0, 0], stretch[i, 0, 1] = pose[2] - 1, pose[3]
            stretch[i, 1, 0], stretch[i, 1, 1] = pose[4], pose[5] - 1


@numba.njit(**HELPER)
def _align_one(image, centre, half, rows, shear, plain, energy, iterations, stop_px, raw, value, pose, turn):
    """Correlation of one window after alignment; ``pose`` (x, y, a, b, c, d) is start and answer."""
    flat = max(abs(pose[2] - 1) + abs(pose[3]), abs(pose[4]) + abs(pose[5] - 1)) < FLAT_STRETCH
    coarse = True  # far from the goal the cheap sampling without stretch is good enough
    bends = 2
    limit = np.float32(LONGEST_STEP * half)
    score = np.float32(NOTHING)
    for step in range(iterations):
        inside, whole = _sample(image, centre, half, flat or coarse, pose, raw, value)
        if not inside:
            return np.float32(NOTHING)
        strength = np.float32(0)
        if whole:
            sx, sy, strength, score = _plain_step(value, rows, energy)
        else:
            sx, sy, score = _masked_step(value, plain)
        if score < -1:  # no contrast at all: further steps are meaningless
            return score
        longest = max(abs(sx), abs(sy))
        if longest > limit:
            sx, sy = sx * limit / longest, sy * limit / longest
        pose[0] -= pose[2] * sx + pose[3] * sy
        pose[1] -= pose[4] * sx + pose[5] * sy
        settled = flat or not coarse
        coarse = coarse and longest > COARSE_PX
        if longest < COARSE_PX and settled and whole and bends > 0 and score > BEND_SCORE:
            bends -= 1
            if _bend(value, shear, strength, pose, turn) > BEND_AGAIN and step < iterations - 2:
                flat = False
                continue
            bends = 0
        if longest < stop_px and settled:
            break
    return score


@numba.njit(**HELPER)
def _bend(value, shear, strength, pose, turn):
    """Corrects the pose's 2 x 2 matrix by the window's misfit of stretch (clipped); returns its largest entry."""
    largest = np.float32(0)
    for m in range(4):
        total = np.float32(0)
        for k in range(value.size):
            total += shear[m, k] * value[k]
        turn[m] = min(max(total / strength, np.float32(-0.3)), np.float32(0.3))
        largest = max(largest, abs(turn[m]))
    a, b, c, d = pose[2], pose[3], pose[4], pose[5]
    pose[2], pose[3] = a - a * turn[0] - b * turn[2], b - a * turn[1] - b * turn[3]
    pose[4], pose[5] = c - c * turn[0] - d * turn[2], d - c * turn[1] - d * turn[3]
    return largest


@numba.njit(**HELPER)
def _sample(image, centre, half, flat, pose, raw, value):
    """Fills ``value`` with the window; (whether any of it can be in the frame, whether all is and is unsaturated)."""
    height, width = image.shape
    cx, cy = centre[0] + pose[0] + np.float32(MARGIN), centre[1] + pose[1] + np.float32(MARGIN)
    reach = half + np.float32(1)
    if not flat:
        reach *= max(abs(pose[2]) + abs(pose[3]), abs(pose[4]) + abs(pose[5]))
    reach += np.float32(0.01)
    if not (reach <= cx < width - 1 - reach and reach <= cy < height - 1 - reach):
        return False, False
    if flat:
        low, high = _sample_flat(image, cx, cy, half, raw, value)
    else:
        low, high = _sample_stretched(image, cx, cy, half, pose, value)
    return True, low >= 0 and high < SATURATED


@numba.njit(**HELPER)
def _sample_flat(image, cx, cy, half, raw, value):
    """Bilinear window without stretch into ``value``: the same four weights everywhere. Returns least and largest."""
    side = 2 * half + 2
    x0, y0 = int(cx) - half, int(cy) - half
    low = high = np.float32(0)
    for j in range(side):
        line, goal = image[y0 + j, x0 : x0 + side], raw[j * side : (j + 1) * side]
        for k in range(side):
            goal[k] = line[k]
    for k in range(side * side):
        low, high = min(low, raw[k]), max(high, raw[k])
    fx, fy = np.float32(cx - int(cx)), np.float32(cy - int(cy))
    one = np.float32(1)
    p, q, r, s = (one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy
    right, lower, both = raw[1:], raw[side:], raw[side + 1 :]
    for k in range(value.size):
        value[k] = p * raw[k] + q * right[k] + r * lower[k] + s * both[k]
    return low, high


@numba.njit(**HELPER)
def _sample_stretched(image, cx, cy, half, pose, value):
    """Bilinear window with stretch into ``value``; the caller knows that it lies inside. Returns least, largest."""
    a, b, c, d = pose[2], pose[3], pose[4], pose[5]
    pixels, width = image.ravel(), np.uint32(image.shape[1])
    one = np.uint32(1)
    low = high = np.float32(0)
    k = np.uint64(0)
    for j in range(-half, half + 1):
        px, py = cx + b * j - a * half, cy + d * j - c * half
        for i in range(2 * half + 2):
            x, y = px + a * np.float32(i), py + c * np.float32(i)
            x0, y0 = np.uint32(np.int32(x)), np.uint32(np.int32(y))
            fx, fy = x - np.float32(np.int32(x)), y - np.float32(np.int32(y))
            o = y0 * width + x0
            upper, lower = pixels[o], pixels[o + width]
            upper += fx * (pixels[o + one] - upper)
            lower += fx * (pixels[o + width + one] - lower)
            v = upper + fy * (lower - upper)
            value[k] = v
            low, high = min(low, v), max(high, v)
            k += np.uint64(1)
    return low, high


@numba.njit(**HELPER)
def _plain_step(value, rows, energy):
    """(step x, step y, gain, correlation) of a window that is whole; correlation -2 if there is no contrast."""
    sx = sy = g = mean = square = cross = np.float32(0)
    right, down, gain, weight, texture = rows[0], rows[1], rows[2], rows[3], rows[4]
    for k in range(value.size):
        v = value[k]
        wv = weight[k] * v
        sx += right[k] * v
        sy += down[k] * v
        g += gain[k] * v
        mean += wv
        square += wv * v
        cross += texture[k] * v
    if g < GAIN_LEAST:
        return np.float32(0), np.float32(0), g, np.float32(NOTHING)
    return sx / g, sy / g, g, cross / np.sqrt(max(square - mean * mean, np.float32(1e-3)) * energy)


@numba.njit(**HELPER)
def _masked_step(value, plain):
    """(step x, step y, correlation) by least squares over the pixels that can be seen: columns T_x, T_y, T, 1."""
    normal = np.zeros((4, 5))
    square = _masked_sums(value, plain[0], plain[1], plain[2], plain[3], normal)
    seen = normal[3, 3]
    if seen < LEAST_SEEN:
        return np.float32(0), np.float32(0), np.float32(NOTHING)
    spread_t, spread_v = normal[2, 2] - normal[2, 3] ** 2 / seen, square - normal[3, 4] ** 2 / seen
    if spread_t < 1.0 or spread_v < 1e-3:
        return np.float32(0), np.float32(0), np.float32(NOTHING)
    score = (normal[2, 4] - normal[2, 3] * normal[3, 4] / seen) / np.sqrt(spread_t * spread_v)
    x, y, strength = _solve(normal)
    if strength < GAIN_LEAST:
        return np.float32(0), np.float32(0), np.float32(NOTHING)
    return np.float32(x / strength), np.float32(y / strength), np.float32(score)


@numba.njit(**HELPER)
def _masked_sums(value, slope_x, slope_y, texture, weight, normal):
    """Fills the 4 x 5 normal equations; returns the weighted sum of squares of the gray levels (less 128)."""
    xx = xy = xt = x1 = xv = yy = yt = y1 = yv = tt = t1 = tv = seen = v1 = vv = np.float32(0)
    for k in range(value.size):
        w = weight[k] if value[k] >= 0 and value[k] < SATURATED else np.float32(0)
        v = value[k] - np.float32(128)  # single precision likes small numbers
        x, y, t = w * slope_x[k], w * slope_y[k], w * texture[k]
        xx += x * slope_x[k]
        xy += x * slope_y[k]
        xt += x * texture[k]
        x1 += x
        xv += x * v
        yy += y * slope_y[k]
        yt += y * texture[k]
        y1 += y
        yv += y * v
        tt += t * texture[k]
        t1 += t
        tv += t * v
        seen += w
        v1 += w * v
        vv += w * v * v
    normal[0, 0], normal[0, 1], normal[0, 2], normal[0, 3], normal[0, 4] = xx, xy, xt, x1, xv
    normal[1, 0], normal[1, 1], normal[1, 2], normal[1, 3], normal[1, 4] = xy, yy, yt, y1, yv
    normal[2, 0], normal[2, 1], normal[2, 2], normal[2, 3], normal[2, 4] = xt, yt, tt, t1, tv
    normal[3, 0], normal[3, 1], normal[3, 2], normal[3, 3], normal[3, 4] = x1, y1, t1, seen, v1
    return vv


@numba.njit(**HELPER)
def _solve(normal):
    """First three unknowns of a 4 x 4 system with its right side as fifth column, slightly damped."""
    for m in range(4):
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
    return answer[0], answer[1], answer[2]
