"""Verification cases of contact: Hertz, Cattaneo-Mindlin and Reissner on the simulator's own contact (mm, N, MPa)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad.materials import hyperelastic_law, silicone
from sensing.simulator.contact.body import BodyKind, body_at
from sensing.simulator.contact.friction import PENALTY_RATIO, contact_surface, free_memory
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press import newton
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.step import StepProblem
from sensing.simulator.solid import closed_forms
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import HexMesh, MeshDensity, box_mesh, merge
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import surface_sampler
from sensing.simulator.solid.system import build_solid

BLOCK_MM, SPHERE_MM, DEPTH_MM = 12.0, 10.0, 0.1  # thickness of the block, radius of the ball, depth of the press
# Walls of Reissner's domes, mm, and their meshes; one that is a step finer in the plane or through the wall differs
# by under 1 %, and with one layer of elements the domes are 5 to 9 % softer.
DOMES = ((3.0, MeshDensity(16, 16, 2)), (2.0, MeshDensity(22, 22, 2)), (1.5, MeshDensity(28, 28, 2)))


@dataclass(frozen=True)
class BallOnBlock:
    """A rigid ball on a thick block: computed and closed-form numbers at the same normal force.

    ``pressure_scatter`` is the rms difference of Gauss point pressures from Hertz's over their rms: penalty contact at
    more points than the face has nodes lets single pressures oscillate, while their sums are right.
    """

    force_n: float
    radius_mm: float
    hertz_radius_mm: float
    pressure_scatter: float
    stick_radius_mm: float
    mindlin_radius_mm: float
    tangential_share: float


def ball_on_block(friction: float = 0.5, travel_mm: float = 0.012, elements: int = 6) -> BallOnBlock:
    """Press a ball of 10 mm into a block, then pull it sideways; nu = 0.4999 decouples normal and tangential.

    Args:
        friction: Coulomb's mu.
        travel_mm: tangential travel of the ball, mm.
        elements: number of elements of the half block along y and along z; twice as many along x.
    """
    law = hyperelastic_law(0.34, 0.4999)
    model = _block_model(elements, law.young_mpa)
    frame = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])  # outward z, meridian x, lateral y
    centre = np.array([0.0, 0.0, BLOCK_MM + SPHERE_MM])
    body = body_at(BodyKind.SPHERE, SPHERE_MM, centre, *np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]))
    points = model.solid.mesh.points
    memory = free_memory(model.surface, points, body)
    displacement = np.zeros_like(points)
    for depth, shift in [(DEPTH_MM, 0.0)] + [(DEPTH_MM, travel_mm * k / 4) for k in range(1, 5)]:
        problem = StepProblem(model, body, frame, friction, memory, (shift, 0.0), None)
        solution = newton.solve(problem, displacement, depth).iterate
        displacement, memory = solution.displacement, solution.contact.memory()
    contact, area = solution.contact, model.surface.area
    force = 2 * float((contact.pressure * area).sum())
    pull = 2 * abs(float((contact.traction[..., 0] * area).sum()))
    modulus = law.young_mpa / (1 - law.poisson**2)
    hertz = (3 * force * SPHERE_MM / (4 * modulus)) ** (1 / 3)
    live = contact.pressure > 0
    place = np.einsum("ga,fai->fgi", model.surface.shape, points[model.surface.nodes])
    inside = np.maximum(0.0, 1 - (place[..., 0] ** 2 + place[..., 1] ** 2) / hertz**2)
    exact = 1.5 * force / (math.pi * hertz**2) * np.sqrt(inside)  # Hertz's pressure
    return BallOnBlock(
        force_n=force,
        radius_mm=math.sqrt(2 * area[live].sum() / math.pi),
        hertz_radius_mm=hertz,
        pressure_scatter=float(np.sqrt(((contact.pressure - exact) ** 2 * area).sum() / (exact**2 * area).sum())),
        stick_radius_mm=math.sqrt(2 * area[live & ~contact.slipping].sum() / math.pi),
        mindlin_radius_mm=closed_forms.mindlin_stick_radius_mm(hertz, pull, force, friction),
        tangential_share=pull / (friction * force),
    )


def reissner_ratio(wall_mm: float, density: MeshDensity) -> float:
    """Stiffness of a dome under a small ball (at the inner tip, which excludes the local dent) over Reissner's.

    Args:
        wall_mm: wall of a dome of D = 130 mm, mm.
        density: density of its mesh; :data:`DOMES` has sufficiently fine ones.
    """
    geometry, law = shell_geometry(130, wall_mm), silicone().neo_hooke()
    model = shell_model(geometry, law, density, half=True)
    press = Press(model, Indenter(0.0, "sphere", 5.0), 0.0)
    force = closed_forms.point_stiffness_n_mm(geometry, law) * 0.02 * wall_mm
    state = press.advance(press.start(), Target(normal_n=force))
    tip = surface_sampler(model, np.array([[0.0, 0.0, 1.0]])).sample(state.displacement)[0, 2]
    return float(-force / tip / closed_forms.point_stiffness_n_mm(geometry, law))


def _block_model(elements: int, young_mpa: float) -> ShellModel:
    mesh = _graded_block(elements)
    fixed = np.zeros(mesh.points.shape, dtype=bool)
    fixed[np.abs(mesh.points[:, 2]) < 1e-9] = True
    fixed[np.abs(mesh.points[:, 1]) < 1e-9, 1] = True
    solid = build_solid(mesh, hyperelastic_law(0.34, 0.4999), fixed)
    surface = contact_surface(mesh, young_mpa, 0.25, PENALTY_RATIO)
    return ShellModel(shell_geometry(130, 8), solid, surface, np.flatnonzero(fixed.all(axis=1)), True)


def _graded_block(elements: int) -> HexMesh:
    """Half block y >= 0, x in -12..12, z in 0..12, refined toward the ball at the top centre."""
    box = box_mesh((2 * elements, elements, elements), (2.0, 1.0, 1.0))

    def graded(s: Array) -> Array:
        return BLOCK_MM * (0.16 * s + 0.84 * s**4)

    x, y, z = (box.points - np.array([1.0, 0.0, 0.0])).T
    points = np.stack([np.sign(x) * graded(np.abs(x)), graded(y), BLOCK_MM - graded(1 - z)], axis=1)
    return merge(points[box.cells], box.outer, box.inner)
