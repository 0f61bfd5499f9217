"""Records of one step of a press: the problem, an iterate, and the solution (N, mm)."""

from __future__ import annotations

from dataclasses import dataclass

from sensing.simulator.contact.body import Body
from sensing.simulator.contact.friction import ContactMemory, ContactResponse, respond
from sensing.simulator.contact.indenter import translation
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.shell import ShellModel

UNKNOWN_PIVOTS = -1  # of a level that factorises no tangent of its own


@dataclass(frozen=True)
class StepProblem:
    """One step: the model, the body's place, the memory of friction, and the target force.

    Attributes:
        model, body: shell and body.
        frame: columns outward, meridian, lateral (3, 3).
        friction: Coulomb coefficient.
        memory: state of friction after the last accepted step.
        shift_mm: tangential travel of the body at the end of the step, mm.
        normal_n: normal force on the whole shell, N, or None where the depth is given.
    """

    model: ShellModel
    body: Body
    frame: Array
    friction: float
    memory: ContactMemory
    shift_mm: tuple[float, float]
    normal_n: float | None

    @property
    def mesh_force_n(self) -> float | None:
        """Normal force that the mesh must carry."""
        return None if self.normal_n is None else self.normal_n * self.model.force_share

    def contact(
        self, displacement: Array, depth_mm: float, bound: Array | None, fraction: Array | None
    ) -> ContactResponse:
        """Contact response at a displacement and a depth.

        Args:
            displacement: nodal (n, 3), mm.
            depth_mm: depth of the body, mm.
            bound, fraction: (f, g) ``bound`` and ``contact_fraction`` of :func:`respond`.
        """
        position = self.model.solid.mesh.points + displacement
        moved = translation(self.frame, depth_mm, self.shift_mm)
        return respond(self.model.surface, self.memory, self.body, position, moved, self.friction, bound, fraction)


@dataclass(frozen=True)
class Iterate:
    """A configuration of a step.

    Attributes:
        displacement: nodal (n, 3), mm.
        depth_mm: depth of the body, mm.
        contact: response of the contact there.
        internal: internal nodal forces (n, 3), N.
        potential: energy minus the work of the given force, mJ (meaningful for a frozen bound).
        residual: force out of balance over the unknowns, N.
        force_gap: normal force minus its target, N; 0 where the depth is given.
        error: norm of residual and force gap, relative to the contact force.
    """

    displacement: Array
    depth_mm: float
    contact: ContactResponse
    internal: Array
    potential: float
    residual: Array
    force_gap: float
    error: float


@dataclass(frozen=True)
class Solution:
    """A converged iterate and what its last tangents showed (:class:`sensing.simulator.press.state.Certificate`).

    Attributes:
        iterate: the configuration with its forces.
        force_stiffness_n_mm: dN/dd, N/mm.
        negative_pivots: those of the last tangent; :data:`UNKNOWN_PIVOTS` where none was factorised.
        iterations: number of Newton iterations.
        errors: error after each Newton iteration, the first guess included; empty at levels 2 and 3.
    """

    iterate: Iterate
    negative_pivots: int
    force_stiffness_n_mm: float
    iterations: int
    errors: tuple[float, ...] = ()
