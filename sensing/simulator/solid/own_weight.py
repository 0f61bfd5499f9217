"""How the skin sags under its own weight: in another pose than that in which it was zeroed, the dots lie elsewhere.

    moved = own_weight_displacement(model, silicone().density_g_cm3, (9.81, 0, 0))    # (n, 3) nodal, mm

Linear elasticity about the unloaded shape, K u = f with f_a = integral of rho g N_a dV (Bathe 2014, ch. 4): sags stay
under a hundredth of the radius. The shell on its clamp alone; body forces in the interlock are carried by the clamp.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sensing.simulator.solid.elasticity import element_data
from sensing.simulator.solid.element import Array, shape_hex, volume_rule
from sensing.simulator.solid.shell import ShellModel
from sensing.simulator.solid.surface import surface_sampler
from sensing.simulator.solid.system import factorise

KG_PER_MM3 = 1e-6  # of 1 g/cm3


def nodal_mass_kg(model: ShellModel, density_g_cm3: float) -> Array:
    """(n,) share of the skin's mass that each node carries; of half of it on a half model.

    Args:
        model: of the shell.
        density_g_cm3: of the silicone.
    """
    mesh, (shape, _) = model.solid.mesh, shape_hex(volume_rule()[0])
    volume_mm3 = element_data(mesh).weight  # those of the solid are larger where a stiffer interlock is
    share = np.einsum("eg,ga->ea", volume_mm3, shape) * density_g_cm3 * KG_PER_MM3
    return np.bincount(mesh.cells.ravel(), share.ravel(), len(mesh.points)).astype(float)


def own_weight_displacement(model: ShellModel, density_g_cm3: float, gravity_m_s2: Sequence[float]) -> Array:
    """Nodal displacement (n, 3) from the weightless shape, mm.

    Args:
        model: the whole shell.
        density_g_cm3: of the silicone.
        gravity_m_s2: (3,) acceleration along which the skin falls, endcap frame.
    """
    solid = model.solid
    force = nodal_mass_kg(model, density_g_cm3)[:, None] * np.asarray(gravity_m_s2, dtype=float)
    stiffness = factorise(solid, solid.tangent(np.zeros_like(solid.mesh.points)))
    return solid.spread(stiffness.solve(solid.gather(force)))


def own_weight_profiles(model: ShellModel, density_g_cm3: float, polar_deg: Array) -> Array:
    """(P, 5) displacement of the inner surface over the polar angle, mm by a gravity of 1 m/s^2.

    Of gravity along x: outward and along the polar angle at azimuth 0, and along x at azimuth 90 degrees (where the
    azimuth runs along -x). Of gravity along the axis: outward, and along the polar angle.

    Args:
        model: the whole shell.
        density_g_cm3: of the silicone.
        polar_deg: (P,) from the tip.
    """
    polar = np.radians(polar_deg)
    zero = np.zeros_like(polar)
    front = np.stack([np.sin(polar), zero, np.cos(polar)], axis=1)
    downward = np.stack([np.cos(polar), zero, -np.sin(polar)], axis=1)
    aside = np.stack([zero, np.sin(polar), np.cos(polar)], axis=1)
    side = own_weight_displacement(model, density_g_cm3, (1.0, 0.0, 0.0))
    along = surface_sampler(model, front).sample(own_weight_displacement(model, density_g_cm3, (0.0, 0.0, 1.0)))
    at_front = surface_sampler(model, front).sample(side)
    at_side = surface_sampler(model, aside).sample(side)
    columns = [(at_front * front).sum(1), (at_front * downward).sum(1), at_side[:, 0]]
    return np.stack([*columns, (along * front).sum(1), (along * downward).sum(1)], axis=1)
