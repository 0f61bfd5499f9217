"""Verification cases of the solid without contact: small problems with exact answers (mm, N, MPa).

Each function solves one case with the simulator's own kernels and returns the number that tests and report check.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cad.materials import HyperelasticLaw, hyperelastic_law
from sensing.simulator.solid import closed_forms
from sensing.simulator.solid.element import INNER_FACE, Array, face_rule, shape_hex, shape_quad, volume_rule
from sensing.simulator.solid.mesh import HexMesh, Index, box_mesh, merge, sphere_octant_mesh
from sensing.simulator.solid.system import Solid, build_solid, factorise

NEWTON_STEPS = 30  # most Newton steps of a case


def equilibrium(solid: Solid, displacement: Array, load: Array | None = None) -> Array:
    """Displacement (n, 3), mm, under dead nodal loads, by Newton's method; values at fixed degrees of freedom are kept.

    Args:
        solid: mesh, law and fixed degrees of freedom.
        displacement: start of the iteration (n, 3), mm.
        load: nodal loads (n, 3), N; None for none.
    """
    force = np.zeros_like(displacement) if load is None else load
    for _ in range(NEWTON_STEPS):
        energy, internal = solid.energy_and_force(displacement)
        potential = energy - float((force * displacement).sum())
        residual = solid.gather(internal - force)
        if np.linalg.norm(residual) < 1e-11 * max(np.abs(internal).max(), 1e-9):
            return displacement
        change = solid.spread(factorise(solid, solid.tangent(displacement)).solve(-residual))
        step, slope = 1.0, float(residual @ solid.gather(change))
        while step > 1e-4:
            trial = displacement + step * change
            rise = solid.energy_and_force(trial)[0] - float((force * trial).sum()) - potential
            if rise <= 1e-4 * step * slope + 1e-12 * abs(energy):
                break
            step /= 2
        displacement = displacement + step * change
    return displacement


def patch_error(seed: int = 1) -> float:
    """Largest error of an affine deformation imposed on the boundary of a distorted mesh, over its size."""
    rng = np.random.default_rng(seed)
    box = box_mesh((2, 2, 2), (1.0, 1.0, 1.0))
    boundary = np.asarray(((np.abs(box.points) < 1e-9) | (np.abs(box.points - 1) < 1e-9)).any(axis=1))
    points = box.points + np.where(boundary[:, None], 0.0, rng.normal(0, 0.03, box.points.shape))
    mesh = HexMesh(points, box.cells, box.outer, box.inner)
    solid = build_solid(mesh, hyperelastic_law(0.34, 0.49), np.repeat(boundary[:, None], 3, axis=1))
    gradient = np.array([[0.2, 0.1, -0.05], [0.02, -0.1, 0.15], [0.0, 0.08, 0.05]])
    exact = points @ gradient.T
    found = equilibrium(solid, exact + np.where(boundary[:, None], 0.0, rng.normal(0, 2e-3, points.shape)))
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def lame_error(across: int, layers: int, poisson: float, inner_mm: float = 1.0, outer_mm: float = 2.0) -> float:
    """Relative L2 error of the displacement of a thick sphere under small inner pressure (linear).

    Args:
        across, layers: as in :func:`sphere_octant_mesh`.
        poisson: Poisson's ratio nu.
        inner_mm, outer_mm: inner and outer radius, mm.
    """
    law = hyperelastic_law(0.34, poisson)
    mesh = sphere_octant_mesh(inner_mm, outer_mm, across, layers)
    solid = build_solid(mesh, law, np.abs(mesh.points) < 1e-9)
    pressure = 1e-3
    load = face_load(mesh, mesh.inner, INNER_FACE, pressure)
    found = solid.spread(factorise(solid, solid.tangent(np.zeros_like(mesh.points))).solve(solid.gather(load)))
    local, _ = volume_rule()
    value, _ = shape_hex(local)
    weight = solid.data.weight
    at = np.einsum("ga,eai->egi", value, mesh.points[mesh.cells])
    radius = np.linalg.norm(at, axis=-1)
    exact = np.vectorize(
        lambda r: closed_forms.lame_displacement_mm(pressure, law.young_mpa, law.poisson, inner_mm, outer_mm, r)
    )(radius)
    wrong = np.einsum("ga,eai->egi", value, found[mesh.cells]) - at * (exact / radius)[..., None]
    return float(np.sqrt((weight * (wrong**2).sum(-1)).sum() / (weight * exact**2).sum()))


def inflated_sphere(inner_stretch: float, across: int, layers: int, poisson: float = 0.49999) -> tuple[float, float]:
    """Pressure of a neo-Hookean sphere (radii 1 and 2) inflated to an inner stretch, and the closed form (MPa).

    Args:
        inner_stretch: final hoop stretch of the inner surface.
        across, layers: as in :func:`sphere_octant_mesh`.
        poisson: Poisson's ratio nu at small strain.
    """
    law = hyperelastic_law(0.34, poisson)
    mesh = sphere_octant_mesh(1.0, 2.0, across, layers)
    on_inner = np.abs(np.linalg.norm(mesh.points, axis=1) - 1) < 1e-9
    fixed = (np.abs(mesh.points) < 1e-9) | on_inner[:, None]
    solid = build_solid(mesh, law, fixed)
    displacement = np.zeros_like(mesh.points)
    stretches = np.linspace(1, inner_stretch, 6)
    for before, stretch in pairwise(stretches):
        displacement = _isochoric_guess(mesh.points, displacement, before, stretch, on_inner)
        displacement = equilibrium(solid, displacement)
    _, internal = solid.energy_and_force(displacement)
    radial = float((internal[on_inner] * mesh.points[on_inner]).sum())
    outer_stretch = ((2.0**3 + inner_stretch**3 - 1) / 2.0**3) ** (1 / 3)
    exact = closed_forms.inflated_sphere_pressure_mpa(law.shear_mpa, inner_stretch, outer_stretch)
    return radial / (inner_stretch**2 * np.pi / 2), exact


def cantilever_ratio(poisson: float, load_n: float = 1e-4) -> float:
    """Tip deflection of a slender bar (5 x 1 x 1 elements of 4 x 1 x 1 mm) over Timoshenko's."""
    law = hyperelastic_law(0.34, poisson)
    mesh = box_mesh((5, 1, 1), (20.0, 1.0, 1.0))
    root = np.abs(mesh.points[:, 0]) < 1e-9
    fixed = np.zeros(mesh.points.shape, dtype=bool)
    fixed[root, 0] = True  # the section may contract, as in beam theory
    fixed[root & (np.abs(mesh.points[:, 1] - 0.5) < 1e-9), 1] = True
    fixed[root & (np.abs(mesh.points[:, 2] - 0.5) < 1e-9), 2] = True
    solid = build_solid(mesh, law, fixed)
    tip = np.flatnonzero(np.abs(mesh.points[:, 0] - 20) < 1e-9)
    y, z = np.rint(2 * mesh.points[tip, 1]).astype(int), np.rint(2 * mesh.points[tip, 2]).astype(int)
    simpson = np.array([1, 4, 1])
    load = np.zeros_like(mesh.points)
    load[tip, 2] = load_n * simpson[y] * simpson[z] / 36
    found = solid.spread(factorise(solid, solid.tangent(np.zeros_like(mesh.points))).solve(solid.gather(load)))
    bend = load_n * 20.0**3 / (3 * law.young_mpa / 12)
    shear = load_n * 20.0 / (5 / 6 * law.shear_mpa)
    return float(found[tip, 2].mean() / (bend + shear))


def cook_tip_mm(across: int, law: HyperelasticLaw, load_n: float = 0.1) -> float:
    """Tip deflection of Cook's membrane (48 x 44/16 mm, plane strain, 1 mm thick) under a shear load at its end.

    Args:
        across: number of elements along each side.
        law: hyperelastic constants.
        load_n: shear load, N.
    """
    box = box_mesh((across, across, 1), (1.0, 1.0, 1.0))
    x, y = 48 * box.points[:, 0], box.points[:, 1]
    points = np.stack([x, 44 / 48 * x + y * (44 - 28 / 48 * x), box.points[:, 2]], axis=1)
    mesh = merge(points[box.cells], box.outer, box.inner)
    fixed = np.zeros(mesh.points.shape, dtype=bool)
    fixed[:, 2] = True
    fixed[np.abs(mesh.points[:, 0]) < 1e-9] = True
    solid = build_solid(mesh, law, fixed)
    load = _end_shear(mesh, across, load_n)
    found = np.zeros_like(mesh.points)
    for share in np.linspace(0.25, 1, 4):
        found = equilibrium(solid, found, share * load)
    corner = np.abs(mesh.points - [48, 60, 0]).sum(axis=1).argmin()
    return float(found[corner, 1])


def face_load(mesh: HexMesh, owners: Index, face: Index, pressure_mpa: float) -> Array:
    """Nodal forces (n, 3), N, of a dead pressure on faces, pushing into the solid.

    Args:
        mesh: mesh of the solid.
        owners: cells that own the faces (f,).
        face: local numbers of a face's nodes (9,), ``INNER_FACE`` or ``OUTER_FACE``.
        pressure_mpa: pressure, MPa.
    """
    local, rule = face_rule(3)
    value, grad = shape_quad(local)
    nodes = mesh.cells[owners][:, face]
    tangent = np.einsum("gak,fai->fgik", grad, mesh.points[nodes])
    normal = np.cross(tangent[..., 0], tangent[..., 1])  # along +zeta
    sign = 1.0 if face[0] == INNER_FACE[0] else -1.0
    force = sign * pressure_mpa * np.einsum("g,ga,fgi->fai", rule, value, normal)
    load = np.zeros_like(mesh.points)
    np.add.at(load, nodes.ravel(), force.reshape(-1, 3))
    return load


def _end_shear(mesh: HexMesh, across: int, load_n: float) -> Array:
    """Nodal forces, N, of a uniform shear on the end x = 48, by Simpson weights along the edge and the thickness."""
    end = np.flatnonzero(np.abs(mesh.points[:, 0] - 48) < 1e-9)
    place = np.rint((mesh.points[end, 1] - 44) / 16 * 2 * across).astype(int)
    along = np.where(place % 2 == 1, 4.0, 2.0)
    along[(place == 0) | (place == 2 * across)] = 1.0
    through = np.array([1.0, 4.0, 1.0])[np.rint(2 * mesh.points[end, 2]).astype(int)]
    weight = along * through
    load = np.zeros_like(mesh.points)
    load[end, 1] = load_n * weight / weight.sum()
    return load


def _isochoric_guess(points: Array, before: Array, old: float, new: float, inner: Array) -> Array:
    """Incompressible radial map to the new inner stretch, exact except for the compressibility."""
    radius = np.linalg.norm(points, axis=1, keepdims=True)

    def stretched(stretch: float) -> Array:
        return points * ((radius**3 + stretch**3 - 1) ** (1 / 3) / radius)

    guess = before + stretched(new) - stretched(old)
    guess[inner] = points[inner] * (new - 1)
    return guess
