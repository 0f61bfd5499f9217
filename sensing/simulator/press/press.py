"""Pressing the shell: equilibria along a path of body positions or normal forces (level 1; N, mm, MPa).

    model = shell_model(shell_geometry(130, 8), silicone().neo_hooke(), half=True)
    press = Press(model, Indenter(tilt_deg=30), friction=0.5)
    state = press.advance(press.start(), Target(normal_n=20))

A step that fails is halved; one that fails at the smallest size is refused with its reason, so no state is approximate.

With a Prony series (``Press(..., prony=silicone().prony_series())``) targets state when they are reached, and each step
is solved on an equivalent elastic solid (:mod:`sensing.simulator.solid.rate_effects`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sensing.simulator.contact.friction import ContactResponse, deepest_mm, free_memory
from sensing.simulator.contact.indenter import Indenter, translation
from sensing.simulator.press import branch, newton, validity
from sensing.simulator.press.state import Certificate, Refusal, State, contact_wrench, reaction_wrench
from sensing.simulator.press.step import Solution, StepProblem
from sensing.simulator.solid import closed_forms
from sensing.simulator.solid import rate_effects as viscous
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.shell import ShellModel

MAX_HALVINGS = 6  # halvings of a step before it is refused
MAX_DEPTH_RATIO = 0.6  # of R: self-contact of the inner surface is not modelled beyond it
MAX_FRICTION = 5.0  # largest Coulomb coefficient that is accepted
FIRST_TOUCH_MM = 1e-3  # mm, first depth under a given force, and gap of a body that is lifted
WRENCH_FLOOR_N = 1e-3  # N, load below which the wrench gap counts in absolute terms


@dataclass(frozen=True)
class Target:
    """End of a step: a normal force or a depth (exactly one), and the body's tangential travel or force.

    Attributes:
        normal_n: force along the inward normal at first touch, N, or None.
        depth_mm: approach from first touch, mm, or None.
        shift_mm: tangential travel along (meridian, lateral), mm; ignored where ``tangential_n`` is given.
        tangential_n: tangential force on the shell along (meridian, lateral), N, or None. Only
            :mod:`sensing.simulator.levels` takes such a target.
        time_s: time at which it is reached, on the path's clock (s); only rate effects use it.
    """

    normal_n: float | None = None
    depth_mm: float | None = None
    shift_mm: tuple[float, float] = (0.0, 0.0)
    tangential_n: tuple[float, float] | None = None
    time_s: float | None = None


class Press:
    """A shell model pressed by a body, with friction; rate effects with a Prony series.

    Args:
        model: the shell.
        indenter: the body that presses.
        friction: Coulomb's mu, 0..5.
        prony: rate effects of the silicone, pairs (g, tau_s); none by default.

    Raises:
        Refusal: ``path`` for a body that breaks the mirror of a half model; ``range`` for a friction outside 0..5.
        ParameterError: see :func:`sensing.simulator.solid.rate_effects.checked`.
    """

    def __init__(self, model: ShellModel, indenter: Indenter, friction: float, prony: viscous.Prony = ()) -> None:
        if not 0 <= friction <= MAX_FRICTION:
            raise Refusal("range", f"friction={friction:g} outside 0..{MAX_FRICTION:g}: give Coulomb's mu of the pair")
        if model.half and not indenter.keeps_mirror:
            raise Refusal("path", f"axis_deg={indenter.axis_deg:g} breaks the mirror plane: build the whole model")
        self.model = model
        self.indenter = indenter
        self.friction = friction
        self.prony = viscous.checked(prony) if prony else ()
        self.body = indenter.body(model.geometry)
        self.frame = indenter.frame()
        self._soft_n_mm = closed_forms.point_stiffness_n_mm(model.geometry, model.solid.law)

    def start(self) -> State:
        """The undeformed shell, the body just touching."""
        points = self.model.solid.mesh.points
        memory = free_memory(self.model.surface, points, self.body)
        state = State(np.zeros_like(points), 0.0, (0.0, 0.0), memory, None, np.zeros(6), np.zeros(6), 0.0, None)
        return replace(state, history=viscous.rest(self.model.solid, self.prony)) if self.prony else state

    def advance(self, state: State, target: Target) -> State:
        """Equilibrium at ``target``, reached from ``state`` in as many sub-steps as it takes.

        Raises:
            Refusal: the path leaves the model, has no stable equilibrium, or cannot be followed.
        """
        self.check(state, target)
        target = lifted(target)
        here, done, halvings, spent, substeps, switched = state, 0.0, 0, 0, 0, False
        size = validity.first_share(self.indenter, state, target.depth_mm)
        while done < 1 - 1e-12:
            share = min(1.0, done + size)
            try:
                here = self._step(here, _between(state, target, share))
            except Refusal as refusal:
                halvings += 1
                if halvings > MAX_HALVINGS:
                    raise Refusal(
                        refusal.reason, f"{str(refusal).split(': ', 1)[1]} (the step was halved {MAX_HALVINGS} times)"
                    ) from refusal
                size /= 2
                continue
            done, substeps = share, substeps + 1
            assert here.certificate is not None
            spent += here.certificate.iterations
            switched |= here.certificate.switched
        assert here.certificate is not None
        certificate = replace(here.certificate, iterations=spent, substeps=substeps, switched=switched)
        return self.within_reach(replace(here, certificate=certificate))

    def problem(self, state: State, target: Target) -> StepProblem:
        """The step from a state to a target, for :func:`sensing.simulator.press.newton.solve`."""
        return StepProblem(
            self.step_model(state, target), self.body, self.frame, self.friction, state.memory, target.shift_mm,
            target.normal_n,
        )  # fmt: skip

    def step_model(self, state: State, target: Target) -> ShellModel:
        """The shell model of a step: with rate effects an elastic one that is valid for this step alone."""
        if state.history is None or target.time_s is None:
            return self.model
        solid = viscous.step_solid(self.model.solid, state.history, self.prony, target.time_s - state.time_s)
        return replace(self.model, solid=solid)

    def first_guess(self, state: State, target: Target) -> tuple[Array, float]:
        """Displacement and depth from which a step starts: the tangent's prediction where there is contact already."""
        if state.contact is None or not (state.contact.pressure > 0).any():
            return state.displacement, self._first_depth(state, target)
        given = target.depth_mm is not None
        depth_travel = target.depth_mm - state.depth_mm if target.depth_mm is not None else 0.0
        travel = self.frame @ np.array(
            [-depth_travel, target.shift_mm[0] - state.shift_mm[0], target.shift_mm[1] - state.shift_mm[1]]
        )
        problem = replace(self.problem(state, target), shift_mm=state.shift_mm)
        displacement, depth = newton.predict(problem, state.displacement, state.depth_mm, travel)
        return displacement, depth_travel + state.depth_mm if given else depth

    def _first_depth(self, state: State, target: Target) -> float:
        """First guess of the depth: the given one, or the last one plus the missing force over a stiffness."""
        if target.depth_mm is not None:
            return target.depth_mm
        assert target.normal_n is not None
        slope = state.certificate.force_stiffness_n_mm if state.certificate and state.normal_n > 0 else self._soft_n_mm
        slope = slope if np.isfinite(slope) and slope > 0 else self._soft_n_mm
        guess = max(state.depth_mm, 0.0) + (target.normal_n - state.normal_n) / slope
        return max(guess, FIRST_TOUCH_MM)

    def accept(self, state: State, target: Target, solution: Solution, level: int = 1, switched: bool = False) -> State:
        """State and certificate of a converged step.

        Args:
            state: state at which the step began.
            target: target at which the step ended.
            solution: converged solution of the step.
            level: level that solved it.
            switched: whether the shell buckled within the step.
        """
        here = solution.iterate
        position = self.model.solid.mesh.points + here.displacement
        wrench = contact_wrench(self.model, position, here.contact)
        reaction = reaction_wrench(self.model, here.internal)
        load = max(float(np.linalg.norm(wrench[:3])), WRENCH_FLOOR_N)
        scale = np.array([load] * 3 + [load * self.model.geometry.outer_radius_mm] * 3)
        moved = translation(self.frame, here.depth_mm, target.shift_mm)
        certificate = Certificate(
            residual=here.error,
            wrench_gap=float(np.abs((wrench - reaction) / scale).max()),
            penetration_mm=float(max(0.0, -here.contact.gap.min())),
            reach_mm=max(0.0, deepest_mm(self.model.surface, self.body, position, moved)),
            cone_excess_mpa=_cone_excess(here.contact, self.friction),
            negative_pivots=solution.negative_pivots,
            force_stiffness_n_mm=solution.force_stiffness_n_mm,
            iterations=solution.iterations,
            substeps=1,
            switched=switched,
        )
        return State(
            displacement=here.displacement,
            depth_mm=here.depth_mm,
            shift_mm=target.shift_mm,
            memory=here.contact.memory(),
            contact=here.contact,
            wrench=wrench,
            reaction=reaction,
            normal_n=0.0 - float(wrench[:3] @ self.frame[:, 0]),  # without contact 0, not -0
            certificate=certificate,
            level=level,
            time_s=state.time_s if target.time_s is None else target.time_s,
            history=self._history(state, target, here.displacement),
        )

    def within_reach(self, state: State) -> State:
        """The state itself, if the model covers it (:mod:`sensing.simulator.press.validity`).

        Raises:
            Refusal: ``mesh`` or ``range``.
        """
        return validity.require_valid(self.model, self.indenter, state)

    def _history(self, state: State, target: Target, displacement: Array) -> viscous.ViscousHistory | None:
        if state.history is None or target.time_s is None:
            return None
        return viscous.remember(self.model.solid, state.history, self.prony, target.time_s - state.time_s, displacement)

    def _step(self, state: State, target: Target) -> State:
        problem = self.problem(state, target)
        displacement, depth = self.first_guess(state, target)
        if target.normal_n is not None:
            apart = float(problem.contact(displacement, depth, None, None).gap.min())
            if apart >= 0:  # the body lies between Gauss points: move it to the nearest one
                depth += apart + FIRST_TOUCH_MM
        try:
            solution = newton.solve(problem, displacement, depth)
        except Refusal:
            self._require_measured(problem, displacement, depth)  # it gives a better reason, where it applies
            raise
        stable = solution if solution.negative_pivots == 0 else branch.leave(problem, solution)
        if stable is None:
            raise Refusal(
                "unstable",
                f"the tangent has {solution.negative_pivots} negative pivots at depth {solution.iterate.depth_mm:.3f} "
                "mm: the shell buckles here, and no stable state was found beside this one",
            )
        state = self.accept(state, target, stable, switched=stable is not solution)
        validity.require_outside(self.model, state)
        if state.depth_mm > MAX_DEPTH_RATIO * self.model.geometry.outer_radius_mm:
            raise Refusal("range", f"depth_mm={state.depth_mm:.1f} over 0.6 R: self-contact is not modelled")
        return state

    def _require_measured(self, problem: StepProblem, displacement: Array, depth_mm: float) -> None:
        """Refuse a step that failed because its body lay between the points of contact where it began."""
        moved = translation(self.frame, depth_mm, problem.shift_mm)
        reach = deepest_mm(self.model.surface, self.body, self.model.solid.mesh.points + displacement, moved)
        measured = max(0.0, -float(problem.contact(displacement, depth_mm, None, None).gap.min()))
        validity.require_measured(self.indenter, depth_mm, reach - measured)

    def check(self, state: State, target: Target) -> None:
        """Refuse a target that the model does not cover, or cannot reach from this state."""
        if (target.normal_n is None) == (target.depth_mm is None):
            raise Refusal("path", f"{target} must give exactly one of normal_n and depth_mm")
        if target.tangential_n is not None:
            raise Refusal(
                "path", f"{target}: a press moves by shift_mm; tangential forces are what levels.Simulator takes"
            )
        numbers = [v for v in (target.normal_n, target.depth_mm, *target.shift_mm, target.time_s) if v is not None]
        if not np.isfinite(numbers).all():
            raise Refusal("range", f"{target} has a number that is not finite")
        if self.prony and target.time_s is None:
            raise Refusal("path", f"{target} has no time_s: with rate effects a target must say when it is reached")
        if self.prony and target.time_s is not None and not target.time_s > state.time_s:
            raise Refusal("path", f"time_s={target.time_s:g} is not after the last state, at {state.time_s:g} s")
        if target.normal_n is not None and target.normal_n < 0:
            raise Refusal("range", f"normal_n={target.normal_n:g} pulls: the contact does not stick, give >= 0 N")
        limit = MAX_DEPTH_RATIO * self.model.geometry.outer_radius_mm
        if target.depth_mm is not None and target.depth_mm > limit:
            raise Refusal("range", f"depth_mm={target.depth_mm:g} over {limit:g} (0.6 R): self-contact is not modelled")
        if self.model.half and target.shift_mm[1] != 0:
            raise Refusal("path", f"shift_mm={target.shift_mm} leaves the mirror plane: build the whole model")


def lifted(target: Target) -> Target:
    """The target itself; at zero force, a depth at which the body is apart, because no load determines the depth."""
    return replace(target, normal_n=None, depth_mm=-FIRST_TOUCH_MM) if target.normal_n == 0 else target


def _between(state: State, target: Target, share: float) -> Target:
    """Target at a share (0..1) of the way, controlled by force or depth as the target is."""
    shift = tuple((1 - share) * a + share * b for a, b in zip(state.shift_mm, target.shift_mm, strict=True))
    time_s = None if target.time_s is None else (1 - share) * state.time_s + share * target.time_s
    here = Target(shift_mm=(shift[0], shift[1]), time_s=time_s)
    if target.normal_n is not None:
        return replace(here, normal_n=(1 - share) * state.normal_n + share * target.normal_n)
    assert target.depth_mm is not None
    return replace(here, depth_mm=(1 - share) * state.depth_mm + share * target.depth_mm)


def _cone_excess(contact: ContactResponse, friction: float) -> float:
    return float((np.linalg.norm(contact.traction, axis=-1) - friction * contact.pressure).max())
