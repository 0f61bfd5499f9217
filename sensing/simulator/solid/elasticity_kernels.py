"""Compiled loops of :mod:`sensing.simulator.solid.elasticity`, whose equations they are (N, mm, MPa).

Forces have long inner loops over direction and Gauss point together, so that they vectorise: F, its cofactors and the
stress of an element are (3, 3 x 27), place 27 j + q for direction j and point q. Helpers are always inlined, so that
their machine code does not depend on whether this process compiled or loaded them.
"""

# mypy: ignore-errors
from __future__ import annotations

import math

import numpy as np
from numba import njit

_FAST = {"reassoc", "contract"}  # floating-point transformations that the force loops allow
_HELPER, _FAST_HELPER = {"forceinline": True}, {"forceinline": True, "fastmath": _FAST}  # options of inlined helpers


@njit(cache=True, fastmath=_FAST)
def energy_force(u, rows, weight, psi, mass_inverse, c10, c20, c30, bulk):
    """Energy (mJ) and nodal forces (e, 27, 3), N; infinite where an element is inverted.

    Args:
        u: element displacements (e, 27, 3), mm.
        rows, weight, psi, mass_inverse: fields of :class:`sensing.simulator.solid.elasticity.ElementData`.
        c10, c20, c30, bulk: constants of the law, MPa.
    """
    count, points = weight.shape
    force = np.zeros((count, 27, 3))
    f, g, stress = np.empty((3, 3 * points)), np.empty((3, 3 * points)), np.empty((3, 3 * points))
    det, p, b = np.empty(points), np.empty(points), np.empty(4)
    energy = 0.0
    for e in range(count):
        _stretch(u[e], rows[e], f)
        if not _cofactors(f, g, det) > 0.0:
            return math.inf, force
        energy += _pressure(weight[e], psi, mass_inverse[e], bulk, det, b, p)
        energy += _stress(f, g, det, p, weight[e], c10, c20, c30, stress)
        for a in range(27):
            row = rows[e, a]
            t0, t1, t2 = 0.0, 0.0, 0.0
            for k in range(3 * points):
                value = row[k]
                t0 += stress[0, k] * value
                t1 += stress[1, k] * value
                t2 += stress[2, k] * value
            force[e, a, 0], force[e, a, 1], force[e, a, 2] = t0, t1, t2
    return energy, force


@njit(**_FAST_HELPER)
def _stretch(u, rows, f):
    """Write F of all points, for nodal u (27, 3), into ``f``."""
    points = rows.shape[1] // 3
    for i in range(3):
        for k in range(3 * points):
            f[i, k] = 1.0 if i * points <= k < (i + 1) * points else 0.0
    for a in range(27):
        u0, u1, u2 = u[a, 0], u[a, 1], u[a, 2]
        row = rows[a]
        for k in range(3 * points):
            value = row[k]
            f[0, k] += u0 * value
            f[1, k] += u1 * value
            f[2, k] += u2 * value


@njit(**_FAST_HELPER)
def _cofactors(f, g, det):
    """Write J F^-T into ``g`` and J into ``det``; returns the least J (at most 1)."""
    points = det.size
    for i in range(3):
        one, two, row = f[(i + 1) % 3], f[(i + 2) % 3], g[i]
        for q in range(points):
            row[q] = one[points + q] * two[2 * points + q] - one[2 * points + q] * two[points + q]
            row[points + q] = one[2 * points + q] * two[q] - one[q] * two[2 * points + q]
            row[2 * points + q] = one[q] * two[points + q] - one[points + q] * two[q]
    lowest = 1.0
    for q in range(points):
        det[q] = f[0, q] * g[0, q] + f[0, points + q] * g[0, points + q] + f[0, 2 * points + q] * g[0, 2 * points + q]
        lowest = min(lowest, det[q])
    return lowest


@njit(**_FAST_HELPER)
def _pressure(weight, psi, mass_inverse, bulk, det, b, p):
    """Write the pressure at every point into ``p``; returns its energy, mJ."""
    energy = 0.0
    for a in range(4):
        b[a] = 0.0
        for q in range(det.size):
            b[a] += weight[q] * psi[q, a] * (det[q] - 1.0)
    p[:] = 0.0
    for a in range(4):
        pressure = 0.0
        for c in range(4):
            pressure += bulk * mass_inverse[a, c] * b[c]
        energy += 0.5 * pressure * b[a]
        for q in range(det.size):
            p[q] += psi[q, a] * pressure
    return energy


@njit(**_FAST_HELPER)
def _stress(f, g, det, p, weight, c10, c20, c30, stress):
    """Write the first Piola-Kirchhoff stress times the points' volumes; returns the isochoric energy, mJ."""
    points, energy = det.size, 0.0
    for q in range(points):
        first = 0.0
        for i in range(3):
            for j in range(3):
                first += f[i, j * points + q] ** 2
        scale = det[q] ** (-2.0 / 3.0)
        x = scale * first - 3.0
        energy += weight[q] * (c10 * x + c20 * x * x + c30 * x * x * x)
        slope = 2 * scale * (c10 + 2 * c20 * x + 3 * c30 * x * x) * weight[q]
        along = weight[q] * p[q] - slope * first / (3 * det[q])
        for i in range(3):
            for j in range(3):
                stress[i, j * points + q] = slope * f[i, j * points + q] + along * g[i, j * points + q]
    return energy


@njit(cache=True)
def tangent(u, gradient, weight, psi, mass_inverse, c10, c20, c30, bulk):
    """Element matrices (e, 81, 81), N/mm.

    Args:
        u: element displacements (e, 27, 3), mm.
        gradient, weight, psi, mass_inverse: fields of :class:`sensing.simulator.solid.elasticity.ElementData`.
        c10, c20, c30, bulk: constants of the law, MPa.
    """
    count = u.shape[0]
    result = np.empty((count, 81, 81))
    f, g, det = np.empty((27, 3, 3)), np.empty((27, 3, 3)), np.empty(27)
    b, volume = np.empty(4), np.empty((4, 81))
    left = np.empty((27, 81))  # [a, 3 q + A]
    moduli = np.empty((27, 3, 3, 3, 3))
    for e in range(count):
        _volume_rows(u[e], gradient[e], weight[e], psi, f, g, det, b, volume, left)
        pressure = np.dot(psi, bulk * np.dot(mass_inverse[e], b))  # (27,)
        for q in range(27):
            _moduli(f[q], g[q], det[q], pressure[q], weight[e, q], c10, c20, c30, moduli[q])
        _contract(moduli, gradient[e], left, result[e])
        result[e] += bulk * np.dot(volume.T, np.dot(mass_inverse[e], volume))
    return result


@njit(**_HELPER)
def _volume_rows(u, gradient, weight, psi, f, g, det, b, volume, left):
    """Kinematics of an element's points; b (4,), its derivative B (4, 81), and gradients as ``left`` (27, 81)."""
    b[:] = 0.0
    volume[:] = 0.0
    for q in range(27):
        det[q] = _kinematics(u, gradient[q], f[q], g[q])
        for a in range(4):
            b[a] += weight[q] * psi[q, a] * (det[q] - 1.0)
        for c in range(27):
            g0, g1, g2 = gradient[q, c, 0], gradient[q, c, 1], gradient[q, c, 2]
            left[c, 3 * q], left[c, 3 * q + 1], left[c, 3 * q + 2] = g0, g1, g2
            for j in range(3):
                dj = weight[q] * det[q] * (g[q, j, 0] * g0 + g[q, j, 1] * g1 + g[q, j, 2] * g2)
                for a in range(4):
                    volume[a, 3 * c + j] += psi[q, a] * dj


@njit(**_HELPER)
def _kinematics(u, gradient, f, g):
    """Write F into ``f`` and F^-T into ``g`` (3, 3), for nodal u (27, 3); returns J."""
    for i in range(3):
        for j in range(3):
            total = 1.0 if i == j else 0.0
            for a in range(27):
                total += u[a, i] * gradient[a, j]
            f[i, j] = total
    g[0, 0] = f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1]
    g[0, 1] = f[1, 2] * f[2, 0] - f[1, 0] * f[2, 2]
    g[0, 2] = f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0]
    g[1, 0] = f[2, 1] * f[0, 2] - f[2, 2] * f[0, 1]
    g[1, 1] = f[2, 2] * f[0, 0] - f[2, 0] * f[0, 2]
    g[1, 2] = f[2, 0] * f[0, 1] - f[2, 1] * f[0, 0]
    g[2, 0] = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
    g[2, 1] = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
    g[2, 2] = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
    det = f[0, 0] * g[0, 0] + f[0, 1] * g[0, 1] + f[0, 2] * g[0, 2]
    if det > 0.0:
        for i in range(3):
            for j in range(3):
                g[i, j] /= det
    return det


@njit(**_HELPER)
def _moduli(f, g, det, p, weight, c10, c20, c30, moduli):
    """Write dP/dF at fixed pressure, times the point's volume, into ``moduli`` (3, 3, 3, 3)."""
    first = 0.0
    for i in range(3):
        for j in range(3):
            first += f[i, j] ** 2
    scale = det ** (-2.0 / 3.0)
    x = scale * first - 3.0
    slope = c10 + 2 * c20 * x + 3 * c30 * x * x
    curve = 2 * c20 + 6 * c30 * x
    for i in range(3):
        for k in range(3):
            one = 2 * scale * (f[i, k] - first / 3 * g[i, k])
            for j in range(3):
                for m in range(3):
                    same = 1.0 if (i == j and k == m) else 0.0
                    gg, swapped = g[i, k] * g[j, m], g[i, m] * g[j, k]
                    two = 2 * scale * (f[j, m] - first / 3 * g[j, m])
                    mixed = same - 2.0 / 3.0 * (f[i, k] * g[j, m] + g[i, k] * f[j, m])
                    second = 2 * scale * (mixed + 2.0 / 9.0 * first * gg + first / 3.0 * swapped)
                    moduli[i, k, j, m] = weight * (curve * one * two + slope * second + p * det * (gg - swapped))


@njit(**_HELPER)
def _contract(moduli, gradient, left, result):
    """Write the moduli contracted with the gradients on both sides into an element's matrix (81, 81)."""
    right = np.empty((81, 81))  # [3 q + A, 27 j + c] for one i
    for i in range(3):
        for q in range(27):
            for k in range(3):
                for j in range(i, 3):
                    m0, m1, m2 = moduli[q, i, k, j, 0], moduli[q, i, k, j, 1], moduli[q, i, k, j, 2]
                    for c in range(27):
                        right[3 * q + k, 27 * j + c] = (
                            m0 * gradient[q, c, 0] + m1 * gradient[q, c, 1] + m2 * gradient[q, c, 2]
                        )
        block = np.dot(left, np.ascontiguousarray(right[:, 27 * i :]))  # (27, 27 (3 - i))
        for j in range(i, 3):
            for a in range(27):
                for c in range(27):
                    value = block[a, 27 * (j - i) + c]
                    result[3 * a + i, 3 * c + j] = value
                    result[3 * c + j, 3 * a + i] = value
