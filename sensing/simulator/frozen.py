"""Level 2: full nonlinear residual, a stored elastic tangent, contact condensed on the patch (N, mm).

With K0 = tangent of an earlier state, the step solves by fixed-point iteration with Anderson acceleration

    u <- u - K0^-1 r(u) + K0^-1 P' f(P u, d),        r = internal forces, f = contact on the patch, d = depth

where the contact equation, P u = v + C f(P u), C = P K0^-1 P', is a small dense Newton, exact in every pass. Nothing is
left out: the fixed point is the level 1 equilibrium, and only the tolerance differs. A step whose error does not fall,
or whose contact leaves the patch, is solved by level 1, which also gives a new tangent. Level 1 keeps the sole right
to refuse a step.
"""

from __future__ import annotations

import numpy as np

from sensing.simulator import newton
from sensing.simulator.condensed import CondensedStep, StoredTangent, stored_tangent
from sensing.simulator.element import Array
from sensing.simulator.press import Press, Target, lifted
from sensing.simulator.state import State

TOLERANCE = 1e-5  # residual over contact force; the bench measures what it costs in marker error
MAX_PASSES = 14
HISTORY = 5  # of the acceleration
RENEW_AFTER = 9  # passes after which a step earns a new tangent
MAX_TANGENTS = 12


class FrozenPress:
    """Level 2 on top of a level 1 press; counts what it did in ``fast_steps`` and ``fallbacks``."""

    def __init__(self, press: Press, tolerance: float = TOLERANCE, tangents: list[StoredTangent] | None = None) -> None:
        self.press = press
        self.tolerance = tolerance
        self.tangents = tangents if tangents is not None else []  # may be shared by presses of one model and tilt
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
        self.press.check(target)
        target = lifted(target)
        if self.tangents and state.contact is not None and state.normal_n > 0:
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
        if len(self.tangents) >= MAX_TANGENTS:
            del self.tangents[0]
        self.tangents.append(stored_tangent(self.press.model, state))

    def _fast(self, state: State, target: Target, tangent: StoredTangent) -> State | None:
        problem = self.press.problem(state, target)
        condensed = CondensedStep(problem, tangent, state.shift_mm)
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
            answer = condensed.solve(plain, patch, depth, first=count == 1)
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


def _distance(tangent: StoredTangent, state: State, target: Target) -> float:
    shift = np.hypot(tangent.shift_mm[0] - target.shift_mm[0], tangent.shift_mm[1] - target.shift_mm[1])
    depth = state.depth_mm if target.depth_mm is None else target.depth_mm
    return abs(tangent.depth_mm - depth) + 0.5 * float(shift)


def _accelerate(history: list[tuple[Array, Array]]) -> Array:
    """Anderson mixing (Walker, Ni 2011, doi:10.1137/10078356X) of iterates and their changes."""
    last, change = history[-1]
    if len(history) < 2:
        return last + change
    steps = np.stack([last - u for u, _ in history[:-1]], axis=1)
    turns = np.stack([change - g for _, g in history[:-1]], axis=1)
    weights, *_ = np.linalg.lstsq(turns, change, rcond=1e-8)
    return np.asarray(last + change - (steps + turns) @ weights)
