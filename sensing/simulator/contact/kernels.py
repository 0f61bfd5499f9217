"""Compiled loops of :mod:`sensing.simulator.contact.friction` (N, mm, MPa). Helpers are always inlined.

All that is compiled into the loops is in this file, but for the numbers of :class:`BodyKind`: numba keeps them as long
as it does not change.
"""

# mypy: ignore-errors
from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from sensing.simulator.contact.body import BodyKind
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import Index

HELPER: dict[str, Any] = {"forceinline": True}  # options of helper functions, which numba inlines always
FOOT_STEPS, NEAR = 8, 0.25  # Newton steps to the foot on rough ground; they run within this part of its radius


class Quadrature(NamedTuple):
    """Quadrature of contact: nodes (f, 9), shape functions (g, 9), areas (f, g), mm2, penalties eps_n and eps_t."""

    nodes: Index
    shape: Array
    area: Array
    eps_n: float
    eps_t: float


class Memory(NamedTuple):
    """Friction at the last accepted state: traction, MPa, and relative position, mm (f, g, 3); gap, mm (f, g)."""

    traction: Array
    position: Array
    gap: Array


class Friction(NamedTuple):
    """Coulomb's law in one evaluation.

    Attributes:
        coefficient: mu.
        bound_is_given: whether ``bound`` (f, g), MPa, replaces mu p and its derivative.
        bound: see above.
        fraction_is_given: whether ``contact_fraction`` (f, g) is an input; otherwise the kernel fills it.
        contact_fraction: part of the step's time in which each point was in contact.
    """

    coefficient: float
    bound_is_given: bool
    bound: Array
    fraction_is_given: bool
    contact_fraction: Array


class Response(NamedTuple):
    """Output arrays of the kernel: forces, tangents and the state of every Gauss point (see ``ContactResponse``)."""

    force: Array
    stiffness: Array
    pressure: Array
    gap: Array
    traction: Array
    slipping: Array
    position: Array
    gradient: Array


@njit(cache=True)
def respond(quadrature, memory, body, position, translation, friction, out):
    """Fill the response of all faces; returns the energy, mJ.

    Args:
        quadrature, memory, friction: records of this module.
        body: :class:`sensing.simulator.contact.body.Body`.
        position: nodal positions (n, 3), mm.
        translation: displacement of the body from its first touch (3,), mm.
        out: zeroed :class:`Response`, filled here.
    """
    faces, points = quadrature.area.shape
    hessian, k, trial = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    eps_n, mu, fraction = quadrature.eps_n, friction.coefficient, friction.contact_fraction
    energy = 0.0
    for f in range(faces):
        for q in range(points):
            shape, y, normal = quadrature.shape[q], out.position[f, q], out.gradient[f, q]
            _relative(shape, quadrature.nodes[f], position, translation, y)
            gap = out.gap[f, q] = _distance(body, y, normal, hessian)
            if not gap < 0.0:
                continue
            p = out.pressure[f, q] = -eps_n * gap
            w, before, traction = quadrature.area[f, q], memory.gap[f, q], out.traction[f, q]
            energy += 0.5 * w * p * -gap
            for i in range(3):
                for j in range(3):
                    k[i, j] = eps_n * normal[i] * normal[j] - p * hessian[i, j]
            if mu > 0.0:
                if not friction.fraction_is_given:
                    fraction[f, q] = -gap / (before - gap) if before > 0.0 else 1.0
                eps = quadrature.eps_t * fraction[f, q]
                limit = friction.bound[f, q] if friction.bound_is_given else mu * p
                size = _trial(memory.traction[f, q], y, memory.position[f, q], eps, normal, trial)
                out.slipping[f, q] = size > limit
                if out.slipping[f, q]:
                    energy += w * limit * (size - 0.5 * limit) / eps
                    _slip(trial, size, limit, eps, normal, 0.0 if friction.bound_is_given else mu * eps_n, traction, k)
                else:
                    energy += 0.5 * w * size * size / eps
                    turn = 0.0
                    if not friction.fraction_is_given and before > 0:  # the fraction grows with the overlap
                        turn = before / ((before - gap) ** 2 * fraction[f, q])
                    _stick(trial, eps, normal, turn, traction, k)
            _add(shape, w, p, normal, traction, k, out.force[f], out.stiffness[f])
    return energy


@njit(**HELPER)
def _relative(shape, nodes, position, translation, y):
    """Write the position of a face's point relative to the body into ``y`` (3,)."""
    for i in range(3):
        place = 0.0
        for a in range(9):
            place += shape[a] * position[nodes[a], i]
        y[i] = place - translation[i]


@njit(**HELPER)
def _trial(tau0, y, y0, eps, normal, trial):
    """Write the trial traction of a sticking point, in the tangent plane, into ``trial``; returns its norm, MPa."""
    dot, size = 0.0, 0.0
    for i in range(3):
        trial[i] = tau0[i] - eps * (y[i] - y0[i])
        dot += trial[i] * normal[i]
    for i in range(3):
        trial[i] -= dot * normal[i]
        size += trial[i] ** 2
    return math.sqrt(size)


@njit(**HELPER)
def _stick(trial, eps, normal, turn, tau, k):
    """Traction and tangent of a sticking point; ``turn``: d(log contact-time fraction) by the overlap, 1/mm."""
    for i in range(3):
        tau[i] = trial[i]
        for j in range(3):
            k[i, j] += eps * ((1.0 if i == j else 0.0) - normal[i] * normal[j])
            k[i, j] += turn * trial[i] * normal[j]


@njit(**HELPER)
def _slip(trial, size, limit, eps, normal, slope, tau, k):
    """Traction and tangent of a slipping point; ``slope``: of the bound by the overlap, 0 where it is frozen."""
    ratio = limit / size
    for i in range(3):
        tau[i] = ratio * trial[i]
        for j in range(3):
            project = (1.0 if i == j else 0.0) - normal[i] * normal[j]
            k[i, j] += eps * ratio * (project - trial[i] * trial[j] / (size * size))
            k[i, j] += slope * trial[i] / size * normal[j]


@njit(**HELPER)
def _add(shape, w, p, normal, tau, k, force, stiffness):
    """Add the force and the tangent of a point to those of the nodes of its face."""
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
    """Face, place (row of ``shape``) and distance (mm) where the surface is nearest to the body.

    Args:
        nodes: nodes of the faces (f, 9).
        shape: shape functions at the places that are evaluated (s, 9).
        body, position, translation: arguments of :func:`respond`.
    """
    y, normal, hessian = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    nearest, face, place = np.inf, 0, 0
    for f in range(len(nodes)):
        for q in range(len(shape)):
            _relative(shape[q], nodes[f], position, translation, y)
            gap = _distance(body, y, normal, hessian)
            if gap < nearest:
                nearest, face, place = gap, f, q
    return face, place, nearest


@njit(**HELPER)
def _distance(body, y, gradient, hessian):
    """Signed distance of y (3,) to the body at its first touch; fills gradient (3,) and Hessian (3, 3)."""
    hessian[:] = 0.0
    if body.kind == BodyKind.ROUGH:
        return _rough_distance(body, y, gradient, hessian)
    if body.kind == BodyKind.PLANE:
        value = 0.0
        for i in range(3):
            gradient[i] = body.axis[i]
            value += body.axis[i] * (y[i] - body.point_mm[i])
        return value
    along = 0.0
    if body.kind == BodyKind.EDGE:
        for i in range(3):
            along += body.axis[i] * (y[i] - body.point_mm[i])
    radius = 0.0
    for i in range(3):
        gradient[i] = y[i] - body.point_mm[i] - along * body.axis[i]
        radius += gradient[i] ** 2
    radius = math.sqrt(radius)
    for i in range(3):
        gradient[i] /= radius
    for i in range(3):
        for j in range(3):
            hessian[i, j] = ((1.0 if i == j else 0.0) - gradient[i] * gradient[j]) / radius
            if body.kind == BodyKind.EDGE:
                hessian[i, j] -= body.axis[i] * body.axis[j] / radius
    return radius - body.radius_mm


@njit(**HELPER)
def _rough_distance(body, y, gradient, hessian):
    """Signed distance to the ground g(s, t) = b (cos k s + cos k t - 2), crest in ``point_mm``, s along the rows.

    With k = pi / R and b = R / pi^2 crests and hollows have the radius R and stand 2 R apart; g spans 0.41 R. The
    distance is that to the foot of y, found by Newton's method. Near the surface the Hessian is S - d S S, S the second
    fundamental form there, which is exact to first order in d.

    Args:
        body: the rough ground.
        y: (3,) point, mm.
        gradient, hessian: (3,) and (3, 3), filled here.
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


@njit(**HELPER)
def _foot(s, t, z, k, b, near):
    """(s, t) of the point of rough ground nearest to (s, t, z); (s, t) itself where it is further than ``near``."""
    u, v = s, t
    if abs(z - b * (math.cos(k * s) + math.cos(k * t) - 2.0)) > near:  # contact needs only the sign there
        return u, v
    for _ in range(FOOT_STEPS):
        off = b * (math.cos(k * u) + math.cos(k * v) - 2.0) - z
        gu, gv = -b * k * math.sin(k * u), -b * k * math.sin(k * v)
        guu, gvv = -b * k * k * math.cos(k * u), -b * k * k * math.cos(k * v)
        a, d, m = 1.0 + gu * gu + off * guu, 1.0 + gv * gv + off * gvv, gu * gv
        f, h = u - s + off * gu, v - t + off * gv
        det = a * d - m * m
        u -= (d * f - m * h) / det
        v -= (a * h - m * f) / det
    return u, v


@njit(**HELPER)
def _bent(e, cu, c, cv, normal, distance, hessian):
    """Write S - d S S into ``hessian``, with S = cu e e' + cv c c' in the tangent plane of ``normal``."""
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
