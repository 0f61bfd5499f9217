"""Rasteriser: which point of the surface each pixel sees, with a depth test, so folds hide what is behind them.

Triangles are drawn straight between their projected corners; the fisheye bends them by less than 0.05 px at the default
mesh (bench/bench_render.py). One core, compiled by numba.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]


@numba.njit(cache=True)
def rasterise(
    pixels: NDArray[np.float64],
    depth: NDArray[np.float64],
    values: Floats,
    triangles: NDArray[np.int32],
    height: int,
    width: int,
) -> tuple[Floats, Floats]:
    """Interpolate vertex values over the triangles that are nearest in each pixel.

    Args:
        pixels: (n, 2) projected vertices, ``nan`` where unseen (their triangles are dropped).
        depth: (n,) distance from the pupil.
        values: (n, c) what to interpolate.
        triangles: (m, 3) vertex numbers.
        height: rows of the result.
        width: columns of the result.

    Returns:
        Values ``(c, height, width)`` and depth ``(height, width)``; 0 and ``inf`` where nothing is seen.
    """
    channels = values.shape[1]
    image = np.zeros((channels, height, width), np.float32)
    nearest = np.full((height, width), np.inf, np.float32)
    for t in range(triangles.shape[0]):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, bx, by, cx, cy = pixels[i, 0], pixels[i, 1], pixels[j, 0], pixels[j, 1], pixels[k, 0], pixels[k, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > 1e-12:
            continue
        left, right = max(0, int(np.ceil(min(ax, bx, cx)))), min(width - 1, int(np.floor(max(ax, bx, cx))))
        top, bottom = max(0, int(np.ceil(min(ay, by, cy)))), min(height - 1, int(np.floor(max(ay, by, cy))))
        inverse = 1.0 / area
        db = (cy - ay) * inverse
        dc = -(by - ay) * inverse
        for y in range(top, bottom + 1):
            wb = ((left - ax) * (cy - ay) - (y - ay) * (cx - ax)) * inverse
            wc = ((y - ay) * (bx - ax) - (left - ax) * (by - ay)) * inverse
            for x in range(left, right + 1):
                wa = 1.0 - wb - wc
                if wa >= -1e-9 and wb >= -1e-9 and wc >= -1e-9:
                    z = np.float32(wa * depth[i] + wb * depth[j] + wc * depth[k])
                    if z < nearest[y, x]:
                        nearest[y, x] = z
                        fa, fb, fc = np.float32(wa), np.float32(wb), np.float32(wc)
                        for c in range(channels):
                            image[c, y, x] = fa * values[i, c] + fb * values[j, c] + fc * values[k, c]
                elif (wb < 0 and db <= 0) or (wc < 0 and dc <= 0) or (wa < 0 and db + dc >= 0):
                    break  # outside and moving away: nothing more in this row
                wb += db
                wc += dc
    return image, nearest
