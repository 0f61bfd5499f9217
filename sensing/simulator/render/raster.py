"""Rasteriser: the point of the surface that each pixel sees, with a depth test for folds.

Triangles are drawn straight between their projected corners; the fisheye's curvature between them is part of the mesh
error measured in bench/bench_render.py (0.01 px at the default mesh). One core, compiled by numba.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
CHANNELS = 5  # a constant for the compiler, which halves the time of the inner loop
U1, U2, U3, U4, U5, U6, U7 = (np.uint64(n) for n in range(1, 8))  # offsets of channels in a texel and the next one
SLACK = 1e-9  # barycentric: a pixel on a shared edge belongs to both triangles instead of none


@numba.njit(cache=True)
def rasterise(
    pixels: NDArray[np.float64], depth: NDArray[np.float64], triangles: NDArray[np.int32], height: int, width: int
) -> tuple[NDArray[np.int32], Floats, Floats]:
    """The nearest triangle of each pixel.

    Args:
        pixels: (n, 2) projected vertices, ``nan`` where unseen (their triangles are dropped).
        depth: (n,) distance from the pupil.
        triangles: (m, 3) vertex numbers.
        height: number of rows of the result.
        width: number of columns of the result.

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
    """Vertex values at each pixel: (CHANNELS, h, w), 0 where nothing is seen.

    Args:
        owner, weights: triangle (h, w) and barycentric weights (h, w, 2) of each pixel, from :func:`rasterise`.
        values: values at the vertices (n, CHANNELS).
        triangles: (m, 3) vertex numbers.
    """
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


@numba.njit(cache=True, fastmath=True)
def draw(
    owner: NDArray[np.int32],
    seen: Floats,
    cell: int,
    texture: Floats,
    extent: float,
    transmission: Floats,
    weights: Floats,
) -> tuple[Floats, bool]:
    """Light of every pixel of a surface without folds, from attributes known at every ``cell``-th pixel.

    Disc coordinates and light vary slowly, so between the corners of a cell they are interpolated; the texture is
    read at every pixel. Without cells this is :func:`sensing.simulator.render.sensor.radiance_image`.

    Args:
        owner: (gh, gw) triangle at the grid's points (pixel 0, cell, 2 cell, ... one beyond the picture), -1 for none.
        seen: (CHANNELS, gh, gw) disc x, disc y, irradiance, silicone lobe, ink lobe there.
        cell: distance of the grid's points, px.
        texture: (t, t, 4) texture of the skin.
        extent: disc coordinate of the texture's edge.
        transmission: (h, w) transmission of the lens.
        weights: (3, 3) ambient light, silicone gloss and ink gloss, each per colour.

    Returns:
        Light (h, w, 3), and whether the surface ends inside a cell that the lens shows (then the light is not to be
        used).
    """
    height, width = transmission.shape
    flat, texels = texture.ravel(), texture.shape[0]
    scale, offset = np.float32(texels / (2 * extent)), np.float32(texels / 2 - 0.5)
    out = np.zeros((height, width, 3), np.float32)
    for y in range(height):
        gy = y // cell
        low = np.float32(y - gy * cell) / np.float32(cell)
        for gx in range((width + cell - 1) // cell):
            begin, end = gx * cell, min(gx * cell + cell, width)
            if owner[gy, gx] < 0 or owner[gy, gx + 1] < 0 or owner[gy + 1, gx] < 0 or owner[gy + 1, gx + 1] < 0:
                for x in range(begin, end):
                    if transmission[y, x] > np.float32(0):
                        return out, True
                continue
            run, corner = (y, begin, end), (gy, gx, low, np.float32(1.0 / cell))
            _draw_run(out, run, seen, corner, flat, (texels, scale, offset), transmission, weights)
    return out, False


@numba.njit(cache=True, fastmath=True, inline="always")
def _draw_run(
    out: Floats,
    run: tuple[int, int, int],
    seen: Floats,
    corner: tuple[int, int, np.float32, np.float32],
    flat: Floats,
    lookup: tuple[int, np.float32, np.float32],
    transmission: Floats,
    weights: Floats,
) -> None:
    """Draw pixels begin..end of row y inside one cell, at part ``low`` of its height; ``out`` is changed."""
    (y, begin, end), (gy, gx, low, share), (texels, scale, offset) = run, corner, lookup
    one, nil, stride, most = np.float32(1), np.float32(0), 4 * texels, np.float32(texels - 1.01)
    a0, a1, a2 = weights[0, 0], weights[0, 1], weights[0, 2]  # read once: stores to ``out`` could change them
    s0, s1, s2 = weights[1, 0], weights[1, 1], weights[1, 2]
    g0, g1, g2 = weights[2, 0], weights[2, 1], weights[2, 2]
    column, du = _along(seen, 0, gy, gx, low, share)
    row, dv = _along(seen, 1, gy, gx, low, share)
    lit, dl = _along(seen, 2, gy, gx, low, share)
    silicone, ds = _along(seen, 3, gy, gx, low, share)
    bronze, dg = _along(seen, 4, gy, gx, low, share)
    column, row, du, dv = column * scale + offset, row * scale + offset, du * scale, dv * scale
    for x in range(begin, end):
        passed = transmission[y, x]
        m, n = min(max(row, nil), most), min(max(column, nil), most)
        my, nx = np.int32(m), np.int32(n)
        fy, fx = m - np.float32(my), n - np.float32(nx)
        w11 = fy * fx
        w10, w01 = fy - w11, fx - w11
        w00 = one - fy - w01
        p = np.uint64(my * stride + nx * 4)
        q = p + np.uint64(stride)
        ink = w00 * flat[p + U3] + w01 * flat[p + U7] + w10 * flat[q + U3] + w11 * flat[q + U7]
        gloss, glint = silicone * (one - ink), bronze * ink
        paint = w00 * flat[p] + w01 * flat[p + U4] + w10 * flat[q] + w11 * flat[q + U4]
        out[y, x, 0] = passed * (paint * (lit + a0) + s0 * gloss + g0 * glint)
        paint = w00 * flat[p + U1] + w01 * flat[p + U5] + w10 * flat[q + U1] + w11 * flat[q + U5]
        out[y, x, 1] = passed * (paint * (lit + a1) + s1 * gloss + g1 * glint)
        paint = w00 * flat[p + U2] + w01 * flat[p + U6] + w10 * flat[q + U2] + w11 * flat[q + U6]
        out[y, x, 2] = passed * (paint * (lit + a2) + s2 * gloss + g2 * glint)
        column, row, lit, silicone, bronze = column + du, row + dv, lit + dl, silicone + ds, bronze + dg


@numba.njit(cache=True, fastmath=True, inline="always")
def _along(
    seen: Floats, channel: int, gy: int, gx: int, low: np.float32, share: np.float32
) -> tuple[np.float32, np.float32]:
    """A channel at the left edge of a cell, at part ``low`` of its height, and its change per pixel to the right."""
    left = seen[channel, gy, gx] + low * (seen[channel, gy + 1, gx] - seen[channel, gy, gx])
    right = seen[channel, gy, gx + 1] + low * (seen[channel, gy + 1, gx + 1] - seen[channel, gy, gx + 1])
    return left, (right - left) * share
