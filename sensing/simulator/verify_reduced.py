"""Level 3 against level 2: error, rate and honesty of its estimate on paths it was not trained on (mm, N).

:func:`judge` is shared by the report and by bench/bench_reduced.py.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from cad.materials import silicone
from sensing.simulator.element import Array
from sensing.simulator.frozen import FrozenPress
from sensing.simulator.geometry import shell_geometry
from sensing.simulator.indenter import Indenter
from sensing.simulator.press import Press, Target
from sensing.simulator.reduced_basis import ReducedModel
from sensing.simulator.reduced_press import ReducedPress, trained
from sensing.simulator.shell import shell_model
from sensing.simulator.surface import dot_directions, surface_sampler
from sensing.simulator.verify_levels import table

UNSEEN_FRICTION = 0.45
ABOVE_N = 5.0


@dataclass(frozen=True)
class Judgement:
    """Level 3 on one path.

    Attributes:
        error: relative rms marker error of every state above 5 N that level 3 answered (k,).
        estimate: what it said (k,). fallbacks: states of the path that level 2 answered. states: all.
        rate, rate_level_2: states a second of processor time, fall-backs included.
    """

    error: Array
    estimate: Array
    fallbacks: int
    states: int
    rate: float
    rate_level_2: float


def unseen_path(half: bool) -> list[Target]:
    """Up, along a figure on the plane (or to and fro, in the mirror plane), and down."""
    path = [Target(normal_n=force) for force in (3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 33.0, 24.0)]
    for angle in np.linspace(0, 2 * math.pi, 15)[1:]:
        across = 0.0 if half else 2.0 * math.sin(2 * angle)
        path.append(Target(normal_n=24.0 - 8 * math.sin(angle / 2), shift_mm=(2.5 * math.sin(angle), across)))
    return path + [Target(normal_n=force) for force in (13.0, 9.0, 5.5)]


def judge(press: Press, reduced: ReducedModel, path: list[Target]) -> Judgement:
    """Both levels along a path, each in a second round that has its tangents."""
    fast = FrozenPress(press, 1e-4)
    level_3 = ReducedPress(fast, reduced)
    dots = surface_sampler(press.model, dot_directions(press.model.geometry))
    for solver in (fast, level_3):
        for _ in range(2):
            solver.fast_steps = solver.fallbacks = 0
            begin, state, found, said = time.process_time(), solver.start(), [], []
            for target in path:
                before = solver.fallbacks
                state = solver.advance(state, target)
                found.append(state)
                said.append(level_3.error_estimate if solver.fallbacks == before else math.nan)
        seconds = time.process_time() - begin
        if solver is fast:
            exact, slow = found, seconds
    own = [k for k, state in enumerate(found) if state.normal_n >= ABOVE_N and np.isfinite(said[k])]
    there = [dots.sample(exact[k].displacement) for k in own]
    error = [
        math.sqrt(float(((dots.sample(found[k].displacement) - b) ** 2).mean() / (b**2).mean()))
        for k, b in zip(own, there, strict=True)
    ]
    count = len(path)
    return Judgement(
        np.array(error), np.array(said)[own], level_3.fallbacks, count, count / seconds, count / slow
    )  # fmt: skip


def level_3_section() -> str:
    """Half and whole shell at two tilts."""
    rows, below, total = [], 0, 0
    for half, tilt in ((True, 30.0), (False, 20.0), (False, 40.0)):
        model = shell_model(shell_geometry(130, 8), silicone().neo_hooke(), "data", half=half)
        begin = time.process_time()
        reduced = trained(model, Indenter(tilt))
        training = time.process_time() - begin
        found = judge(Press(model, Indenter(tilt), UNSEEN_FRICTION), reduced, unseen_path(half))
        below, total = below + int((found.estimate < found.error / 2).sum()), total + len(found.error)
        rows.append(
            (f"{'half' if half else 'whole'}, tilt {tilt:g}", str(len(reduced.cells)), f"{training:.0f} s",
             f"{100 * found.error.mean():.2f} %", f"{100 * np.percentile(found.error, 95):.2f} %",
             f"{100 * found.estimate.mean():.2f} %", f"{found.fallbacks} of {found.states}",
             f"{found.rate:.0f}", f"{found.rate_level_2:.0f}", f"{found.rate / found.rate_level_2:.1f}")
        )  # fmt: skip
    return (
        "## Level 3 against level 2\n\n`data` mesh, trained at friction 1, judged on another path at friction "
        f"{UNSEEN_FRICTION:g}; errors of markers where N >= {ABOVE_N:g} N and level 3 answered. Rates in states a "
        "second of processor time, fall-backs included, on a machine shared with others: trust the ratio.\n\n"
    ) + table(
        ("shell", "elements", "training", "mean error", "95 %", "mean estimate", "fall-backs", "level 3, states/s",
         "level 2", "ratio"), rows,
    ) + f"\nThe estimate was below half of the true error in {below} of {total} states.\n"  # fmt: skip
