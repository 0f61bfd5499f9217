"""The triquadratic hexahedron (hex27): shape functions, Gauss points, faces.

Local node ``a = i + 3 j + 9 k`` sits at ``(xi, eta, zeta) = (i - 1, j - 1, k - 1)``; in the shell zeta points outward,
so the outer face is ``k = 2`` and the inner face ``k = 0``. Arrays carry shapes in comments; no units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OUTER_FACE = np.arange(18, 27)  # local nodes of the face zeta = +1
INNER_FACE = np.arange(9)  # local nodes of the face zeta = -1


def gauss(count: int) -> tuple[Array, Array]:
    """Points and weights of the ``count``-point Gauss rule on -1..1."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return points, weights


def lagrange(x: Array) -> tuple[Array, Array]:
    """Quadratic Lagrange values and derivatives at points ``x`` (n,): two arrays (n, 3)."""
    value = np.stack([x * (x - 1) / 2, 1 - x * x, x * (x + 1) / 2], axis=-1)
    slope = np.stack([x - 0.5, -2 * x, x + 0.5], axis=-1)
    return value, slope


def shape_hex(local: Array) -> tuple[Array, Array]:
    """Shape functions (n, 27) and local gradients (n, 27, 3) at local points (n, 3)."""
    (a, da), (b, db), (c, dc) = (lagrange(local[:, k]) for k in range(3))
    value = np.einsum("nk,nj,ni->nkji", c, b, a).reshape(len(local), 27)
    grads = [
        np.einsum("nk,nj,ni->nkji", *triple).reshape(len(local), 27) for triple in ((c, b, da), (c, db, a), (dc, b, a))
    ]
    return value, np.stack(grads, axis=-1)


def shape_quad(local: Array) -> tuple[Array, Array]:
    """Biquadratic face functions (n, 9) and local gradients (n, 9, 2) at local points (n, 2)."""
    (a, da), (b, db) = lagrange(local[:, 0]), lagrange(local[:, 1])
    value = np.einsum("nj,ni->nji", b, a).reshape(len(local), 9)
    first = np.einsum("nj,ni->nji", b, da).reshape(len(local), 9)
    second = np.einsum("nj,ni->nji", db, a).reshape(len(local), 9)
    return value, np.stack([first, second], axis=-1)


def volume_rule(count: int = 3) -> tuple[Array, Array]:
    """Gauss points (n^3, 3) and weights (n^3,) of the hexahedron."""
    x, w = gauss(count)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    return grid, np.einsum("i,j,k->ijk", w, w, w).ravel()


def face_rule(count: int) -> tuple[Array, Array]:
    """Gauss points (n^2, 2) and weights (n^2,) of the face."""
    x, w = gauss(count)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    return grid, np.outer(w, w).ravel()
