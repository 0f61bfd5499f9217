"""Contact condensed on the patch: a stored elastic tangent, and the small dense problem it leaves (N, mm).

With v where the patch would go without contact and C its compliance, the step is the minimum over patch displacement x
and depth d of 1/2 (x - v)' C^-1 (x - v) + contact energy(x, d) - N d, for a frozen friction bound; the true bound is
then iterated. The same two phases as level 1, on a few hundred unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from sensing.simulator.contact import ContactMemory, ContactResponse, ContactSurface, respond
from sensing.simulator.element import Array
from sensing.simulator.mesh import Index
from sensing.simulator.newton import StepProblem
from sensing.simulator.shell import ShellModel
from sensing.simulator.state import State
from sensing.simulator.system import Factorisation, factorise

PATCH_MARGIN_MM = 2.5  # faces nearer to the body than this belong to the patch
MAX_ITERATIONS = 40
CONVERGED = 1e-7  # of displacement and force, relative
TRUE_BELOW = 0.1  # error under which the true friction bound takes over
LAGGED_AFTER_RISE = 2


@dataclass(frozen=True)
class StoredTangent:
    """An elastic tangent and the patch condensed on it.

    Attributes:
        depth_mm, shift_mm: where it was taken.
        factor: factorisation of K0.
        surface: contact quadrature of the patch faces, nodes numbered within the patch.
        faces: their numbers on the whole surface. nodes: node numbers of the patch (s,).
        live: which of the 3 s patch degrees of freedom are free. rows: their unknowns.
        response: K0^-1 P' (unknowns, live). compliance: P K0^-1 P' (live, live), mm/N. stiffness: its inverse.
    """

    depth_mm: float
    shift_mm: tuple[float, float]
    factor: Factorisation
    surface: ContactSurface
    faces: Index
    nodes: Index
    live: Index
    rows: Index
    response: Array
    compliance: Array
    stiffness: Array


@dataclass(frozen=True)
class _Point:
    """One trial of the condensed step."""

    x: Array  # (3 s,)
    depth: float
    contact: ContactResponse
    load: Array  # (3 s,)
    wrong: Array  # x - v - C load (3 s,)
    force_gap: float
    error: float
    potential: float
    slope_by_x: Array  # (live,)


class CondensedStep:
    """The dense problem of one step on one stored tangent."""

    def __init__(self, problem: StepProblem, tangent: StoredTangent, last_shift_mm: tuple[float, float]) -> None:
        self.problem = problem
        self.tangent = tangent
        self.last_shift_mm = last_shift_mm
        self.points = problem.model.solid.mesh.points[tangent.nodes]
        faces, memory = tangent.faces, problem.memory
        self.memory = ContactMemory(memory.traction[faces], memory.position[faces], memory.gap[faces])

    def solve(
        self, plain: Array, patch: Array, depth_mm: float, first: bool
    ) -> tuple[Array, Array, float, float] | None:
        """Patch equilibrium.

        Args:
            plain: unknowns without contact, v over the whole solid (unknowns,).
            patch: guess of the patch displacement (s, 3). depth_mm: guess of the depth, or the given one.
            first: the guess belongs to the last state, before the body's tangential travel.

        Returns:
            Contact forces (live,), patch displacement (s, 3), depth and slope dN/dd; None where it does not converge.
        """
        free_place = np.zeros(3 * len(self.tangent.nodes))
        free_place[self.tangent.live] = plain[self.tangent.rows]
        x, slope = patch.ravel(), float("nan")
        if first:
            x, depth_mm = self._predict(free_place, x, depth_mm)
        here = self._evaluate(free_place, x, depth_mm)
        lagged, best = (1 if self.problem.friction > 0 else 0), np.inf
        for _ in range(MAX_ITERATIONS):
            if here.error < CONVERGED:
                return here.load[self.tangent.live], here.x.reshape(-1, 3), here.depth, slope
            symmetric = self.problem.friction == 0 or lagged > 0 or here.error > TRUE_BELOW
            if symmetric:
                lagged -= 1
                found = self._descend(free_place, here)
            else:
                change, depth, slope = _contact_direction(
                    self.problem, self.tangent, here.contact, here.wrong, here.force_gap
                )
                found = self._evaluate(free_place, here.x + change, here.depth + depth)
            if found is None or not np.isfinite(found.error):
                return None
            if not symmetric and found.error > 0.5 * best:
                lagged = LAGGED_AFTER_RISE
            best = min(best, found.error)
            here = found
        return None

    def _descend(self, free_place: Array, here: _Point) -> _Point | None:
        """One lagged Newton iteration with a line search on its potential."""
        friction = self.problem.friction
        bound = friction * here.contact.pressure if friction > 0 else None
        share = here.contact.share if friction > 0 else None
        frozen = self._evaluate(free_place, here.x, here.depth, bound, share) if friction > 0 else here
        change, depth, _ = _contact_direction(
            self.problem, self.tangent, frozen.contact, frozen.wrong, frozen.force_gap
        )
        slope = float(frozen.slope_by_x @ change[self.tangent.live]) + frozen.force_gap * depth
        step = 1.0
        for _ in range(14):
            trial = self._evaluate(free_place, here.x + step * change, here.depth + step * depth, bound, share)
            if trial.potential <= frozen.potential + 1e-4 * step * slope + 1e-11 * abs(frozen.potential):
                break
            if trial.error < 0.5 * frozen.error:
                break
            step /= 2
        else:
            return None
        return self._evaluate(free_place, trial.x, trial.depth) if friction > 0 else trial

    def _predict(self, free_place: Array, x: Array, depth_mm: float) -> tuple[Array, float]:
        """Linear guess: the body's tangential travel enters through the contact tangent of the last state."""
        travel_mm = np.array(
            [0.0, self.problem.shift_mm[0] - self.last_shift_mm[0], self.problem.shift_mm[1] - self.last_shift_mm[1]]
        )
        before = CondensedStep(replace(self.problem, shift_mm=self.last_shift_mm), self.tangent, self.last_shift_mm)
        here = before._evaluate(free_place, x, depth_mm)
        moved = here.contact.stiffness @ np.tile(self.problem.frame @ travel_mm, 9)
        pushed = _gather(moved, self.tangent)
        live = self.tangent.live
        wrong = here.wrong.copy()
        wrong[live] -= self.tangent.compliance @ pushed[live]
        force_gap = here.force_gap
        if self.problem.normal_n is not None:
            force_gap -= float(pushed.reshape(-1, 3).sum(axis=0) @ self.problem.frame[:, 0])
        change, depth, _ = _contact_direction(self.problem, self.tangent, here.contact, wrong, force_gap)
        return x + change, depth_mm + depth

    def _evaluate(
        self, free_place: Array, x: Array, depth: float, bound: Array | None = None, share: Array | None = None
    ) -> _Point:
        problem, tangent = self.problem, self.tangent
        translation = problem.frame @ np.array([-depth, *problem.shift_mm])
        contact = respond(
            tangent.surface, self.memory, problem.body, self.points + x.reshape(-1, 3), translation,
            problem.friction, bound, share,
        )  # fmt: skip
        load = _gather(contact.force.reshape(-1, 27), tangent)
        live = tangent.live
        apart = x - free_place
        wrong = apart.copy()
        wrong[live] -= tangent.compliance @ load[live]
        spring = tangent.stiffness @ apart[live]
        target = problem.mesh_force_n
        normal = -float(load.reshape(-1, 3).sum(axis=0) @ problem.frame[:, 0])
        force_gap = 0.0 if target is None else normal - target
        error = float(np.abs(wrong).max()) / max(float(np.abs(x).max()), 1e-3) + abs(force_gap) / (target or 1.0)
        potential = 0.5 * float(apart[live] @ spring) + contact.energy - (target or 0.0) * depth
        return _Point(x, depth, contact, load, wrong, force_gap, error, potential, spring - load[live])


def stored_tangent(model: ShellModel, state: State) -> StoredTangent:
    """Factorise the elastic tangent of a state and condense it on the faces near the body."""
    solid, whole = model.solid, model.surface
    assert state.contact is not None
    faces = np.flatnonzero(state.contact.gap.min(axis=1) < PATCH_MARGIN_MM)
    nodes, inverse = np.unique(whole.nodes[faces], return_inverse=True)
    surface = replace(
        whole, cells=whole.cells[faces], nodes=inverse.reshape(-1, 9).astype(np.int64), area=whole.area[faces]
    )
    equation = solid.equation[(3 * nodes[:, None] + np.arange(3)).ravel()]
    live = np.flatnonzero(equation >= 0)
    rows = equation[live]
    unit = np.zeros((solid.unknowns, len(rows)))
    unit[rows, np.arange(len(rows))] = 1.0
    factor = factorise(solid, solid.tangent(state.displacement))
    response = np.ascontiguousarray(factor.solve(unit))
    compliance = (response[rows] + response[rows].T) / 2
    return StoredTangent(
        state.depth_mm, state.shift_mm, factor, surface, faces, nodes, live, rows, response, compliance,
        np.linalg.inv(compliance),
    )  # fmt: skip


def _contact_direction(
    problem: StepProblem, tangent: StoredTangent, contact: ContactResponse, wrong: Array, force_gap: float
) -> tuple[Array, float, float]:
    """Newton direction of the patch and the depth; only degrees of freedom of loaded faces enter the dense solve."""
    active = np.flatnonzero((contact.pressure > 0).any(axis=1))
    if not len(active):  # the body is clear: the patch goes where the solid puts it
        return -wrong, 0.0 if problem.normal_n is None else float("nan"), 0.0
    nodes = np.unique(tangent.surface.nodes[active])
    place = np.full(len(tangent.nodes), -1)
    place[nodes] = np.arange(len(nodes))
    local = (3 * place[tangent.surface.nodes[active]][:, :, None] + np.arange(3)).reshape(-1, 27)
    stiffness = np.zeros((3 * len(nodes), 3 * len(nodes)))
    np.add.at(stiffness, (local[:, :, None], local[:, None, :]), contact.stiffness[active])
    dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
    full = np.zeros((len(wrong), len(dofs)))  # C of the loaded columns, fixed rows zero
    position = np.full(len(wrong), -1)
    position[tangent.live] = np.arange(len(tangent.live))
    free = position[dofs] >= 0
    full[np.ix_(tangent.live, np.flatnonzero(free))] = tangent.compliance[:, position[dofs[free]]]
    coupled = full @ stiffness  # (3 s, loaded)
    factor = lu_factor(np.eye(len(dofs)) + coupled[dofs])
    tiled = np.tile(problem.frame[:, 0], len(nodes))
    column, row = stiffness @ tiled, tiled @ stiffness
    kappa = float(tiled @ column)
    pushed = full @ column
    both = lu_solve(factor, np.stack([-wrong[dofs], pushed[dofs]], axis=1))
    slope = kappa - float(row @ both[:, 1])
    depth = 0.0 if problem.normal_n is None else (-force_gap - float(row @ both[:, 0])) / slope
    loaded = both[:, 0] - depth * both[:, 1]
    change = -wrong - coupled @ loaded - depth * pushed
    change[dofs] = loaded
    return change, depth, slope / problem.model.force_share


def _gather(face_force: Array, tangent: StoredTangent) -> Array:
    load = np.zeros((len(tangent.nodes), 3))
    np.add.at(load, tangent.surface.nodes.ravel(), face_force.reshape(-1, 3))
    return load.ravel()
