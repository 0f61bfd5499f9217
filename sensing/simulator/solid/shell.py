"""The shell model: geometry, silicone and mesh density, ready to press (frame of :mod:`cad.params`, mm, N, MPa)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cad import scaling
from cad.errors import ParameterError
from cad.materials import HyperelasticLaw
from sensing.simulator.contact.friction import PENALTY_RATIO, ContactSurface, contact_surface
from sensing.simulator.solid.element import Array, shape_hex, volume_rule
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import DENSITIES, Index, MeshDensity, shell_mesh
from sensing.simulator.solid.system import Solid, build_solid

PLANE_TOLERANCE_MM = 1e-6  # distance from a plane within which a node lies on it
PLAIN, RIGID = 1.0, 100.0  # stiffness of the interlock over that of silicone: silicone alone, and practically rigid


@dataclass(frozen=True)
class ShellModel:
    """A clamped shell, whole or halved in its mirror plane y = 0.

    Attributes:
        geometry: geometry of the shell.
        solid: discrete solid with clamp (and mirror plane) fixed.
        surface: contact quadrature of the outer surface.
        clamped: numbers of the nodes on the clamp (m,).
        half: whether only y >= 0 is meshed; forces of the model are then half of the shell's.
        interlock: stiffness of its stiffest part over that of silicone.
    """

    geometry: ShellGeometry
    solid: Solid
    surface: ContactSurface
    clamped: Index
    half: bool
    interlock: float = PLAIN

    @property
    def force_share(self) -> float:
        """Part of the shell's force that the mesh carries: 1, or 0.5 for a half model."""
        return 0.5 if self.half else 1.0

    def whole_wrench(self, forces: Array, points: Array) -> Array:
        """Wrench (6,) at the endcap's origin, N and N mm, of forces (n, 3) on the mesh at points (n, 3)."""
        force = forces.sum(axis=0)
        moment = np.cross(points, forces).sum(axis=0)
        if self.half:
            return np.array([2 * force[0], 0.0, 2 * force[2], 0.0, 2 * moment[1], 0.0])
        return np.concatenate([force, moment])


def shell_model(
    geometry: ShellGeometry,
    law: HyperelasticLaw,
    density: MeshDensity | str = "data",
    half: bool = False,
    penalty_ratio: float = PENALTY_RATIO,
    interlock: float = PLAIN,
) -> ShellModel:
    """Mesh a shell and prepare its solver.

    Args:
        geometry: geometry of the shell.
        law: hyperelastic constants.
        density: a name of :data:`sensing.simulator.solid.mesh.DENSITIES` or own numbers.
        half: whether only y >= 0 is meshed; such a model refuses paths that leave the mirror plane.
        penalty_ratio: contact penalty eps_n over E / T.
        interlock: stiffness of the zone that holds the TPU gyroid (GEO25) over that of silicone, in shear and bulk.

    Raises:
        ParameterError: unknown density, or an interlock that is softer than silicone or beyond rigid.
    """
    require_interlock(interlock)
    if isinstance(density, str):
        if density not in DENSITIES:
            raise ParameterError(
                f"density={density!r} is unknown: choose one of {', '.join(DENSITIES)}", name="density", value=density
            )
        density = DENSITIES[density]
    mesh = shell_mesh(geometry, density, half)
    clamped = np.flatnonzero(np.abs(mesh.points[:, 2] - geometry.clamp_height_mm) < PLANE_TOLERANCE_MM)
    fixed = np.zeros(mesh.points.shape, dtype=bool)
    fixed[clamped] = True
    if half:
        fixed[np.abs(mesh.points[:, 1]) < PLANE_TOLERANCE_MM, 1] = True
    solid = _stiffer_below(
        build_solid(mesh, law, fixed), geometry.clamp_height_mm + scaling.INTERLOCK_DEPTH_MM, interlock
    )
    surface = contact_surface(mesh, law.young_mpa, geometry.wall_mm, penalty_ratio)
    return ShellModel(geometry, solid, surface, clamped, half, interlock)


def require_interlock(interlock: float) -> None:
    """Refuse a stiffness outside the accepted range of the interlock.

    Raises:
        ParameterError: softer than silicone, or beyond rigid.
    """
    if not PLAIN <= interlock <= RIGID:
        raise ParameterError(
            f"interlock={interlock:g} outside {PLAIN:g}..{RIGID:g}: how many times as stiff as silicone it is; 1.49 is "
            "that of Smooth-Sil 950 on TPU 95A (docs/design.md)",
            name="interlock",
            value=interlock,
        )


def _stiffer_below(solid: Solid, top_mm: float, factor: float) -> Solid:
    """The solid with stresses below a height multiplied by ``factor``, as weights of its Gauss points there."""
    if factor == PLAIN:
        return solid
    local, _ = volume_rule()
    height = np.einsum("ga,ea->eg", shape_hex(local)[0], solid.mesh.points[solid.mesh.cells][:, :, 2])
    data = solid.data
    weight = data.weight * np.where(height < top_mm, factor, 1.0)
    mass = np.einsum("eg,ga,gb->eab", weight, data.psi, data.psi)
    return replace(solid, data=replace(data, weight=weight, mass_inverse=np.linalg.inv(mass)))
