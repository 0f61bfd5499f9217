"""Quantiles over loading paths: frames of one path are not independent, so every path weighs the same."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def path_quantile(values: NDArray, path: NDArray[np.str_], level: float) -> NDArray:
    """(A,) smallest values of (N, A) at or below which ``level`` of the weight lies, column by column.

    Args:
        values: (N, A) values, one row for each frame.
        path: (N,) identity of each row's path.
        level: in (0, 1]; 1 gives the largest.
    """
    _, of_row, frames = np.unique(path, return_inverse=True, return_counts=True)
    weight = 1.0 / (len(frames) * frames[of_row])
    order = np.argsort(values, axis=0)
    first = np.argmax(np.cumsum(weight[order], axis=0) >= level - 1e-9, axis=0)
    return np.take_along_axis(values, np.take_along_axis(order, first[None], axis=0), axis=0)[0]
