"""Level 2: full nonlinear residual, a stored elastic tangent, contact condensed on the patch (N, mm).

With H about the inverse of the elastic tangent, the step solves by the fixed-point iteration

    u <- u - H r(u) + H P' f(P u, d),        r = internal forces, f = contact on the patch, d = depth

where the contact equation, P u = v + C f(P u), C = P H P', is a small dense Newton, exact in every pass. H is a stored
inverse that learns from every pass (:class:`sensing.simulator.press.secant.SecantInverse`); since r has no contact in
it, the updates of one step hold for the next. Nothing is left out: the fixed point is the level 1 equilibrium, and only
the tolerance differs. A step whose error does not fall, or whose contact leaves the patch, is solved by level 1, which
also gives a new tangent. Only level 1 refuses a step.

With rate effects every step has a solid of its own, a few percent stiffer and prestressed. Tangents stored on one serve
the others: r is always that of the step, and the secant updates correct the error of H.
"""

from __future__ import annotations

import numpy as np

from sensing.simulator.press import newton
from sensing.simulator.press.condensed import CondensedStep, StoredTangent, stored_tangent
from sensing.simulator.press.press import Press, Target, lifted
from sensing.simulator.press.secant import SecantInverse
from sensing.simulator.press.state import State
from sensing.simulator.press.step import UNKNOWN_PIVOTS, Iterate, Solution
from sensing.simulator.press.validity import has_passed
from sensing.simulator.solid.shell import ShellModel

CONTACT_SHARE = 1e-2  # tolerance of the contact problem of each pass over that of the step
TOLERANCE = 1e-3  # residual over contact force; the verification report measures the marker error that it causes
MAX_PASSES = 14  # passes after which level 1 solves the step
RENEW_AFTER = 11  # passes after which a new tangent is stored
MAX_TANGENTS = 16  # stored tangents of a press
STIFFNESS_N_MM = 4.0  # E: weight of forces against depths where the nearest tangent is looked for


class FrozenPress:
    """Level 2 on top of a level 1 press; ``fast_steps`` and ``fallbacks`` count the steps of either level.

    Args:
        press: the level 1 press.
        tolerance: residual over contact force.
        tangents: list of stored tangents, which grows; None for an empty one.
    """

    def __init__(self, press: Press, tolerance: float = TOLERANCE, tangents: list[StoredTangent] | None = None) -> None:
        self.press = press
        self.tolerance = tolerance
        self.tangents = tangents if tangents is not None else []  # may be shared by presses of one model and tilt
        self.fast_steps = 0
        self.fallbacks = 0
        self._inverses: dict[int, SecantInverse] = {}

    def start(self) -> State:
        """The undeformed shell (:meth:`sensing.simulator.press.press.Press.start`); drops the secant updates."""
        self._inverses = {}
        return self.press.start()

    def advance(self, state: State, target: Target) -> State:
        """Equilibrium at ``target``; from level 1 where level 2 does not reach its tolerance.

        Raises:
            Refusal: level 1 refuses.
        """
        self.press.check(state, target)
        target = lifted(target)
        if self.tangents and (target.normal_n is not None or state.normal_n > 0):
            tangent = min(self.tangents, key=lambda t: _distance(t, state, target))
            found = self._fast(state, target, tangent)
            if found is not None and not has_passed(self.press.model, found):
                self.fast_steps += 1
                if found.certificate is not None and found.certificate.iterations > RENEW_AFTER:
                    self._store(self.press.step_model(state, target), found, target)
                return self.press.within_reach(found)
        self.fallbacks += 1
        found = self.press.advance(state, target)
        if found.normal_n > 0:
            self._store(self.press.step_model(state, target), found, target)
        return found

    def _store(self, model: ShellModel, place: State | Iterate, target: Target) -> StoredTangent:
        if len(self.tangents) >= MAX_TANGENTS:
            del self.tangents[0]
        assert place.contact is not None
        force = float((model.surface.area * place.contact.pressure).sum()) / model.force_share
        self.tangents.append(
            stored_tangent(model, place.displacement, place.contact, place.depth_mm, target.shift_mm, force)
        )
        return self.tangents[-1]

    def _inverse(self, tangent: StoredTangent) -> SecantInverse:
        """The secant inverse of a stored tangent; a full one is reset."""
        known = self._inverses.get(id(tangent))
        if known is None or known.full:
            known = self._inverses[id(tangent)] = SecantInverse(tangent)
        return known

    def _fast(self, state: State, target: Target, tangent: StoredTangent, renew: bool = True) -> State | None:
        problem = self.press.problem(state, target)
        inverse = self._inverse(tangent)
        condensed = CondensedStep(problem, inverse, state.shift_mm, CONTACT_SHARE * self.tolerance)
        touched = state.contact is not None and state.normal_n > 0
        start = state.displacement if touched else tangent.displacement
        depth = state.depth_mm if touched else tangent.depth_mm
        depth = depth if target.depth_mm is None else target.depth_mm
        solid = problem.model.solid
        free, patch = solid.gather(start), start[tangent.nodes]
        force = solid.gather(solid.energy_and_force(start)[1])
        solved = inverse.solve(force)
        for count in range(1, MAX_PASSES + 1):
            plain = free - solved
            answer = condensed.solve(plain, patch, depth, first=touched and count == 1)
            if answer is None:
                return None
            load, patch, depth, slope = answer
            after = plain + inverse.push(load)
            field = solid.spread(after)
            force_after = solid.gather(solid.energy_and_force(field)[1])
            if not np.isfinite(force_after).all():
                return None
            wrong = force_after.copy()
            wrong[tangent.rows] -= load
            if np.linalg.norm(wrong) < self.tolerance * np.linalg.norm(load):
                end = newton.evaluate(problem, field, depth)
                if end.error < self.tolerance:
                    return self.press.accept(state, target, Solution(end, UNKNOWN_PIVOTS, slope, count), level=2)
                if renew:  # contact outside the patch: condense it again at the present state and continue from there
                    return self._fast(state, target, self._store(problem.model, end, target), renew=False)
                return None
            solved = inverse.learn(after - free, force_after - force, solved, inverse.solve(force_after), force_after)
            free, force = after, force_after
        return None


def _distance(tangent: StoredTangent, state: State, target: Target) -> float:
    shift = np.hypot(tangent.shift_mm[0] - target.shift_mm[0], tangent.shift_mm[1] - target.shift_mm[1])
    if target.normal_n is not None:
        return abs(tangent.normal_n - target.normal_n) / STIFFNESS_N_MM + 0.5 * float(shift)
    return abs(tangent.depth_mm - (target.depth_mm or 0.0)) + 0.5 * float(shift)
