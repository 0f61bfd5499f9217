"""For every point of a plane its nearest other point (NumPy only: a few hundred dots need no search tree)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ROWS = 256  # distances of so many points to all others at a time: the memory stays small whatever a picture holds


def nearest_other(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distance to the nearest other point, and its index.

    Args:
        points: (N, 2), any unit of length; N at least 2.

    Returns:
        (N,) distances in that unit, and (N,) indices; of equally near ones the first.
    """
    distance = np.empty(len(points))
    other = np.empty(len(points), np.int64)
    for start in range(0, len(points), ROWS):
        rows = np.arange(start, min(start + ROWS, len(points)))
        square = ((points[rows, None] - points[None]) ** 2).sum(axis=2)  # (rows, N)
        square[np.arange(len(rows)), rows] = np.inf
        other[rows] = square.argmin(axis=1)
        distance[rows] = np.sqrt(square[np.arange(len(rows)), other[rows]])
    return distance, other
