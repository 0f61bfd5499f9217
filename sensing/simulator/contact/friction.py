"""Frictional contact of the outer surface with a rigid body, at Gauss points of its faces (N, mm, MPa).

Unilateral penalty pressure p = eps_n <-gap> and Coulomb friction by return map with the elastic slip as memory:

    tau_trial = tau_0 - eps_t P (y - y_0),   y = x - translation,   |tau| <= mu p          (Wriggers 2006, ch. 9)

per reference area. Two tangents: with the bound mu p frozen (``lagged``) the friction has a potential, so the step is
symmetric and an energy line search holds it; with the true bound it is unsymmetric and Newton is quadratic (for the
plane; for curved bodies the turn of the tangent plane is left out of the friction tangent).

A point that enters within a step slips only over the fraction of the step's time it was in contact
(``contact_fraction``), estimated from the gaps at both ends: without it the result would depend on the step size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sensing.simulator.contact import kernels as contact_kernels
from sensing.simulator.contact.body import Body, Distance, plugin_distance
from sensing.simulator.solid.element import OUTER_FACE, Array, face_rule, shape_quad
from sensing.simulator.solid.mesh import HexMesh, Index

POINTS_PER_SIDE = 4  # Gauss points along a side of a face at which contact is evaluated
PENALTY_RATIO = 25.0  # eps_n over E / T; the verification report measures the error that the penalty causes
TANGENTIAL_RATIO = 0.5  # eps_t over eps_n
BETWEEN_PER_SIDE = 13  # places along a face at which the body's reach between Gauss points is measured
_SIDE = np.linspace(-1, 1, BETWEEN_PER_SIDE)  # their local coordinates along a side
_BETWEEN = np.stack(np.meshgrid(_SIDE, _SIDE), axis=-1).reshape(-1, 2)  # (s, 2) local coordinates on the face
_BETWEEN_SHAPE, _ = shape_quad(_BETWEEN)  # (s, 9) shape functions there


@dataclass(frozen=True)
class ContactSurface:
    """Outer faces ready for contact.

    Attributes:
        cells: owning cell of each face (f,).
        nodes: its nodes (f, 9).
        shape: shape functions at the Gauss points (g, 9).
        area: reference area of every Gauss point (f, g), mm2.
        normal_mpa_mm, tangential_mpa_mm: penalties eps_n and eps_t.
    """

    cells: Index
    nodes: Index
    shape: Array
    area: Array
    normal_mpa_mm: float
    tangential_mpa_mm: float

    def quadrature(self) -> contact_kernels.Quadrature:
        """The arrays that the kernels take."""
        return contact_kernels.Quadrature(self.nodes, self.shape, self.area, self.normal_mpa_mm, self.tangential_mpa_mm)


@dataclass(frozen=True)
class ContactMemory:
    """State of friction after the last accepted step, at every Gauss point.

    Attributes:
        traction: friction traction tau_0 (f, g, 3), MPa.
        position: position relative to the body, y_0 (f, g, 3), mm.
        gap: distance to the body (f, g), mm.
    """

    traction: Array
    position: Array
    gap: Array

    def arrays(self) -> contact_kernels.Memory:
        """The arrays of the memory that the kernels take."""
        return contact_kernels.Memory(self.traction, self.position, self.gap)


@dataclass(frozen=True)
class ContactResponse:
    """Contact at one trial configuration.

    Attributes:
        energy: penalty and (lagged) friction potential, mJ.
        force: nodal force ON the shell by face (f, 9, 3), N.
        stiffness: derivative of -force by nodal position (f, 27, 27), N/mm.
        pressure, gap: (f, g), MPa and mm.
        traction: friction on the shell (f, g, 3), MPa.
        slipping: (f, g) boolean.
        position: y (f, g, 3), mm.
        contact_fraction: fraction of the step's time that each point was in contact (f, g).
        gradient: outward normal of the body at each point (f, g, 3).
    """

    energy: float
    force: Array
    stiffness: Array
    pressure: Array
    gap: Array
    traction: Array
    slipping: NDArray[np.bool_]
    position: Array
    contact_fraction: Array
    gradient: Array

    def memory(self) -> ContactMemory:
        """Memory for the next step."""
        return ContactMemory(self.traction, self.position, self.gap)


def contact_surface(mesh: HexMesh, young_mpa: float, wall_mm: float, ratio: float = PENALTY_RATIO) -> ContactSurface:
    """Contact quadrature of the outer faces of a mesh.

    Args:
        mesh: mesh of the shell; its outer faces are taken.
        young_mpa: Young's modulus E of the silicone, MPa.
        wall_mm: wall thickness T of the shell, mm.
        ratio: penalty eps_n over E / T.
    """
    local, rule = face_rule(POINTS_PER_SIDE)
    shape, grad = shape_quad(local)
    nodes = mesh.cells[mesh.outer][:, OUTER_FACE]
    tangent = np.einsum("gak,fai->fgik", grad, mesh.points[nodes])
    area = np.linalg.norm(np.cross(tangent[..., 0], tangent[..., 1]), axis=-1) * rule
    normal = ratio * young_mpa / wall_mm
    nodes = np.ascontiguousarray(nodes)  # one memory layout: kernels have one signature (tests/test_kernels.py)
    return ContactSurface(mesh.outer, nodes, shape, area, normal, TANGENTIAL_RATIO * normal)


def free_memory(surface: ContactSurface, position: Array, body: Body) -> ContactMemory:
    """Memory of a surface that no body has touched.

    Args:
        surface: contact quadrature.
        position: nodal positions (n, 3), mm.
        body: the body that presses, at its first touch.
    """
    y = np.einsum("ga,fai->fgi", surface.shape, position[surface.nodes])
    response = respond(
        surface, ContactMemory(np.zeros_like(y), y, np.zeros(y.shape[:2])), body, position, np.zeros(3), 0.0
    )
    return ContactMemory(np.zeros_like(y), y, np.maximum(response.gap, 0.0))


def deepest_mm(surface: ContactSurface, body: Body, position: Array, translation: Array) -> float:
    """Largest penetration of the body into the surface, mm, also between Gauss points; negative where it is apart.

    The distance is evaluated on a grid on every face, then on a finer one round the nearest point.

    Args:
        surface: outer faces that may touch.
        body: the body that presses.
        position: nodal positions (n, 3), mm.
        translation: (3,) displacement of the body from its first touch, mm.
    """
    _, nearest = _loops(plugin_distance(body.kind))
    face, place, _ = nearest(surface.nodes, _BETWEEN_SHAPE, body, position, translation)
    shape, _ = shape_quad(np.clip(_BETWEEN[place] + _BETWEEN * (_SIDE[1] - _SIDE[0]), -1, 1))
    return -float(nearest(surface.nodes[face : face + 1], shape, body, position, translation)[2])


@cache
def _loops(distance: Distance | None) -> tuple[Any, Any]:
    """(respond, nearest) of the kernels for a plug-in's signed distance; None stands for the built-in bodies.

    The same loops are compiled once a process, with the plug-in's distance in place of the built-in one, so that the
    built-in bodies lose no speed.
    """
    plain: tuple[Any, Any] = contact_kernels.respond, contact_kernels.nearest
    if distance is None:
        return plain
    names = {**vars(contact_kernels), "_distance": njit(**contact_kernels.HELPER)(distance)}
    respond, nearest = (njit(FunctionType(loop.py_func.__code__, names, loop.__name__)) for loop in plain)
    return respond, nearest


def respond(
    surface: ContactSurface,
    memory: ContactMemory,
    body: Body,
    position: Array,
    translation: Array,
    friction: float,
    bound: Array | None = None,
    contact_fraction: Array | None = None,
) -> ContactResponse:
    """Contact forces and tangents at nodal positions (n, 3) of the shell.

    Args:
        surface: contact quadrature.
        memory: last accepted state.
        body: the body that presses (:meth:`sensing.simulator.contact.indenter.Indenter.body`).
        position: nodal positions x (n, 3), mm.
        translation: displacement of the body from its place of first touch (3,), mm.
        friction: Coulomb coefficient mu.
        bound: frozen friction bound (f, g), MPa; ``None`` takes the true mu p and its derivative.
        contact_fraction: given contact-time fraction (f, g); ``None`` computes it from the gaps.
    """
    faces, points = surface.area.shape
    friction_law = contact_kernels.Friction(
        friction,
        bound is not None,
        bound if bound is not None else np.zeros((faces, points)),
        contact_fraction is not None,
        contact_fraction.copy() if contact_fraction is not None else np.ones((faces, points)),
    )
    out = contact_kernels.Response(
        force=np.zeros((faces, 9, 3)),
        stiffness=np.zeros((faces, 27, 27)),
        pressure=np.zeros((faces, points)),
        gap=np.zeros((faces, points)),
        traction=np.zeros((faces, points, 3)),
        slipping=np.zeros((faces, points), dtype=np.bool_),
        position=np.zeros((faces, points, 3)),
        gradient=np.zeros((faces, points, 3)),
    )
    energy = _loops(plugin_distance(body.kind))[0](
        surface.quadrature(), memory.arrays(), body, position, translation, friction_law, out
    )
    return ContactResponse(energy, contact_fraction=friction_law.contact_fraction, **out._asdict())
