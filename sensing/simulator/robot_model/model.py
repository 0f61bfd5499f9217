"""One endcap as a body of a robot simulator: sphere, springs, dampers, friction (m, N, kg, s; other units in names).

model = robot_model(EndcapParams(130, 8))     # its MJCF: sensing.simulator.robot_model.mjcf
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad.materials import DEFAULT_SILICONE, silicone
from cad.params import EndcapParams
from sensing.simulator.robot_model.pressed import PressedStates, pressed_states
from sensing.simulator.robot_model.stiffness import DEPTHS_MM, ShellStiffness, fitted
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.rate_effects import over_slow

FRICTION = 0.8  # E: Coulomb's mu of clean silicone on dry floors, 0.5 to 1.2
CARRIED_KG = 2.0  # E: mass on one endcap of the 12 kg robot, whose bounce determines the dampers
MOVING_SHARE = 0.25  # E: part of the silicone's mass that moves with the contact; the rest moves with the base
M = 1e-3  # m in a millimetre


@dataclass(frozen=True)
class RobotModel:
    """The contact of one endcap.

    Attributes:
        params: the design.
        silicone: row of cad/materials.csv.
        stiffness: springs of the sphere's centre on the base, N/mm.
        damping_s: damping over linear stiffness of each slide, s; 0 where the silicone has no Prony series.
        friction: Coulomb's mu of the sphere.
        torsion_m: torque about the normal over the normal force at slip, m.
        states: states of the fit, and those held out.
    """

    params: EndcapParams
    silicone: str
    stiffness: ShellStiffness
    damping_s: float
    friction: float
    torsion_m: float
    states: PressedStates

    @property
    def radius_m(self) -> float:
        """Radius of the sphere, m."""
        return self.params.outer_radius_mm * M

    @property
    def centre_m(self) -> float:
        """Height of the sphere's centre over the mating plane, m."""
        return self.params.centre_height_mm * M

    @property
    def shear_mpa(self) -> float:
        """Shear modulus of the silicone, MPa."""
        return silicone(self.silicone).neo_hooke().shear_mpa

    @property
    def damping_n_s_m(self) -> tuple[float, float]:
        """Damping of the radial and the axial slides, N s/m."""
        return (
            1e3 * self.stiffness.radial_n_mm * self.damping_s,
            1e3 * self.stiffness.axial_n_mm * self.damping_s,
        )


def robot_model(params: EndcapParams, silicone_name: str = DEFAULT_SILICONE, friction: float = FRICTION) -> RobotModel:
    """Fit an endcap (seconds; by similarity, no shell is pressed).

    Args:
        params: the design.
        silicone_name: row of cad/materials.csv.
        friction: Coulomb's mu with the ground.

    Raises:
        ParameterError: unknown silicone, a design outside the library's range, or one that snaps too early.
    """
    row, geometry = silicone(silicone_name), shell_geometry(params.diameter_mm, params.wall_mm)
    states = pressed_states(geometry, row.neo_hooke().shear_mpa)
    stiffness = fitted(states)
    damping = loss_time_s(row.prony, math.sqrt(1e3 * stiffness.axial_n_mm / CARRIED_KG)) if row.prony else 0.0
    return RobotModel(params, row.name, stiffness, damping, friction, friction * _torsion_m(states), states)


def loss_time_s(prony: tuple[tuple[float, float], ...], rate_rad_s: float) -> float:
    """Damping over stiffness with which a slide has the silicone's loss in an oscillation: G'' / (omega G_inf), s.

    Args:
        prony: pairs (g, tau_s).
        rate_rad_s: angular frequency omega, rad/s.
    """
    return sum(b * tau / (1 + (rate_rad_s * tau) ** 2) for b, tau in over_slow(prony))


def _torsion_m(states: PressedStates) -> float:
    """Torque over mu and normal force of an evenly pressed disc of radius a: 2 a / 3, m, at the middle depth."""
    used = states.where(states.is_pressed_only)
    order = np.argsort(used.depth_mm)
    area = float(np.interp(sum(DEPTHS_MM) / 2, used.depth_mm[order], used.patch_mm2[order]))
    return 2 / 3 * math.sqrt(area / math.pi) * M
