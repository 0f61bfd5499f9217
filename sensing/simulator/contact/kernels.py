"""Compiled loops of :mod:`sensing.simulator.contact.friction` (N, mm, MPa). Helpers are always inlined."""

# mypy: ignore-errors
from __future__ import annotations

import math

import numpy as np
from numba import njit

_HELPER = {"forceinline": True}


@njit(cache=True)
def respond(
    nodes, shape, area, eps_n, eps_t, tau0, y0, gap0, body, position, translation, friction,
    lagged, bound, frozen, share,
):  # fmt: skip
    """Forces and tangents of all faces; the arguments are those of :func:`sensing.simulator.contact.friction.respond`.

    Returns:
        Energy, force (f, 9, 3), stiffness (f, 27, 27), pressure and gap (f, g), traction (f, g, 3), slipping (f, g),
        place and normal (f, g, 3); fills ``share`` where it is not ``frozen``.
    """
    faces, points = area.shape
    force, stiffness = np.zeros((faces, 9, 3)), np.zeros((faces, 27, 27))
    pressure, gaps = np.zeros((faces, points)), np.zeros((faces, points))
    traction, slipping = np.zeros((faces, points, 3)), np.zeros((faces, points), dtype=np.bool_)
    place, normals = np.zeros((faces, points, 3)), np.zeros((faces, points, 3))
    hessian, k, trial = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    energy = 0.0
    for f in range(faces):
        for q in range(points):
            y, normal = place[f, q], normals[f, q]
            _relative(shape[q], nodes[f], position, translation, y)
            gap = gaps[f, q] = _distance(body, y, normal, hessian)
            if not gap < 0.0:
                continue
            p = pressure[f, q] = -eps_n * gap
            w, before = area[f, q], gap0[f, q]
            energy += 0.5 * w * p * -gap
            for i in range(3):
                for j in range(3):
                    k[i, j] = eps_n * normal[i] * normal[j] - p * hessian[i, j]
            if friction > 0.0:
                if not frozen:
                    share[f, q] = -gap / (before - gap) if before > 0.0 else 1.0
                eps = eps_t * share[f, q]
                limit = bound[f, q] if lagged else friction * p
                size = _trial(tau0[f, q], y, y0[f, q], eps, normal, trial)
                slipping[f, q] = size > limit
                if slipping[f, q]:
                    energy += w * limit * (size - 0.5 * limit) / eps
                    _slip(trial, size, limit, eps, normal, 0.0 if lagged else friction * eps_n, traction[f, q], k)
                else:
                    energy += 0.5 * w * size * size / eps
                    turn = 0.0
                    if not frozen and before > 0:  # the share grows with the overlap
                        turn = before / ((before - gap) ** 2 * share[f, q])
                    _stick(trial, eps, normal, turn, traction[f, q], k)
            _add(shape[q], w, p, normal, traction[f, q], k, force[f], stiffness[f])
    return energy, force, stiffness, pressure, gaps, traction, slipping, place, normals


@njit(**_HELPER)
def _relative(shape, nodes, position, translation, y):
    """A point of a face as the body sees it, into ``y`` (3,)."""
    for i in range(3):
        y[i] = 0.0
        for a in range(9):
            y[i] += shape[a] * position[nodes[a], i]
        y[i] -= translation[i]


@njit(**_HELPER)
def _trial(tau0, y, y0, eps, normal, trial):
    """Friction if nothing slipped, in the tangent plane, into ``trial``; returns its size."""
    dot, size = 0.0, 0.0
    for i in range(3):
        trial[i] = tau0[i] - eps * (y[i] - y0[i])
        dot += trial[i] * normal[i]
    for i in range(3):
        trial[i] -= dot * normal[i]
        size += trial[i] ** 2
    return math.sqrt(size)


@njit(**_HELPER)
def _stick(trial, eps, normal, turn, tau, k):
    """Friction and its tangent of a point that holds; ``turn``: of the contact share by the overlap, over itself."""
    for i in range(3):
        tau[i] = trial[i]
        for j in range(3):
            k[i, j] += eps * ((1.0 if i == j else 0.0) - normal[i] * normal[j])
            k[i, j] += turn * trial[i] * normal[j]


@njit(**_HELPER)
def _slip(trial, size, limit, eps, normal, slope, tau, k):
    """Friction and its tangent of a point that slips; ``slope``: of the bound by the overlap, 0 where it is frozen."""
    ratio = limit / size
    for i in range(3):
        tau[i] = ratio * trial[i]
        for j in range(3):
            project = (1.0 if i == j else 0.0) - normal[i] * normal[j]
            k[i, j] += eps * ratio * (project - trial[i] * trial[j] / (size * size))
            k[i, j] += slope * trial[i] / size * normal[j]


@njit(**_HELPER)
def _add(shape, w, p, normal, tau, k, force, stiffness):
    """A point's force and tangent onto the nodes of its face."""
    for a in range(9):
        wa = w * shape[a]
        for i in range(3):
            force[a, i] += wa * (p * normal[i] + tau[i])
        for c in range(9):
            wac = wa * shape[c]
            for i in range(3):
                for j in range(3):
                    stiffness[3 * a + i, 3 * c + j] += wac * k[i, j]


@njit(cache=True)
def nearest(nodes, shape, body, position, translation):
    """Face, place (of ``shape``, (s, 9)) and distance where the surface is nearest to the body."""
    y, normal, hessian = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    nearest, face, place = np.inf, 0, 0
    for f in range(len(nodes)):
        for q in range(len(shape)):
            _relative(shape[q], nodes[f], position, translation, y)
            gap = _distance(body, y, normal, hessian)
            if gap < nearest:
                nearest, face, place = gap, f, q
    return face, place, nearest


@njit(**_HELPER)
def _distance(body, y, gradient, hessian):
    """Signed distance of y (3,) to the body at its first touch; fills gradient (3,) and Hessian (3, 3)."""
    hessian[:] = 0.0
    if body[0] == 0.0:
        value = 0.0
        for i in range(3):
            gradient[i] = body[5 + i]
            value += body[5 + i] * (y[i] - body[2 + i])
        return value
    along = 0.0
    if body[0] == 2.0:
        for i in range(3):
            along += body[5 + i] * (y[i] - body[2 + i])
    radius = 0.0
    for i in range(3):
        gradient[i] = y[i] - body[2 + i] - along * body[5 + i]
        radius += gradient[i] ** 2
    radius = math.sqrt(radius)
    for i in range(3):
        gradient[i] /= radius
    for i in range(3):
        for j in range(3):
            hessian[i, j] = ((1.0 if i == j else 0.0) - gradient[i] * gradient[j]) / radius
            if body[0] == 2.0:
                hessian[i, j] -= body[5 + i] * body[5 + j] / radius
    return radius - body[1]
