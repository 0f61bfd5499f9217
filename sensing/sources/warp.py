"""A picture pressed by a known displacement: the stand-in for a touched sensor, with exact truth.

Units: full-size pixels. A displacement field says where each point of the *undeformed* picture goes, as the flow of
the released pipeline does: the point at x is seen at x + u(x). The warped picture is I(y) = I0(x) with x + u(x) = y,
found by fixed-point iteration (u is a contraction as long as its gradient stays under 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from sensing.records import Image

ITERATIONS, SETTLED_PX = 12, 2e-3  # of the inverse of a displacement, at most; where they end


@dataclass(frozen=True)
class Bump:
    """A smooth local push: u(x) = push exp(-|x - centre|^2 / (2 width^2)).

    Attributes:
        centre_px: x, y.
        push_px: x, y displacement at the centre.
        width_px: standard deviation.
    """

    centre_px: tuple[float, float]
    push_px: tuple[float, float]
    width_px: float


@dataclass(frozen=True)
class Displacement:
    """Sum of a translation, a rotation and bumps.

    Attributes:
        shift_px: x, y translation.
        turn_rad: rotation about ``pivot_px`` (positive turns x toward y, clockwise on screen).
        pivot_px: x, y.
        bumps: local pushes.
    """

    shift_px: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0
    pivot_px: tuple[float, float] = (319.5, 239.5)
    bumps: tuple[Bump, ...] = ()

    def at(self, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray]:
        """(u, v) of the undeformed points (x, y), any shape."""
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)  # plain floats keep float32 arrays float32
        dx, dy = x - float(self.pivot_px[0]), y - float(self.pivot_px[1])
        u = float(self.shift_px[0]) + (cos - 1) * dx - sin * dy
        v = float(self.shift_px[1]) + sin * dx + (cos - 1) * dy
        for bump in self.bumps:
            square = (x - float(bump.centre_px[0])) ** 2 + (y - float(bump.centre_px[1])) ** 2
            weight = np.exp(square / (-2 * float(bump.width_px) ** 2))
            u, v = u + float(bump.push_px[0]) * weight, v + float(bump.push_px[1]) * weight
        return u, v

    def scaled(self, factor: float) -> Displacement:
        """The same pattern, ``factor`` times as large."""
        bumps = tuple(Bump(b.centre_px, (b.push_px[0] * factor, b.push_px[1] * factor), b.width_px) for b in self.bumps)
        shift = (self.shift_px[0] * factor, self.shift_px[1] * factor)
        return Displacement(shift, self.turn_rad * factor, self.pivot_px, bumps)


def warp_image(image: Image, displacement: Displacement) -> Image:
    """The picture as seen after ``displacement``; beyond its frame the border is repeated.

    Args:
        image: (H, W) or (H, W, 3).
        displacement: where each point goes, px.

    Notes:
        Sampled by Keys' cubic convolution (1981, doi:10.1109/TASSP.1981.1163711), which reproduces straight lines.
        OpenCV's cubic and Lanczos remapping do not: they shift a ramp by up to 0.047 and 0.025 px, more than the error
        of the methods that this is to judge.
    """
    height, width = image.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    source_x, source_y = x, y
    for _ in range(ITERATIONS):
        u, v = displacement.at(source_x, source_y)
        next_x, next_y = (x - u).astype(np.float32), (y - v).astype(np.float32)
        change = max(np.abs(next_x - source_x).max(), np.abs(next_y - source_y).max())
        source_x, source_y = next_x, next_y
        if change < SETTLED_PX:
            break
    layers = image[:, :, None] if image.ndim == 2 else image
    return _sample_cubic(np.ascontiguousarray(layers), source_x, source_y).reshape(image.shape)


def cell_truth(
    displacement: Displacement, size: tuple[int, int], shape: tuple[int, int] = (30, 30), unit_px: float = 200.0
) -> NDArray[np.float64]:
    """(2, H, W) mean displacement of each cell of the centre square, in pixels of a ``unit_px`` wide crop.

    Args:
        displacement: the field.
        size: (width, height) of the full-size picture.
        shape: cells down and across.
        unit_px: side of the square that the unit refers to.
    """
    side = min(size)
    per_cell = 8  # midpoint rule; the error is far under 1e-3 px for bumps wider than a cell
    across = (np.arange(shape[1] * per_cell) + 0.5) * side / (shape[1] * per_cell) - 0.5 + (size[0] - side) // 2
    down = (np.arange(shape[0] * per_cell) + 0.5) * side / (shape[0] * per_cell) - 0.5 + (size[1] - side) // 2
    uv = np.stack(displacement.at(*np.meshgrid(across, down)))
    return uv.reshape(2, shape[0], per_cell, shape[1], per_cell).mean(axis=(2, 4)) * unit_px / side


@numba.njit(cache=True)
def _sample_cubic(image, source_x, source_y):  # type: ignore[no-untyped-def]
    """(H, W, C) uint8 picture at (H, W) float32 places; places beyond the frame see its border."""
    height, width, layers = image.shape
    result = np.empty((*source_x.shape, layers), np.uint8)
    weight_x, weight_y = np.empty(4, np.float32), np.empty(4, np.float32)
    for j in range(source_x.shape[0]):
        for i in range(source_x.shape[1]):
            x = min(max(source_x[j, i], np.float32(0)), np.float32(width - 1))
            y = min(max(source_y[j, i], np.float32(0)), np.float32(height - 1))
            left, top = int(x), int(y)
            for weight, f in ((weight_x, x - left), (weight_y, y - top)):
                weight[0] = ((-0.5 * f + 1.0) * f - 0.5) * f
                weight[1] = (1.5 * f - 2.5) * f * f + 1.0
                weight[2] = ((-1.5 * f + 2.0) * f + 0.5) * f
                weight[3] = (0.5 * f - 0.5) * f * f
            for k in range(layers):
                total = np.float32(0)
                for m in range(4):
                    row = min(max(top + m - 1, 0), height - 1)
                    for n in range(4):
                        column = min(max(left + n - 1, 0), width - 1)
                        total += weight_y[m] * weight_x[n] * image[row, column, k]
                result[j, i, k] = np.uint8(min(max(total + np.float32(0.5), np.float32(0)), np.float32(255)))
    return result
