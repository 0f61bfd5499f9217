"""Compiled distance to rough ground, a part of the loops in :mod:`sensing.simulator.contact.kernels` (mm).

numba keeps those loops by the date of their own file: who changes this one touches that one, too.
"""

# mypy: ignore-errors
from __future__ import annotations

import math

import numpy as np
from numba import njit

_HELPER = {"forceinline": True}
FEET, NEAR = 8, 0.25  # Newton steps to the foot on rough ground, within that part of its radius


@njit(**_HELPER)
def rough_distance(body, y, gradient, hessian):
    """Signed distance to the ground g(s, t) = b (cos k s + cos k t - 2), crest in ``point_mm``, s along the rows.

    With k = pi / R and b = R / pi^2 crests and hollows have the radius R and stand 2 R apart; g spans 0.41 R. The
    distance is that to the foot of y, found by Newton's method. Near the surface the Hessian is S - d S S, S the second
    fundamental form there, which is exact to first order in d.

    Args:
        body: the ground. y: (3,) point. gradient, hessian: (3,) and (3, 3), filled.
    """
    n, e, p = body.axis, body.along, body.point_mm
    c = (n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0])
    s = t = z = 0.0
    for i in range(3):
        s += (y[i] - p[i]) * e[i]
        t += (y[i] - p[i]) * c[i]
        z += (y[i] - p[i]) * n[i]
    k, b = math.pi / body.radius_mm, body.radius_mm / math.pi**2
    u, v = _foot(s, t, z, k, b, NEAR * body.radius_mm)
    gu, gv = -b * k * math.sin(k * u), -b * k * math.sin(k * v)
    length = math.sqrt(1.0 + gu * gu + gv * gv)
    value = (z - b * (math.cos(k * u) + math.cos(k * v) - 2.0) - (s - u) * gu - (t - v) * gv) / length
    for i in range(3):
        gradient[i] = (n[i] - gu * e[i] - gv * c[i]) / length
    bend = b * k * k / length
    _bent(e, bend * math.cos(k * u), c, bend * math.cos(k * v), gradient, value, hessian)
    return value


@njit(**_HELPER)
def _foot(s, t, z, k, b, near):
    """(s, t) of the point of rough ground nearest to (s, t, z); the point below where it is further than ``near``."""
    u, v = s, t
    if abs(z - b * (math.cos(k * s) + math.cos(k * t) - 2.0)) > near:  # its sign is enough
        return u, v
    for _ in range(FEET):
        off = b * (math.cos(k * u) + math.cos(k * v) - 2.0) - z
        gu, gv = -b * k * math.sin(k * u), -b * k * math.sin(k * v)
        guu, gvv = -b * k * k * math.cos(k * u), -b * k * k * math.cos(k * v)
        a, d, m = 1.0 + gu * gu + off * guu, 1.0 + gv * gv + off * gvv, gu * gv
        f, h = u - s + off * gu, v - t + off * gv
        det = a * d - m * m
        u -= (d * f - m * h) / det
        v -= (a * h - m * f) / det
    return u, v


@njit(**_HELPER)
def _bent(e, cu, c, cv, normal, distance, hessian):
    """S - d S S into ``hessian``, with S = cu e e' + cv c c' in the tangent plane of ``normal``."""
    across_e = across_c = 0.0
    for i in range(3):
        across_e += e[i] * normal[i]
        across_c += c[i] * normal[i]
    form = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            form[i, j] = cu * (e[i] - across_e * normal[i]) * (e[j] - across_e * normal[j])
            form[i, j] += cv * (c[i] - across_c * normal[i]) * (c[j] - across_c * normal[j])
    for i in range(3):
        for j in range(3):
            square = 0.0
            for m in range(3):
                square += form[i, m] * form[m, j]
            hessian[i, j] = form[i, j] - distance * square
