"""Sag of the skin under its own weight: in a pose other than that of the reference, the dots are displaced.

    moved = own_weight_displacement(model, silicone().density_g_cm3, (9.81, 0, 0))    # (n, 3) nodal, mm

Linear elasticity about the unloaded shape, K u = f with f_a = integral of rho g N_a dV (Bathe 2014, ch. 4). Newton's
method on the neo-Hooke law gives the same largest motion to 1 % on the side and to 6 % along the axis, even where a
large skin of the softest silicone sags by 0.16 R (D=250 T=12 in Ecoflex 00-30). The shell is clamped at its base; the
clamp carries the weight of the interlock.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sensing.simulator.solid.elasticity import element_data
from sensing.simulator.solid.element import Array, shape_hex, volume_rule
from sensing.simulator.solid.shell import ShellModel
from sensing.simulator.solid.surface import surface_sampler
from sensing.simulator.solid.system import factorise

KG_PER_MM3 = 1e-6  # density of 1 g/cm3


def nodal_mass_kg(model: ShellModel, density_g_cm3: float) -> Array:
    """(n,) part of the skin's mass that each node carries, kg; of half of it on a half model.

    Args:
        model: model of the shell.
        density_g_cm3: density of the silicone.
    """
    mesh, (shape, _) = model.solid.mesh, shape_hex(volume_rule()[0])
    volume_mm3 = element_data(mesh).weight  # those of the solid are scaled where the interlock is stiffer
    share = np.einsum("eg,ga->ea", volume_mm3, shape) * density_g_cm3 * KG_PER_MM3
    return np.bincount(mesh.cells.ravel(), share.ravel(), len(mesh.points)).astype(float)


def own_weight_displacement(model: ShellModel, density_g_cm3: float, gravity_m_s2: Sequence[float]) -> Array:
    """Nodal displacement (n, 3) from the weightless shape, mm.

    Args:
        model: model of the whole shell.
        density_g_cm3: density of the silicone.
        gravity_m_s2: (3,) acceleration of gravity, endcap frame, m/s^2.
    """
    solid = model.solid
    force = nodal_mass_kg(model, density_g_cm3)[:, None] * np.asarray(gravity_m_s2, dtype=float)
    stiffness = factorise(solid, solid.tangent(np.zeros_like(solid.mesh.points)))
    return solid.spread(stiffness.solve(solid.gather(force)))


def own_weight_profiles(model: ShellModel, density_g_cm3: float, polar_deg: Array) -> Array:
    """(P, 5) displacement of the inner surface over the polar angle, mm for a gravity of 1 m/s^2.

    Columns for gravity along x: outward and along the polar angle at azimuth 0, and along x at azimuth 90 degrees
    (where the azimuth runs along -x). For gravity along the axis: outward, and along the polar angle.

    Args:
        model: model of the whole shell.
        density_g_cm3: density of the silicone.
        polar_deg: (P,) polar angles from the tip, degrees.
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
