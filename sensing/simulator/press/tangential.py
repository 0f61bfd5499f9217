"""Tangential force as a target: solves for the travel of the body that gives it (N, mm).

Levels 1 and 2 prescribe the travel; a target force is met by a secant iteration on it (Broyden 1965,
doi:10.1090/S0025-5718-1965-0198670-6). Every trial starts from the same accepted state, so friction has one straight
travel. Inside the cone the force rises with the travel until the patch slips as a whole; a target at the cone's edge
has no unique travel and is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.solid.element import Array

MAX_CONE_SHARE = 0.97  # of mu N: nearer to gross slip the force hardly determines the travel
TOLERANCE = 2e-3  # relative to the normal force
MAX_TRIALS = 12  # iterations on the travel
FIRST_STIFFNESS = 0.6  # tangential over normal stiffness of the dome (E): only the first trial uses it
MAX_TRAVEL_MM = 6.0  # of one trial against the last


def tangential_n(state: State, frame: Array) -> tuple[float, float]:
    """Tangential force on the shell (meridian, lateral), N."""
    _, meridian, lateral = frame.T @ state.wrench[:3]
    return float(meridian), float(lateral)


def reach(
    advance: Callable[[State, Target], State], state: State, target: Target, frame: Array, friction: float, half: bool
) -> State:
    """State at the target's normal and tangential force.

    Args:
        advance: step of a level to a target given by travel.
        state, target: start and end of the step.
        frame: contact frame of the body (3, 3).
        friction: Coulomb coefficient.
        half: whether only travel along the meridian is possible.

    Raises:
        Refusal: ``range`` outside the friction cone, ``path`` off the mirror plane or without a normal force,
            ``unconverged`` where no travel gives the force.
    """
    wanted = _checked(target, friction, half)
    assert target.normal_n is not None
    plain = replace(target, tangential_n=None)
    travel = np.array(state.shift_mm)
    slope = state.certificate.force_stiffness_n_mm if state.certificate and state.normal_n > 0 else np.nan
    slope = slope if np.isfinite(slope) and slope > 0 else 4.0
    inverse = np.eye(2) / (FIRST_STIFFNESS * slope)
    here = advance(state, replace(plain, shift_mm=(float(travel[0]), float(travel[1]))))
    wrong = np.array(tangential_n(here, frame)) - wanted
    free = 1 if half else 2
    for _ in range(MAX_TRIALS):
        if np.linalg.norm(wrong[:free]) < TOLERANCE * target.normal_n:
            return here
        change = -inverse @ wrong
        change[free:] = 0.0
        change *= min(1.0, MAX_TRAVEL_MM / float(np.linalg.norm(change)))
        travel = travel + change
        here = advance(state, replace(plain, shift_mm=(float(travel[0]), float(travel[1]))))
        now = np.array(tangential_n(here, frame)) - wanted
        turn, wrong = now - wrong, now
        along = change @ inverse @ turn
        if abs(along) > 1e-9 * float(change @ change):
            inverse = inverse + np.outer(change - inverse @ turn, change @ inverse) / along
    raise Refusal(
        "unconverged",
        f"tangential_n={target.tangential_n} was missed by {np.linalg.norm(wrong):.2g} N after {MAX_TRIALS} trials",
    )


def _checked(target: Target, friction: float, half: bool) -> Array:
    assert target.tangential_n is not None
    if target.normal_n is None or not target.normal_n > 0:
        raise Refusal("path", f"{target}: a tangential force needs a positive normal_n")
    wanted = np.array(target.tangential_n, dtype=float)
    limit = MAX_CONE_SHARE * friction * target.normal_n
    if not np.linalg.norm(wanted) <= limit:
        raise Refusal(
            "range",
            f"tangential_n={target.tangential_n} outside {limit:.3g} N ({MAX_CONE_SHARE:g} mu N): the body would "
            "slide away; lower it or raise the friction",
        )
    if half and wanted[1] != 0:
        raise Refusal("path", f"tangential_n={target.tangential_n} leaves the mirror plane: build the whole model")
    return wanted
