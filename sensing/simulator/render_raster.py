"""Rasteriser: which point of the surface each pixel sees, with a depth test, so folds hide what is behind them.

Triangles are drawn straight between their projected corners; what the fisheye bends in between is part of the mesh
error measured in bench/bench_render.py (0.01 px at the default mesh). One core, compiled by numba.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
CHANNELS = 5  # known to the compiler, which halves the time of the inner loop
SLACK = 1e-9  # barycentric: a pixel on a shared edge belongs to both triangles, never to none


@numba.njit(cache=True)
def rasterise(
    pixels: NDArray[np.float64], depth: NDArray[np.float64], triangles: NDArray[np.int32], height: int, width: int
) -> tuple[NDArray[np.int32], Floats, Floats]:
    """The nearest triangle of each pixel.

    Args:
        pixels: (n, 2) projected vertices, ``nan`` where unseen (their triangles are dropped).
        depth: (n,) distance from the pupil.
        triangles: (m, 3) vertex numbers.
        height: rows of the result.
        width: columns of the result.

    Returns:
        Triangle number (h, w), -1 where nothing is seen; barycentric weights (h, w, 2) of its second and third corner;
        depth (h, w), ``inf`` where nothing is seen.
    """
    owner = np.full((height, width), -1, np.int32)
    weights = np.zeros((height, width, 2), np.float32)
    nearest = np.full((height, width), np.inf, np.float32)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, bx, by, cx, cy = pixels[i, 0], pixels[i, 1], pixels[j, 0], pixels[j, 1], pixels[k, 0], pixels[k, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > 1e-12:  # also true for nan
            continue
        left, right = max(0, int(np.ceil(min(ax, bx, cx)))), min(width - 1, int(np.floor(max(ax, bx, cx))))
        top, bottom = max(0, int(np.ceil(min(ay, by, cy)))), min(height - 1, int(np.floor(max(ay, by, cy))))
        db, dc = (cy - ay) / area, (ay - by) / area
        for y in range(top, bottom + 1):
            wb = ((left - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
            wc = ((y - ay) * (bx - ax) - (left - ax) * (by - ay)) / area
            first, last = 0.0, float(right - left)
            for weight, slope in ((1.0 - wb - wc, -db - dc), (wb, db), (wc, dc)):
                if slope > 0:
                    first = max(first, (-SLACK - weight) / slope)
                elif slope < 0:
                    last = min(last, (-SLACK - weight) / slope)
                elif weight < -SLACK:
                    last = -1.0
            for step in range(int(np.ceil(first)), int(np.floor(last)) + 1):
                b, c = wb + step * db, wc + step * dc
                z = np.float32(depth[i] + b * (depth[j] - depth[i]) + c * (depth[k] - depth[i]))
                x = left + step
                if z < nearest[y, x]:
                    nearest[y, x] = z
                    owner[y, x] = t
                    weights[y, x, 0], weights[y, x, 1] = b, c
    return owner, weights, nearest


@numba.njit(cache=True, fastmath=True)
def interpolate(owner: NDArray[np.int32], weights: Floats, values: Floats, triangles: NDArray[np.int32]) -> Floats:
    """Vertex values (n, CHANNELS) at each pixel: (CHANNELS, h, w), 0 where nothing is seen."""
    height, width = owner.shape
    out = np.zeros((CHANNELS, height, width), np.float32)
    for y in range(height):
        for x in range(width):
            t = owner[y, x]
            if t < 0:
                continue
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            b, c = weights[y, x, 0], weights[y, x, 1]
            a = np.float32(1) - b - c
            for channel in range(CHANNELS):
                out[channel, y, x] = a * values[i, channel] + b * values[j, channel] + c * values[k, channel]
    return out
