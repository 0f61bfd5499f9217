"""Level 3: Newton in a few displacement modes, path-true friction at every Gauss point of the patch (N, mm).

Unknowns are the mode weights q and, where the force is given, the depth d:

    [K_q + V'KcV   V'k  ] [dq]     [V'r(Vq, d)]      K_q interpolated, or from the cubature; Kc, k, kappa as in
    [k'V           kappa] [dd] = - [N - N*    ]      :mod:`sensing.simulator.press.newton`, true friction bound

Every result is then checked on the full mesh: its error estimate is |H r| / |u|, the displacement that its residual r
there would still cause, with a stored inverse H of the elastic tangent, times a factor calibrated on a path outside the
training. (The residual itself is no measure: stresses under the patch are a fifth out of balance where markers are
right to 0.3 %.) Level 2 solves the step instead if the estimate is over the limit, the step does not converge, or a
face without contact in training touches. Mode weights are computed again from each state, so levels mix on a path.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sensing.simulator.contact.friction import ContactMemory, ContactResponse, respond
from sensing.simulator.contact.indenter import Indenter, translation
from sensing.simulator.press import newton
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Press, Target, lifted
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.press.step import UNKNOWN_PIVOTS, Solution, StepProblem
from sensing.simulator.press.validity import has_passed
from sensing.simulator.reduced.basis import FRICTION, MODES, STATES, ReducedModel, reduced_model, training_states
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.shell import ShellModel
from sensing.simulator.solid.surface import dot_directions, surface_sampler

LIMIT = 0.04  # error estimate over which level 2 solves the step
CONVERGED = 2e-4  # reduced residual over the load
MAX_ITERATIONS = 25  # Newton iterations of one step
LEAST_COSINE = 1e-3  # between the tangent's error and the move; below it the tangent is not updated
MAX_LEAPS = 2  # full Newton steps of a step that may raise the residual
RENEW_AFTER = 10  # iterations after which K_q is assembled
JUDGES, JUDGE_FRICTION = 20, 0.6  # states and Coulomb coefficient of the path that calibrates ``estimate_factor``
QUANTILE = 95.0  # percent of the states of that path whose error the estimate covers


@dataclass(frozen=True)
class _Point:
    """One trial of a reduced step (mm, N)."""

    weights: Array  # q (m,)
    depth: float
    contact: ContactResponse
    internal: Array  # (m,)
    residual: Array  # (m,)
    force_gap: float
    error: float


class ReducedPress:
    """Level 3 on top of a level 2 press; ``fast_steps`` and ``fallbacks`` count the steps of either level.

    Args:
        fast: the level 2 press.
        reduced: model of the same shell and body.
        limit: error estimate over which level 2 solves the step.
    """

    def __init__(self, fast: FrozenPress, reduced: ReducedModel, limit: float = LIMIT) -> None:
        self.fast = fast
        self.press = fast.press
        self.reduced = reduced
        self.limit = limit
        self.fast_steps = 0
        self.fallbacks = 0
        self._touchable = np.zeros(len(self.press.model.surface.nodes), dtype=bool)
        self._touchable[reduced.faces] = True

    def start(self) -> State:
        """The undeformed shell."""
        return self.fast.start()

    def advance(self, state: State, target: Target) -> State:
        """Equilibrium at ``target``; from level 2 where level 3 cannot be trusted.

        Raises:
            Refusal: levels 2 and 1 refuse.
        """
        self.press.check(state, target)
        aim = lifted(target)
        if self.fast.tangents and state.normal_n > 0 and (aim.normal_n is not None or (aim.depth_mm or 0.0) > 0):
            found = self.attempt(state, aim)
            if (
                found is not None
                and found[1] * self.reduced.estimate_factor <= self.limit
                and not has_passed(self.press.model, found[0])
            ):
                self.fast_steps += 1
                estimate = found[1] * self.reduced.estimate_factor
                return self.press.within_reach(replace(found[0], error_estimate=estimate))
        self.fallbacks += 1
        return self.fast.advance(state, target)

    def attempt(self, state: State, target: Target) -> tuple[State, float] | None:
        """Solution of level 3 without a check, and its error indicator |H r| / |u|; None where there is none."""
        solid = self.press.model.solid
        step = _Step(self.reduced, self.press.problem(state, target))
        found = step.solve(self.reduced.modes.T @ solid.gather(state.displacement), state, target)
        if found is None:
            return None
        unknowns = self.reduced.modes @ found.weights
        end = newton.evaluate(step.problem, solid.spread(unknowns), found.depth)
        loaded = np.flatnonzero((end.contact.pressure > 0).any(axis=1))
        if not len(loaded) or not self._touchable[loaded].all():
            return None
        missed = self.fast.tangents[-1].factor.solve_roughly(end.residual)
        solution = Solution(end, UNKNOWN_PIVOTS, step.slope, step.spent)
        return self.press.accept(state, target, solution, level=3), float(
            np.linalg.norm(missed) / np.linalg.norm(unknowns)
        )


class _Step:
    """One reduced step: Newton's method with an elastic tangent that is kept over iterations."""

    def __init__(self, reduced: ReducedModel, problem: StepProblem) -> None:
        self.reduced = reduced
        self.problem = problem
        self.spent = 0
        self.slope = float("nan")
        self.law = problem.model.solid.law
        memory = problem.memory
        self.tangent = reduced.tangents.mean
        self.points = problem.model.solid.mesh.points[reduced.nodes]
        faces = reduced.faces
        self.memory = ContactMemory(memory.traction[faces], memory.position[faces], memory.gap[faces])

    def solve(self, weights: Array, state: State, target: Target) -> _Point | None:
        """Equilibrium, or None; the first guess is linear in the body's travel."""
        depth = state.depth_mm if target.depth_mm is None else target.depth_mm
        self.tangent = self.reduced.tangents.at(weights)
        here = self._predicted(weights, state, target) or self._evaluate(weights, depth)
        self.tangent = self.reduced.tangents.at(here.weights)
        since, own, leaps = 0, False, 0
        while here.error >= CONVERGED:
            self.spent += 1
            if self.spent > MAX_ITERATIONS or not np.isfinite(here.error):
                return None
            found = self._searched(here) if since < RENEW_AFTER else None
            since += 1
            if found is not None:
                self.tangent = _learned(self.tangent, found.weights - here.weights, found.internal - here.internal)
                here = found
            else:
                if own and since == 1:  # its own tangent fails, too: the friction has a kink on the way
                    if leaps == MAX_LEAPS:
                        return None
                    change, depth = self._direction(here, here.residual, here.force_gap)
                    here, leaps = self._evaluate(here.weights + change, here.depth + depth), leaps + 1
                    if not np.isfinite(here.error):
                        return None
                self.tangent, since, own = self.reduced.stiffness(self.law, here.weights), 0, True
        return here

    def _searched(self, here: _Point) -> _Point | None:
        change, depth = self._direction(here, here.residual, here.force_gap)
        for share in (1.0, 0.5, 0.25, 0.1):
            trial = self._evaluate(here.weights + share * change, here.depth + share * depth)
            if trial.error < (1 - 0.1 * share) * here.error:
                return trial
        return None

    def _predicted(self, weights: Array, state: State, target: Target) -> _Point | None:
        """Linear first guess from the last state: response of the shell's tangent to the travel of the body."""
        given = target.depth_mm is not None
        depth_travel = target.depth_mm - state.depth_mm if target.depth_mm is not None else 0.0
        travel = self.problem.frame @ np.array(
            [-depth_travel, target.shift_mm[0] - state.shift_mm[0], target.shift_mm[1] - state.shift_mm[1]]
        )
        standing = _Step(self.reduced, replace(self.problem, shift_mm=state.shift_mm))
        standing.tangent = self.tangent
        here = standing._evaluate(weights, state.depth_mm)
        active = np.flatnonzero((here.contact.pressure > 0).any(axis=1))
        if not len(active):
            return None
        moved = here.contact.stiffness[active] @ np.tile(travel, 9)  # dr = -moved
        residual = here.residual - moved.ravel() @ self.reduced.face_modes[active].reshape(-1, len(weights))
        gap = here.force_gap
        if not given:
            gap -= float(moved.reshape(-1, 3).sum(axis=0) @ self.problem.frame[:, 0])
        change, depth = standing._direction(here, residual, gap)
        return self._evaluate(weights + change, state.depth_mm + (depth_travel if given else depth))

    def _evaluate(self, weights: Array, depth: float) -> _Point:
        reduced, problem = self.reduced, self.problem
        position = self.points + (reduced.node_modes @ weights).reshape(-1, 3)
        moved = translation(problem.frame, depth, problem.shift_mm)
        contact = respond(reduced.surface, self.memory, problem.body, position, moved, problem.friction, None, None)
        active = np.flatnonzero((contact.pressure > 0).any(axis=1))
        load = contact.force[active]
        pushed = load.ravel() @ reduced.face_modes[active].reshape(-1, len(weights))
        internal = reduced.internal(self.law, weights)
        residual = internal - pushed
        normal = -float(load.sum(axis=(0, 1)) @ problem.frame[:, 0])
        target = problem.mesh_force_n
        gap = 0.0 if target is None else normal - target
        scale = max(float(np.linalg.norm(pushed)), 1e-3)
        error = float(np.hypot(np.linalg.norm(residual), gap)) / scale
        return _Point(weights, depth, contact, internal, residual, gap, error if np.isfinite(error) else np.inf)

    def _direction(self, here: _Point, residual: Array, force_gap: float) -> tuple[Array, float]:
        reduced, problem = self.reduced, self.problem
        active = np.flatnonzero((here.contact.pressure > 0).any(axis=1))
        modes, blocks = reduced.face_modes[active], here.contact.stiffness[active]
        count = modes.shape[2]
        flat = modes.reshape(-1, count)
        outward = np.tile(problem.frame[:, 0], 9)
        matrix = self.tangent + flat.T @ (blocks @ modes).reshape(-1, count)
        column = flat.T @ (blocks @ outward).ravel()
        row = (outward @ blocks).ravel() @ flat
        kappa = float(outward @ blocks.sum(axis=0) @ outward) if len(active) else 0.0
        both = np.asarray(np.linalg.solve(matrix, np.stack([-residual, column], axis=1)), dtype=float)
        schur = kappa - float(row @ both[:, 1])
        self.slope = schur / problem.model.force_share
        if problem.normal_n is None:
            return both[:, 0], 0.0
        if not schur > 1e-9 * max(kappa, 1e-12):
            return np.full(count, np.nan), 0.0
        depth = (-force_gap - float(row @ both[:, 0])) / schur
        return both[:, 0] - depth * both[:, 1], depth


def _learned(tangent: Array, moved: Array, changed: Array) -> Array:
    """Tangent that maps ``moved`` to ``changed``, by a symmetric rank-one change of the last one."""
    wrong = changed - tangent @ moved
    along = float(wrong @ moved)
    if abs(along) < LEAST_COSINE * float(np.linalg.norm(wrong) * np.linalg.norm(moved)):
        return tangent
    return tangent + np.outer(wrong / along, wrong)


def trained(model: ShellModel, indenter: Indenter, states: int = STATES, modes: int = MODES) -> ReducedModel:
    """Reduced model of a shell under a body: trained on level 2 along winding paths, calibrated along another.

    Args:
        model: the shell.
        indenter: the body.
        states: number of training states.
        modes: number of modes.

    Raises:
        Refusal: level 2 could solve too few states, or level 3 fails on half of the states that calibrate it.
    """
    fast = FrozenPress(Press(model, indenter, FRICTION))
    found = reduced_model(model, training_states(fast, states), modes)
    judges = FrozenPress(Press(model, indenter, JUDGE_FRICTION), tangents=fast.tangents)
    level_3 = ReducedPress(judges, found)
    exact = training_states(judges, JUDGES, seed=1)
    dots = surface_sampler(model, dot_directions(model.geometry))
    ratios = []
    for before, here in pairwise(exact):
        answer = level_3.attempt(before, Target(normal_n=here.normal_n, shift_mm=here.shift_mm))
        if answer is not None:
            missed = dots.sample(answer[0].displacement - here.displacement)
            ratios.append(_rms(missed) / _rms(dots.sample(here.displacement)) / answer[1])
    if 2 * len(ratios) < len(exact):
        raise Refusal("unconverged", f"level 3 found only {len(ratios)} of the {len(exact) - 1} states to judge it by")
    return replace(found, estimate_factor=float(np.percentile(ratios, QUANTILE)))


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
