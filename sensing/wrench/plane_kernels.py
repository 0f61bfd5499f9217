"""Compiled loop of :mod:`sensing.wrench.plane_contact`: in numpy its small steps would cost a millisecond a frame."""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.compiled import HELPER, SHORT
from sensing.wrench.kernels import EXACT

ROUNDS = 8  # each leaves about a thirtieth of the error in the normal


@numba.njit(**SHORT | {"fastmath": EXACT})
def plane_solution(wrench, steps, size, law):
    """Centre, normal and use of friction of a plane's contact, and their slopes.

    Args:
        wrench: (6,) about the sphere's centre, N and N mm.
        steps: (8,) by which wrench and law's offsets are moved.
        size: (outer radius, span that the law has lengths in, unit of force), mm and N.
        law: constants of the law.

    Returns:
        (7,) centre from the sphere's centre (mm), normal, use of friction, NaN without a push; (7, 8) slopes.
    """
    moved = np.zeros(8)
    for k in range(6):  # a slice would compile for twice as long, for the message of two lengths that differ
        moved[k] = wrench[k]
    value = _place(moved, size, law)
    slopes = np.empty((7, 8))
    for k in range(8):
        here = moved[k]
        moved[k] = here + steps[k]
        more = _place(moved, size, law)
        moved[k] = here - steps[k]
        less = _place(moved, size, law)
        moved[k] = here
        for j in range(7):
            slopes[j, k] = (more[j] - less[j]) / (2 * steps[k])
    return value, slopes


@numba.njit(**HELPER | {"fastmath": EXACT})
def _place(given, size, law):
    """(7,) from a wrench and two offsets (mm) that are added to the law's."""
    found = np.full(7, math.nan)
    radius, span, unit = size
    fx, fy, fz, tx, ty, tz = given[0], given[1], given[2], given[3], given[4], given[5]
    square = fx * fx + fy * fy + fz * fz
    footx, footy, footz = (fy * tz - fz * ty) / square, (fz * tx - fx * tz) / square, (fx * ty - fy * tx) / square
    back = math.sqrt(max(radius * radius - footx * footx - footy * footy - footz * footz, 0.0) / square)
    nx, ny, nz = footx - back * fx, footy - back * fy, footz - back * fz  # where the line of action enters
    for _ in range(ROUNDS):
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / length, ny / length, nz / length
        push = -(fx * nx + fy * ny + fz * nz)
        if not push > 0.0:
            return found
        s = math.sqrt(nx * nx + ny * ny)
        lx, ly = (-ny / s, nx / s) if s > 1e-9 else (0.0, 1.0)
        mx, my, mz = nz * ly, -nz * lx, ny * lx - nx * ly  # lateral x outward: away from the tip
        along, across = fx * mx + fy * my + fz * mz, fx * lx + fy * ly
        f = push / unit
        height = radius - span * min(
            law[5] * f + law[6] * f * math.sqrt(f) + law[7] * math.sqrt(f), 0.5 * radius / span
        )
        x = (height * along - (tx * lx + ty * ly)) / -push
        y = (height * across + tx * mx + ty * my + tz * mz) / -push
        px, py, pz = (height * nx + x * mx + y * lx, height * ny + x * my + y * ly, height * nz + x * mz)
        yields = law[0] + law[1] * math.sqrt(f)
        wanted_x = span * ((yields + law[2] * s * s) * along / unit + f * s * (2 * nz * law[4] + law[8])) + given[6]
        wanted_y = span * (yields + law[3] * s * s) * across / unit + given[7]
        nx, ny = px - wanted_x * mx - wanted_y * lx, py - wanted_x * my - wanted_y * ly
        nz = pz - wanted_x * mz
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    found[0], found[1], found[2] = px, py, pz
    found[3], found[4], found[5] = nx / length, ny / length, nz / length
    push = -(fx * nx + fy * ny + fz * nz) / length
    found[6] = math.sqrt(max(square - push * push, 0.0)) / push
    return found
