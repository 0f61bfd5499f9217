"""Level 2: full nonlinear residual, a stored elastic tangent, contact condensed on the patch (N, mm).

With K0 = tangent of an earlier state, the step solves by fixed-point iteration with Anderson acceleration

    u <- u - K0^-1 r(u) + K0^-1 P' f(P u, d),        r = internal forces, f = contact on the patch, d = depth

where the contact equation, P u = v + C f(P u), C = P K0^-1 P', is a small dense Newton, exact in every pass. Nothing is
left out: the fixed point is the level 1 equilibrium, and only the tolerance differs. A step whose error does not fall,
or whose contact leaves the patch, is solved by level 1, which also gives a new tangent. Level 1 keeps the sole right
to refuse a step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from sensing.simulator import newton
from sensing.simulator.contact import ContactMemory, ContactResponse, ContactSurface, respond
from sensing.simulator.element import Array
from sensing.simulator.mesh import Index
from sensing.simulator.newton import StepProblem
from sensing.simulator.press import Press, Target
from sensing.simulator.state import State
from sensing.simulator.system import Factorisation, factorise

TOLERANCE = 1e-5  # residual over contact force; the bench measures what it costs in marker error
PATCH_MARGIN_MM = 2.5  # faces nearer to the body than this belong to the patch
MAX_PASSES = 14
MAX_CONTACT_ITERATIONS = 25
HISTORY = 5  # of the acceleration
RENEW_AFTER = 9  # passes after which a step earns a new tangent
MAX_TANGENTS = 12


@dataclass(frozen=True)
class StoredTangent:
    """An elastic tangent and the patch condensed on it.

    Attributes:
        depth_mm, shift_mm: where it was taken.
        factor: factorisation of K0.
        surface: contact quadrature of the patch faces, nodes numbered within the patch.
        faces: their numbers on the whole surface. nodes: node numbers of the patch (s,).
        live: which of the 3 s patch degrees of freedom are free. rows: their unknowns.
        response: K0^-1 P' (unknowns, live). compliance: P K0^-1 P' (live, live), mm/N.
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


class FrozenPress:
    """Level 2 on top of a level 1 press; counts what it did in ``fast_steps`` and ``fallbacks``."""

    def __init__(self, press: Press, tolerance: float = TOLERANCE) -> None:
        self.press = press
        self.tolerance = tolerance
        self.tangents: list[StoredTangent] = []
        self.fast_steps = 0
        self.fallbacks = 0

    def start(self) -> State:
        """The undeformed shell (:meth:`sensing.simulator.press.Press.start`)."""
        return self.press.start()

    def advance(self, state: State, target: Target) -> State:
        """Equilibrium at ``target``; from level 1 where level 2 does not reach its tolerance.

        Raises:
            Refusal: level 1 refuses.
        """
        if self.tangents and state.contact is not None and state.normal_n > 0 and target.normal_n != 0:
            self.press.check(target)
            tangent = min(self.tangents, key=lambda t: _distance(t, state, target))
            found = self._fast(state, target, tangent)
            if found is not None:
                self.fast_steps += 1
                if found.certificate is not None and found.certificate.iterations > RENEW_AFTER:
                    self._store(found)
                return found
        self.fallbacks += 1
        found = self.press.advance(state, target)
        if found.normal_n > 0:
            self._store(found)
        return found

    def _store(self, state: State) -> None:
        self.tangents = [*self.tangents[-(MAX_TANGENTS - 1) :], stored_tangent(self.press, state)]

    def _fast(self, state: State, target: Target, tangent: StoredTangent) -> State | None:
        problem = self.press.problem(state, target)
        memory = ContactMemory(
            state.memory.traction[tangent.faces], state.memory.position[tangent.faces], state.memory.gap[tangent.faces]
        )
        depth = state.depth_mm if target.depth_mm is None else target.depth_mm
        solid = self.press.model.solid
        free = solid.gather(state.displacement)
        history: list[tuple[Array, Array]] = []
        patch = state.displacement[tangent.nodes]
        for count in range(1, MAX_PASSES + 1):
            _, internal = solid.energy_and_force(solid.spread(free))
            if not np.isfinite(internal).all():
                return None
            plain = free - tangent.factor.solve(solid.gather(internal))
            answer = _contact(problem, tangent, memory, plain, patch, depth)
            if answer is None:
                return None
            load, patch, depth, slope = answer
            image = plain + tangent.response @ load
            change = float(np.linalg.norm(image - free)) / max(float(np.linalg.norm(image)), 1e-9)
            if change < 30 * self.tolerance or count == MAX_PASSES:
                end = newton.evaluate(problem, solid.spread(image), depth)
                if end.error < self.tolerance:
                    return self.press.accept(state, target, newton.Solution(end, -1, slope, (0.0,) * (count + 1)))
            history = [*history[-HISTORY:], (free, image - free)]
            free = _accelerate(history)
        return None


def stored_tangent(press: Press, state: State) -> StoredTangent:
    """Factorise the elastic tangent of a state and condense it on the faces near the body."""
    model = press.model
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
    factor = factorise(solid.tangent(state.displacement))
    response = np.ascontiguousarray(factor.solve(unit))
    return StoredTangent(
        state.depth_mm, state.shift_mm, factor, surface, faces, nodes, live, rows, response, response[rows]
    )


def _distance(tangent: StoredTangent, state: State, target: Target) -> float:
    shift = np.hypot(tangent.shift_mm[0] - target.shift_mm[0], tangent.shift_mm[1] - target.shift_mm[1])
    depth = state.depth_mm if target.depth_mm is None else target.depth_mm
    return abs(tangent.depth_mm - depth) + 0.5 * float(shift)


def _contact(
    problem: StepProblem, tangent: StoredTangent, memory: ContactMemory, plain: Array, patch: Array, depth: float
) -> tuple[Array, Array, float, float] | None:
    """Dense Newton of x = v + C f(x, d) and N(x, d) = N_target on the patch.

    Returns:
        Contact forces (live,), patch displacement (s, 3), depth and the slope dN/dd; None where it does not converge.
    """
    points = problem.model.solid.mesh.points[tangent.nodes]
    free_place = np.zeros(3 * len(tangent.nodes))
    free_place[tangent.live] = plain[tangent.rows]
    outward = problem.frame[:, 0]
    x, target = patch.ravel().copy(), problem.mesh_force_n
    scale = max(float(np.abs(free_place).max()), 1e-6)
    slope, best = float("nan"), np.inf
    for _ in range(MAX_CONTACT_ITERATIONS):
        translation = problem.frame @ np.array([-depth, *problem.shift_mm])
        contact = respond(
            tangent.surface, memory, problem.body, points + x.reshape(-1, 3), translation, problem.friction
        )
        load = _gather(contact.force.reshape(-1, 27), tangent)
        wrong = x - free_place
        wrong[tangent.live] -= tangent.compliance @ load[tangent.live]
        force_gap = 0.0 if target is None else -float(load.reshape(-1, 3).sum(axis=0) @ outward) - target
        error = float(np.abs(wrong).max()) / scale + abs(force_gap) / max(target or 1.0, 1e-3)
        if error < 1e-8:
            return load[tangent.live], x.reshape(-1, 3), depth, slope
        change, depth_change, slope = _contact_direction(problem, tangent, contact, wrong, force_gap)
        if not np.isfinite(depth_change) or not np.isfinite(change).all():
            return None
        step = 1.0 if error < 4 * best else 0.5
        best = min(best, error)
        x, depth = x + step * change, depth + step * depth_change
    return None


def _contact_direction(
    problem: StepProblem, tangent: StoredTangent, contact: ContactResponse, wrong: Array, force_gap: float
) -> tuple[Array, float, float]:
    """Newton direction of the patch and the depth; only degrees of freedom of loaded faces enter the dense solve."""
    active = np.flatnonzero((contact.pressure > 0).any(axis=1))
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


def _accelerate(history: list[tuple[Array, Array]]) -> Array:
    """Anderson mixing (Walker, Ni 2011, doi:10.1137/10078356X) of iterates and their changes."""
    last, change = history[-1]
    if len(history) < 2:
        return last + change
    steps = np.stack([last - u for u, _ in history[:-1]], axis=1)
    turns = np.stack([change - g for _, g in history[:-1]], axis=1)
    weights, *_ = np.linalg.lstsq(turns, change, rcond=1e-8)
    return np.asarray(last + change - (steps + turns) @ weights)
