"""Compiled loops of :mod:`sensing.simulator.contact.friction` (N, mm, MPa). Helpers are always inlined."""

# mypy: ignore-errors
from __future__ import annotations

import math
from functools import cache
from types import FunctionType
from typing import NamedTuple

import numpy as np
from numba import njit

from sensing.simulator.contact.body import BodyKind
from sensing.simulator.contact.rough import rough_distance
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.mesh import Index

_HELPER = {"forceinline": True}


class Quadrature(NamedTuple):
    """Where contact is integrated: nodes (f, 9), shape functions (g, 9), areas (f, g), penalties eps_n and eps_t."""

    nodes: Index
    shape: Array
    area: Array
    eps_n: float
    eps_t: float


class Memory(NamedTuple):
    """Friction at the last accepted state: traction and relative position (f, g, 3), gap (f, g)."""

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
    """What the kernel fills: forces, tangents and the state of every Gauss point (see ``ContactResponse``)."""

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
        position: nodal positions (n, 3), mm. translation: of the body from its first touch (3,), mm.
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


@njit(**_HELPER)
def _relative(shape, nodes, position, translation, y):
    """A point of a face as the body sees it, into ``y`` (3,)."""
    for i in range(3):
        place = 0.0
        for a in range(9):
            place += shape[a] * position[nodes[a], i]
        y[i] = place - translation[i]


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
    """Friction and its tangent of a point that holds; ``turn``: d(log contact-time fraction) by the overlap."""
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
    """Face, place (row of ``shape``) and distance (mm) where the surface is nearest to the body.

    Args:
        nodes: of the faces (f, 9). shape: shape functions at the places to look at (s, 9).
        body, position, translation: as of :func:`respond`.
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


@cache
def loops(distance=None):
    """(:func:`respond`, :func:`nearest`) for a plug-in's signed distance; None for the bodies known here.

    Args:
        distance: function of (body, y (3,), gradient (3,), hessian (3, 3)) as :func:`_distance`. The same loops are
            compiled with it in its place, once in a process: those known here lose nothing by it.
    """
    if distance is None:
        return respond, nearest
    names = {**globals(), "_distance": njit(**_HELPER)(distance)}
    return tuple(njit(FunctionType(loop.py_func.__code__, names, loop.__name__)) for loop in (respond, nearest))


@njit(**_HELPER)
def _distance(body, y, gradient, hessian):
    """Signed distance of y (3,) to the body at its first touch; fills gradient (3,) and Hessian (3, 3)."""
    hessian[:] = 0.0
    if body.kind == BodyKind.ROUGH:
        return rough_distance(body, y, gradient, hessian)
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
