"""Compiled loop of :mod:`sensing.robot.contact`: normal and friction ratio of a sphere's contact, with their slopes."""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.compiled import SHORT

STEP_N, STEP_NM = 1e-3, 1e-5  # steps of the finite differences
LEAST_LEFT = 0.05  # least part of the friction that a torque about the normal leaves to the tangential force


@numba.njit(**SHORT | {"fastmath": False})
def line_of_action_slopes(wrench, radius, spin_lever):
    """Point at which the line of action enters the sphere, and the friction in use there, with their slopes.

    Args:
        wrench: (6,) on the endcap about the sphere's centre, N and N m.
        radius: outer radius, m.
        spin_lever: largest torque about the normal over the normal force, m.

    Returns:
        (7,) outward normal, push (N), tangential over normal force, coefficient of friction that this and the torque
        about the normal need, that torque over the push (m); (7, 6) slopes after the wrench.
    """
    moved, slopes = wrench.copy(), np.empty((7, 6))
    value = _place(moved, radius, spin_lever)
    for k in range(6):
        step = STEP_N if k < 3 else STEP_NM
        moved[k] = wrench[k] + step
        more = _place(moved, radius, spin_lever)
        moved[k] = wrench[k] - step
        less = _place(moved, radius, spin_lever)
        moved[k] = wrench[k]
        for j in range(7):
            slopes[j, k] = (more[j] - less[j]) / (2 * step)
    return value, slopes


@numba.njit(**SHORT | {"fastmath": False})
def _place(wrench, radius, spin_lever):
    found = np.full(7, math.nan)
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
    if push > 0.0:
        found[6] = abs(tx * nx + ty * ny + tz * nz) / push
        found[4] = math.sqrt(max(square - push * push, 0.0)) / push
        found[5] = found[4] / math.sqrt(max(1.0 - (found[6] / spin_lever) ** 2, LEAST_LEFT))
    return found
