"""Compiled loop of :mod:`sensing.robot.contact`: normal and friction ratio of a sphere's contact, with their slopes."""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.compiled import HELPER, SHORT

STEP_N, STEP_NM = 1e-3, 1e-5


@numba.njit(**SHORT | {"fastmath": False})
def line_of_action_slopes(wrench, radius):
    """Where the line of action enters the sphere, and how much friction is in use there.

    Args:
        wrench: (6,) on the endcap about the sphere's centre, N and N m. radius: outer radius, m.

    Returns:
        (5,) outward normal, push (N), tangential over normal force; (5, 6) their slopes after the wrench.
    """
    moved, slopes = wrench.copy(), np.empty((5, 6))
    value = _place(moved, radius)
    for k in range(6):
        step = STEP_N if k < 3 else STEP_NM
        moved[k] = wrench[k] + step
        more = _place(moved, radius)
        moved[k] = wrench[k] - step
        less = _place(moved, radius)
        moved[k] = wrench[k]
        for j in range(5):
            slopes[j, k] = (more[j] - less[j]) / (2 * step)
    return value, slopes


@numba.njit(**HELPER | {"fastmath": False})
def _place(wrench, radius):
    found = np.full(5, math.nan)
    fx, fy, fz, tx, ty, tz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    square = fx * fx + fy * fy + fz * fz
    if not square > 0.0:
        return found
    footx, footy, footz = (fy * tz - fz * ty) / square, (fz * tx - fx * tz) / square, (fx * ty - fy * tx) / square
    back = math.sqrt(max(radius * radius - footx * footx - footy * footy - footz * footz, 0.0) / square)
    nx, ny, nz = footx - back * fx, footy - back * fy, footz - back * fz
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / length, ny / length, nz / length
    push = -(fx * nx + fy * ny + fz * nz)
    found[0], found[1], found[2], found[3] = nx, ny, nz, push
    found[4] = math.sqrt(max(square - push * push, 0.0)) / push if push > 0.0 else math.inf
    return found
