"""Level 3 against level 2: error, rate and calibration of its error estimate on paths outside its training (mm, N).

:func:`judge` is shared by the report and by bench/bench_reduced.py and bench/bench_simulator.py.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.frozen import TOLERANCE, FrozenPress
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import State
from sensing.simulator.reduced.basis import ReducedModel
from sensing.simulator.reduced.press import ReducedPress, trained
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell import shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler
from sensing.simulator.verification.levels import table

UNSEEN_FRICTION = 0.45  # Coulomb coefficient of the path
ABOVE_N = 5.0  # normal force from which the errors of states count


@dataclass(frozen=True)
class Judgement:
    """Results of level 3 on one path.

    Attributes:
        error: relative rms marker error of every state above 5 N that level 3 solved (k,).
        estimate: level 3's estimates of these errors (k,).
        fallbacks: number of states that level 2 solved.
        states: number of all states.
        rate: states per second of processor time, fall-backs included, 1/s.
    """

    error: Array
    estimate: Array
    fallbacks: int
    states: int
    rate: float


def unseen_path(half: bool) -> list[Target]:
    """Targets up, along a figure on the plane (or to and fro, in the mirror plane), and down."""
    path = [Target(normal_n=force) for force in (3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 33.0, 24.0)]
    for angle in np.linspace(0, 2 * math.pi, 15)[1:]:
        across = 0.0 if half else 2.0 * math.sin(2 * angle)
        path.append(Target(normal_n=24.0 - 8 * math.sin(angle / 2), shift_mm=(2.5 * math.sin(angle), across)))
    return path + [Target(normal_n=force) for force in (13.0, 9.0, 5.5)]


def exact_states(press: Press, path: list[Target]) -> list[State]:
    """Level 2 states to a tenth of its default residual, as the reference."""
    fast = FrozenPress(press, TOLERANCE / 10)
    return list(accumulate(path, fast.advance, initial=fast.start()))[1:]


def level_2_rate(fast: FrozenPress, path: list[Target]) -> float:
    """States per second of processor time in a second round, which finds its tangents stored."""
    for _ in range(2):
        begin, state = time.process_time(), fast.start()
        for target in path:
            state = fast.advance(state, target)
    return len(path) / (time.process_time() - begin)


def judge(fast: FrozenPress, reduced: ReducedModel, path: list[Target], exact: list[State]) -> Judgement:
    """Results of level 3 along a path, in a second round, which finds the tangents of its fall-backs stored.

    Args:
        fast: the level 2 press.
        reduced: level 3's model of the same shell and body.
        path: its targets.
        exact: reference states along the path (:func:`exact_states`).
    """
    level_3 = ReducedPress(fast, reduced)
    dots = surface_sampler(fast.press.model, dot_directions(fast.press.model.geometry))
    for _ in range(2):
        level_3.fallbacks = 0
        begin, state, found, said = time.process_time(), level_3.start(), [], []
        for target in path:
            state = level_3.advance(state, target)
            found.append(state)
            said.append(math.nan if state.error_estimate is None else state.error_estimate)
        seconds = time.process_time() - begin
    own = [k for k, state in enumerate(found) if state.normal_n >= ABOVE_N and np.isfinite(said[k])]
    there = [dots.sample(exact[k].displacement) for k in own]
    error = [
        math.sqrt(float(((dots.sample(found[k].displacement) - b) ** 2).mean() / (b**2).mean()))
        for k, b in zip(own, there, strict=True)
    ]
    return Judgement(np.array(error), np.array(said)[own], level_3.fallbacks, len(path), len(path) / seconds)


def level_3_section(half: bool, tilts_deg: tuple[float, ...]) -> str:
    """Results of level 3 on the half or whole shell at some tilts."""
    rows, below, total = [], 0, 0
    for tilt in tilts_deg:
        model = shell_model(shell_geometry(130, 8), silicone().neo_hooke(), "data", half=half)
        begin = time.process_time()
        reduced = trained(model, Indenter(tilt))
        training = time.process_time() - begin
        press, path = Press(model, Indenter(tilt), UNSEEN_FRICTION), unseen_path(half)
        fast = FrozenPress(press)
        slow = level_2_rate(fast, path)
        found = judge(fast, reduced, path, exact_states(press, path))
        below, total = below + int((found.estimate < found.error / 2).sum()), total + len(found.error)
        rows.append(
            (f"{tilt:g}", str(len(reduced.cells)), f"{training:.0f} s",
             f"{100 * found.error.mean():.2f} %", f"{100 * np.percentile(found.error, 95):.2f} %",
             f"{100 * found.estimate.mean():.2f} %", f"{found.fallbacks} of {found.states}",
             f"{found.rate:.0f}", f"{slow:.0f}", f"{found.rate / slow:.1f}")
        )  # fmt: skip
    return (
        f"## Level 3 against level 2, {'half' if half else 'whole'} shell\n\n`data` mesh, trained at friction 1, "
        f"judged on another path at friction {UNSEEN_FRICTION:g}; errors of markers where N >= {ABOVE_N:g} N and level "
        f"3 answered, against level 2 at a tolerance of {TOLERANCE / 10:g}. Rates in states a second of processor "
        "time on one core of a machine shared with others (trust the ratio): level 3 with its fall-backs, level 2 at "
        f"{TOLERANCE:g}.\n\n"
    ) + table(
        ("tilt", "elements", "training", "mean error", "95 %", "mean estimate", "fall-backs", "level 3, states/s",
         "level 2", "ratio"), rows,
    ) + f"\nThe estimate was below half of the true error in {below} of {total} states.\n"  # fmt: skip
