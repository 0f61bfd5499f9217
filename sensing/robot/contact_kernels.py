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
    """Place on the sphere where a force and a couple about the normal are the wrench, with slopes.

    With force F, torque t / R about the centre and outward normal n, a contact has t / R = n x F + (q / R) n. Its
    product with F gives q as t.F / (n.F), its square an equation for (n.F)^2, and n solves the linear rest.

    Args:
        wrench: (6,) on the endcap about the sphere's centre, N and N m.
        radius: outer radius, m.
        spin_lever: largest torque about the normal over the normal force, m.

    Returns:
        (7,) outward normal, push (N), tangential over normal force, coefficient of friction that this and the torque
        about the normal need, that torque over the push (m); (7, 6) slopes by the wrench.
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
    tx, ty, tz = tx / radius, ty / radius, tz / radius
    along, excess = fx * tx + fy * ty + fz * tz, square - tx * tx - ty * ty - tz * tz
    push = math.sqrt(max(0.5 * (excess + math.hypot(excess, 2.0 * along)), 1e-30 * square))
    twist = -along / push
    nx = twist * tx + fy * tz - fz * ty - push * fx
    ny = twist * ty + fz * tx - fx * tz - push * fy
    nz = twist * tz + fx * ty - fy * tx - push * fz
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = nx / length, ny / length, nz / length
    found[0], found[1], found[2], found[3] = nx, ny, nz, push
    if push > 0.0:
        found[6] = radius * abs(twist) / push
        found[4] = math.sqrt(max(square - push * push, 0.0)) / push
        found[5] = found[4] / math.sqrt(max(1.0 - (found[6] / spin_lever) ** 2, LEAST_LEFT))
    return found
