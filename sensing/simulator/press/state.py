"""Records of one equilibrium: displacement, contact, wrench and its certificate (mm, N, N mm, MPa).

The wrench is the one that the body exerts ON the endcap, at the origin of the endcap frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from sensing.simulator.contact.friction import ContactMemory, ContactResponse
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.rate_effects import ViscousHistory
from sensing.simulator.solid.shell import ShellModel


class Refusal(EndcapError):
    """The simulator refuses a state that it cannot solve reliably; the message gives the reason.

    Attributes:
        reason: ``path`` (a path that the model does not cover), ``unconverged``, ``unstable`` (no stable equilibrium
            under this control), ``range`` (past the model's validity), ``mesh`` (too coarse to resolve this body).
        text: the message without that word.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(f"{reason}: {message}")
        self.reason, self.text = reason, message


@dataclass(frozen=True)
class Certificate:
    """Certificate of a state: the measures by which it can be trusted.

    Attributes:
        residual: norm of the force imbalance over the norm of the contact forces, or over 1 N where that is more
            (:data:`sensing.simulator.press.newton.FLOOR_N`).
        wrench_gap: largest difference of contact and clamp wrench over the load (moments over load times R).
        penetration_mm: largest at a Gauss point, mm (penalty contact violates no other condition).
        reach_mm: largest anywhere on the surface, mm; no Gauss point measures its excess over ``penetration_mm``.
        cone_excess_mpa: largest excess of friction over mu p, MPa.
        negative_pivots: number in the last symmetric tangent; 0: a stable branch at the controlled depth, -1: unknown.
        force_stiffness_n_mm: slope of normal force by depth; positive means stable under force control too.
        iterations: Newton iterations spent, sub-steps included.
        substeps: sub-steps of the last advance.
        switched: whether the shell buckled within it, so that the state lies on another branch than the one before.
    """

    residual: float
    wrench_gap: float
    penetration_mm: float
    reach_mm: float
    cone_excess_mpa: float
    negative_pivots: int
    force_stiffness_n_mm: float
    iterations: int
    substeps: int
    switched: bool = False


@dataclass(frozen=True)
class State:
    """An equilibrium on a path.

    Attributes:
        displacement: nodal (n, 3), mm.
        depth_mm: approach of the body from first touch along the inward normal, mm.
        shift_mm: tangential travel of the body along (meridian, lateral), mm.
        memory: state of friction, for the next step.
        contact: response at the Gauss points; None before the first touch.
        wrench: contact wrench on the endcap (6,), N and N mm.
        reaction: the same wrench from the reactions of the clamp (6,), N and N mm.
        normal_n: normal force along the inward normal at first touch, N.
        certificate: certificate of the state; None for the start of a path.
        level: level that solved it (1 is the full model).
        error_estimate: expected relative rms error of the markers against level 1; None where the certificate gives it.
        time_s: time on the path's clock, s.
        history: history of the material, for the next step; None without rate effects.
    """

    displacement: Array
    depth_mm: float
    shift_mm: tuple[float, float]
    memory: ContactMemory
    contact: ContactResponse | None
    wrench: Array
    reaction: Array
    normal_n: float
    certificate: Certificate | None
    level: int = 1
    error_estimate: float | None = None
    time_s: float = 0.0
    history: ViscousHistory | None = None


@dataclass(frozen=True)
class Patch:
    """The contact patch at the Gauss points that carry pressure.

    Attributes:
        position: (k, 3), mm, deformed, endcap frame.
        area: reference area of each (k,), mm2.
        pressure: (k,), MPa per reference area.
        traction: friction on the shell (k, 3), MPa per reference area.
        slipping: (k,) boolean.
    """

    position: Array
    area: Array
    pressure: Array
    traction: Array
    slipping: NDArray[np.bool_]

    @property
    def area_mm2(self) -> float:
        """Area of the patch on the mesh, mm2 (half of the shell's on a half model)."""
        return float(self.area.sum())

    def mirrored(self) -> Patch:
        """Patch of both halves, from that of the half y >= 0."""
        mirror = np.array([1.0, -1.0, 1.0])
        return Patch(
            np.concatenate([self.position, self.position * mirror]),
            np.tile(self.area, 2),
            np.tile(self.pressure, 2),
            np.concatenate([self.traction, self.traction * mirror]),
            np.tile(self.slipping, 2),
        )

    @property
    def slip_share(self) -> float:
        """Share of the normal force that slipping points carry; 0 without contact."""
        load = self.pressure * self.area
        return float(load[self.slipping].sum() / load.sum()) if len(load) else 0.0


def contact_patch(model: ShellModel, state: State) -> Patch:
    """Patch of a state; empty before the first touch."""
    if state.contact is None:
        return Patch(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=bool))
    live = state.contact.pressure > 0
    nodes = (model.solid.mesh.points + state.displacement)[model.surface.nodes]
    position = np.einsum("ga,fai->fgi", model.surface.shape, nodes)
    return Patch(
        position[live],
        model.surface.area[live],
        state.contact.pressure[live],
        state.contact.traction[live],
        state.contact.slipping[live],
    )


def contact_wrench(model: ShellModel, position: Array, contact: ContactResponse) -> Array:
    """Wrench on the endcap (6,), N and N mm, from pressure and friction at the Gauss points.

    Args:
        model: the shell.
        position: nodal positions, deformed (n, 3), mm.
        contact: response there.
    """
    touching = np.flatnonzero((contact.pressure > 0).any(axis=1))
    traction = contact.pressure[touching, :, None] * contact.gradient[touching] + contact.traction[touching]
    points = model.surface.shape @ position[model.surface.nodes[touching]]
    forces = model.surface.area[touching, :, None] * traction
    return model.whole_wrench(forces.reshape(-1, 3), points.reshape(-1, 3))


def reaction_wrench(model: ShellModel, internal: Array) -> Array:
    """Wrench on the endcap (6,), N and N mm, from the clamp's reactions, for nodal internal forces (n, 3), N."""
    clamp = model.clamped
    return -model.whole_wrench(internal[clamp], model.solid.mesh.points[clamp])
