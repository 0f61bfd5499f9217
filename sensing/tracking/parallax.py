"""Parallax: a camera beside its nominal place sees the skin that moves toward it move sideways, too.

    to_dots = radial_at_dots(radial, operator, place, size)         # once
    shift_px = sideways * (to_dots @ moved.T.ravel())[:, None]      # of every dot

Notes:
    A camera's ray is followed to a sphere, because one camera does not see how far away a dot is
    (:mod:`sensing.tracking.model_input`). A dot whose distance from the sphere's centre has changed by rho lies beside
    that point by k rho, k the derivative of the view by the sphere's radius. Both cameras have it; what counts is the
    difference, zero for a camera in its nominal place and up to 1 % of the displacement half a millimetre beside it.
    The field itself says rho: over states of one design rho = M x to 5 % (rms), M being learned with the weights
    (:mod:`sensing.learning.radial`). First order: k is that of the dots at rest.

Displacements in pixels of the full-size picture, rho in mm, outward positive.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.tracking.field.operator import FieldOperator
from sensing.tracking.gelslim import CROP_PX

Array = NDArray[np.float64]


def radial_at_dots(radial: Array, operator: FieldOperator, place: Array, size: tuple[int, int]) -> Array:
    """(n, 2 n) radial displacement of n dots, mm, by their displacements (all x, then all y), px.

    Args:
        radial: (H W, 2 H W) M, mm in each cell by the field in pixels of the 200 x 200 crop.
        operator: displacements of these dots to the cells.
        place: (n, 2) of the dots, px.
        size: (width, height) of the picture, px.
    """
    to_cells = operator.to_cells.T.astype(float) * (CROP_PX / min(size))
    cells = len(to_cells)
    by_moved = np.hstack([radial[:, :cells] @ to_cells, radial[:, cells:] @ to_cells])
    return np.asarray(_bilinear(place, size, operator.shape) @ by_moved)


def _bilinear(place: Array, size: tuple[int, int], shape: tuple[int, int]) -> Array:
    """(n, H W) weights of the cells of the centre square at places (n, 2), px; beyond its outer cells as in them."""
    side = min(size)
    corner = np.array([(size[0] - side) // 2, (size[1] - side) // 2]) - 0.5
    weights = []
    for axis, count in enumerate(shape[::-1]):  # x over the columns, then y over the rows
        at = np.clip((place[:, axis] - corner[axis]) * count / side - 0.5, 0.0, count - 1.0)
        weights.append(np.maximum(0.0, 1.0 - np.abs(at[:, None] - np.arange(count))))
    return np.asarray((weights[1][:, :, None] * weights[0][:, None, :]).reshape(len(place), -1))
