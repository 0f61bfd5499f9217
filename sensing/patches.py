"""Aligns the windows around the dots with those of the reference: compiled inner loops (numba, cached on disk).

Inverse-compositional Lucas-Kanade (Baker and Matthews 2004, doi:10.1023/B:VISI.0000011205.11775.fd) of a translation,
with the window's brightness modelled as gain * T + offset + ramp in x and y. Because these are projected out of the
gradients beforehand, an iteration is three dot products a window, and neither exposure nor a lamp gradient moves the
answer. The local stretch and turn of the skin enters as a fixed 2 x 2 matrix per window, known from the neighbours.

Units: pixels of the working (reduced) picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

SATURATED = 252  # gray levels from here on tell nothing: blob or overexposure
STOP_PX = 0.01  # a step this small ends the iteration
GAIN_LEAST = 0.15  # a window with less than this share of the reference's contrast is no dot
_JIT = {"cache": True, "nogil": True, "fastmath": True}


@dataclass(frozen=True)
class Patches:
    """Windows of the reference, ready for :func:`align`; pixels beyond the frame have weight 0.

    Attributes:
        centre: (N, 2) whole-pixel centres x, y of the windows.
        half: half width; a window is (2 half + 1) square.
        texture: (N, M) reference gray minus its weighted mean.
        weight: (N, M), sums to 1 per window.
        slope: (N, M, 2) x and y derivatives of the reference.
        descent: (N, M, 2) weighted, projected, so that descent . I / gain is the misalignment.
        gain: (N, M) weighted, projected, so that gain . I is the contrast relative to the reference.
        energy: (N,) weighted variance of the texture.
    """

    centre: NDArray[np.float32]
    half: int
    texture: NDArray[np.float32]
    weight: NDArray[np.float32]
    slope: NDArray[np.float32]
    descent: NDArray[np.float32]
    gain: NDArray[np.float32]
    energy: NDArray[np.float32]


def cut_patches(gray: NDArray[np.uint8], position: NDArray[np.float64], half: int) -> Patches:
    """Windows of a gray picture around positions (N, 2); a window with too little texture gets zero energy."""
    count, side = len(position), 2 * half + 1
    centre = np.rint(position).astype(int)
    offset = np.arange(-half, half + 1)
    dx, dy = (a.ravel().astype(float) for a in np.meshgrid(offset, offset))
    window = np.clip(1.25 - np.hypot(dx, dy) / (half + 0.5), 0, 1) ** 0.5
    smooth = gray.astype(np.float32)
    slope_y, slope_x = np.gradient(np.pad(smooth, half + 1, mode="edge"))
    texture, weight, gain = (np.zeros((count, side * side), np.float32) for _ in range(3))
    slope, descent = (np.zeros((count, side * side, 2), np.float32) for _ in range(2))
    energy = np.zeros(count, np.float32)
    for index, (x, y) in enumerate(centre):
        columns, rows = x + dx.astype(int), y + dy.astype(int)
        inside = (columns >= 0) & (columns < gray.shape[1]) & (rows >= 0) & (rows < gray.shape[0])
        value = smooth[np.clip(rows, 0, gray.shape[0] - 1), np.clip(columns, 0, gray.shape[1] - 1)].astype(float)
        w = window * inside * (value < SATURATED)
        if w.sum() < 0.25 * window.sum():
            continue
        w /= w.sum()
        value -= w @ value
        grad = np.stack([s[rows + half + 1, columns + half + 1] for s in (slope_x, slope_y)], axis=1).astype(float)
        ramps = np.stack([np.ones_like(dx), dx, dy], axis=1)
        energy[index] = w @ value**2
        texture[index], weight[index], slope[index] = value, w, grad
        pure = _project(grad, np.column_stack([ramps, value]), w)
        descent[index] = (w[:, None] * pure) @ np.linalg.pinv(pure.T @ (w[:, None] * pure), rcond=1e-6)
        shade = _project(value[:, None], np.column_stack([ramps, grad]), w)[:, 0]
        gain[index] = w * shade / max(w @ shade**2, 1e-9)
    return Patches(centre.astype(np.float32), half, texture, weight, slope, descent, gain, energy)


def align(
    image: NDArray[np.uint8],
    patches: Patches,
    which: NDArray[np.int64],
    displacement: NDArray[np.float64],
    stretch: NDArray[np.float64],
    iterations: int = 10,
) -> NDArray[np.float64]:
    """Align the windows ``which``; ``displacement`` (N, 2) is the start and is overwritten for these rows.

    Args:
        image: (H, W) uint8.
        patches: reference windows.
        which: rows to treat.
        displacement: (N, 2) pixels.
        stretch: (N, 2, 2) gradient of the displacement at each dot (d displacement_i / d x_j).
        iterations: at most.

    Returns:
        (N,) correlation with the reference, -1..1; rows not treated are 0.
    """
    quality = np.zeros(len(displacement))
    if min(image.shape) >= 3:
        _align(
            image, patches.centre, patches.half, patches.texture, patches.weight, patches.slope, patches.descent,
            patches.gain, patches.energy, which, displacement, stretch, iterations, quality,
        )  # fmt: skip
    return quality


def _project(columns: NDArray, basis: NDArray, weight: NDArray) -> NDArray:
    """Columns minus their weighted least-squares fit by the basis."""
    root = np.sqrt(weight)[:, None]
    return columns - basis @ np.linalg.lstsq(root * basis, root * columns, rcond=1e-9)[0]


@numba.njit(**_JIT)
def _align(  # noqa: PLR0913 (a compiled loop takes plain arrays)
    image, centre, half, texture, weight, slope, descent, gain, energy,
    which, displacement, stretch, iterations, quality,
):  # type: ignore[no-untyped-def]  # fmt: skip
    height, width = image.shape
    size = 2 * half + 1
    value = np.empty(size * size, np.float32)
    for row in range(which.size):
        i = which[row]
        if energy[i] <= 0:
            continue
        x, y = np.float32(displacement[i, 0]), np.float32(displacement[i, 1])
        a, b = np.float32(1 + stretch[i, 0, 0]), np.float32(stretch[i, 0, 1])
        c, d = np.float32(stretch[i, 1, 0]), np.float32(1 + stretch[i, 1, 1])
        reach = half * max(abs(a) + abs(b), abs(c) + abs(d))
        done = False
        for step in range(iterations + 1):
            cx, cy = centre[i, 0] + x, centre[i, 1] + y
            if not (-half < cx < width + half and -half < cy < height + half):
                break
            inside = reach <= cx < width - 1 - reach and reach <= cy < height - 1 - reach
            shares = _sample(image, cx, cy, a, b, c, d, half, inside, value)
            last = step == iterations or done
            if not inside or shares:
                sx, sy, score = _masked_step(value, texture[i], weight[i], slope[i])
            else:
                sx, sy, score = _plain_step(value, texture[i], weight[i], descent[i], gain[i], energy[i], last)
            if last:
                quality[i] = score
                displacement[i, 0], displacement[i, 1] = x, y
                break
            if score < -1.5:  # no contrast at all: further steps are meaningless
                break
            longest = max(abs(sx), abs(sy))
            if longest > 3:
                sx, sy = sx * 3 / longest, sy * 3 / longest
            x -= a * sx + b * sy
            y -= c * sx + d * sy
            done = longest < STOP_PX


@numba.njit(**_JIT)
def _sample(image, cx, cy, a, b, c, d, half, inside, value):  # type: ignore[no-untyped-def]
    """Bilinear window into ``value``; NaN-free: pixels beyond the frame or saturated become -1. Returns if any did."""
    height, width = image.shape
    any_masked = False
    k = 0
    for j in range(-half, half + 1):
        px, py = cx + b * j - a * half, cy + d * j - c * half
        for _ in range(2 * half + 1):
            if inside or (0 <= px < width - 1 and 0 <= py < height - 1):
                x0, y0 = int(px), int(py)
                fx, fy = px - x0, py - y0
                p, q = np.float32(image[y0, x0]), np.float32(image[y0, x0 + 1])
                r, s = np.float32(image[y0 + 1, x0]), np.float32(image[y0 + 1, x0 + 1])
                top = p + fx * (q - p)
                value[k] = top + fy * (r + fx * (s - r) - top)
                if value[k] >= SATURATED:
                    value[k] = -1
                    any_masked = True
            else:
                value[k] = -1
                any_masked = True
            k += 1
            px += a
            py += c
    return any_masked


@numba.njit(**_JIT)
def _plain_step(value, texture, weight, descent, gain, energy, last):  # type: ignore[no-untyped-def]
    """(step x, step y, score) of a window that is whole; the score is the correlation if ``last``, else the gain."""
    sx = sy = g = np.float32(0)
    for k in range(value.size):
        v = value[k]
        sx += descent[k, 0] * v
        sy += descent[k, 1] * v
        g += gain[k] * v
    if last:
        mean = square = cross = np.float32(0)
        for k in range(value.size):
            wv = weight[k] * value[k]
            mean += wv
            square += wv * value[k]
            cross += wv * texture[k]
        return sx, sy, cross / np.sqrt(max(square - mean * mean, np.float32(1e-3)) * energy)
    if g < GAIN_LEAST:
        return np.float32(0), np.float32(0), np.float32(-2)
    return sx / g, sy / g, g


@numba.njit(**_JIT)
def _masked_step(value, texture, weight, slope):  # type: ignore[no-untyped-def]
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
def correlation_map(image, centre, half, texture, weight, energy, which, reach, stride):  # type: ignore[no-untyped-def]
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
