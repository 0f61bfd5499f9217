"""Sections of the verification report that compare the levels with each other and with CalculiX (mm, N)."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Sequence

import numpy as np

from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import State
from sensing.simulator.reduced.library import fit as library_fit
from sensing.simulator.reduced.library.library import Library
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import MeshDensity
from sensing.simulator.solid.shell import shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler
from sensing.simulator.verification import calculix as verify_calculix

UNSEEN_TILTS_DEG = (23.0, 50.0)  # between tilts of the fit
# States, seed and Coulomb coefficient of a path outside the fit.
UNSEEN_STATES, UNSEEN_SEED, UNSEEN_FRICTION = 30, 99, 0.5
NOT_INSTALLED = "Not installed where this report was made (`apt-get install calculix-ccx`).\n"


def table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))


def press_path() -> list[Target]:
    """Press and release in the mirror plane."""
    return [Target(normal_n=force) for force in (3, 5, 8, 11, 14, 17, 20, 18, 15, 12, 9, 6)]


def circle_path() -> list[Target]:
    """A press, then a circle of 2 mm on the plane."""
    angles = np.linspace(0, 2 * math.pi, 17)[1:]
    circle = [Target(20.0, None, (float(2 * np.sin(a)), float(2 * (1 - np.cos(a))))) for a in angles]
    return [Target(normal_n=force) for force in (5, 12, 20)] + circle


def level_2_section() -> str:
    """Level 2 against Newton's method on its mesh."""
    geometry, law = shell_geometry(130, 8), silicone().neo_hooke()
    rows = []
    for density, name, half in (
        ("data", "half, press", True), ("reference", "half, press", True), ("data", "whole, circle", False),
    ):  # fmt: skip
        model = shell_model(geometry, law, density, half=half)
        press = Press(model, Indenter(30.0), 0.5)
        path = press_path() if half else circle_path()
        sampler = surface_sampler(model, dot_directions(geometry))
        exact, slow = _walk(press, path)
        for tolerance in (1e-2, 1e-3, 1e-4):
            fast = FrozenPress(press, tolerance)
            for _round in range(2):  # the second round finds its tangents stored
                fast.fast_steps = fast.fallbacks = 0
                found, quick = _walk(fast, path)
            errors = [
                rms(sampler.sample(a.displacement - b.displacement)) / rms(sampler.sample(b.displacement))
                for a, b in zip(found, exact, strict=True)
            ]
            rows.append(
                (density, name, f"{tolerance:.0e}",
                 f"{100 * float(np.mean(errors)):.1e} %", f"{100 * max(errors):.1e} %",
                 f"{1 / slow:.1f}", f"{1 / quick:.1f}", f"{slow / quick:.0f}", f"{fast.fallbacks} of {len(path)}")
            )  # fmt: skip
    text = (
        "## Level 2 against level 1\n\nOn the same mesh, tilt 30, friction 0.5; tangents stored by an earlier pass "
        "over the path. Processor time on one core, on a machine shared with others: trust the ratio.\n\n"
    )
    return text + table(
        ("mesh", "path", "tolerance", "mean marker error", "largest", "level 1 states/s", "level 2 states/s", "ratio",
         "fall-backs"), rows,
    )  # fmt: skip


def _walk(press: Press | FrozenPress, path: Sequence[Target]) -> tuple[list[State], float]:
    """States along a path, and processor time for each, s."""
    begin = time.process_time()
    state, found = press.start(), []
    for target in path:
        state = press.advance(state, target)
        found.append(state)
    return found, (time.process_time() - begin) / len(path)


def level_4_section() -> str:
    """The library against level 2 on paths, tilts and a friction outside its fit."""
    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke(), "data")
    library = library_fit.fit_library(simulator)
    dots = simulator.surface.sampler(dot_directions(simulator.geometry))
    modes = np.array([dots.sample(mode) for mode in library.modes])
    rows, everything = [], []
    for tilt in UNSEEN_TILTS_DEG:
        samples = library_fit.sample_tilt(simulator, tilt, UNSEEN_STATES, UNSEEN_SEED, UNSEEN_FRICTION)
        simulator.forget()
        states = [sample.state for sample in samples]
        normal = np.array([s.normal_n for s in states])
        pull = np.array([s.tangential_n for s in states])
        found = library.states(np.full(len(normal), tilt), normal, pull)
        markers = library.fields(found.weights, modes)
        exact = [dots.sample(s.surface_mm) for s in states]
        wrong = np.array([rms(a - b) / rms(b) for a, b in zip(markers, exact, strict=True)])
        torque = np.array([s.wrench[3:] for s in states]) - found.wrench[:, 3:]
        use = found.inside & (normal >= 5)
        everything.append((wrong[found.inside], found.error_estimate[found.inside]))
        rows.append(
            (f"{tilt:g}", f"{int(found.inside.sum())} of {len(normal)}", f"{100 * wrong[use].mean():.2f} %",
             f"{100 * np.percentile(wrong[use], 95):.2f} %", f"{100 * found.error_estimate[use].mean():.2f} %",
             f"{rms(torque[use]) / 1000:.4f}")
        )  # fmt: skip
    wrong, estimate = (np.concatenate([part[k] for part in everything]) for k in (0, 1))
    below = int((estimate < wrong / 2).sum())
    return (
        f"## Level 4, the library\n\nFitted at tilts {', '.join(f'{t:g}' for t in library.tilt_deg)} degrees, normal "
        f"forces {library.normal_n[0]:.1f}..{library.normal_n[1]:.1f} N, T / N up to {library.cone[0]:.2f}, friction "
        f"{library_fit.FRICTION:g}; {len(library.modes)} modes, residual {100 * library.residual[0]:.2f} %. Judged on "
        f"level 2 along other paths at tilts between, with friction {UNSEEN_FRICTION:g}, N >= 5:\n\n"
        + table(("tilt", "in range", "mean marker error", "95 %", "mean estimate", "torque error, N m rms"), rows)
        + f"\nThe estimate was below half of the true error in {below} of {len(wrong)} states."
        + f" Markers, wrench and estimate of {_bulk_rate(library, modes):,.0f} states a second on one core.\n"
    )


def calculix_section() -> str:
    """Level 1 against CalculiX."""
    if shutil.which("ccx") is None:
        return f"## CalculiX\n\n{NOT_INSTALLED}"
    rows = []
    for density in (MeshDensity(4, 7, 2), MeshDensity(6, 9, 2), MeshDensity(8, 13, 2)):
        name = f"core {density.core}, rings {density.rings}, layers {density.layers}"
        found = verify_calculix.compare(density, 3.0, 1.5, tilt_deg=20.0, friction=0.4, increments=4)
        for k, step in enumerate(("press 3 mm", "then pull 1.5 mm")):
            ours, theirs = (" ".join(f"{v:.3f}" for v in w[k][[0, 2]]) for w in (found.ours, found.theirs))
            rows.append(
                (name, step, ours, theirs, f"{100 * found.force_gap[k]:.2f} %", f"{100 * found.marker_gap[k]:.2f} %")
            )
    return (
        "## CalculiX\n\nHalf a shell, tilt 20, friction 0.4, the same corner and edge nodes, law and penalties; their "
        "elements are C3D20R, ours hex27 with linear pressure, so the gap closes as the mesh gets finer.\n\n"
        + table(("mesh", "step", "our force x z, N", "theirs", "force gap", "marker gap"), rows)
    )


def _bulk_rate(library: Library, modes: Array) -> float:
    rng = np.random.default_rng(0)
    count = 40_000
    tilt = rng.uniform(library.tilt_deg[0], library.tilt_deg[-1], count)
    normal = rng.uniform(library.normal_n[0], library.normal_n[1], count)
    pull = rng.uniform(-0.4, 0.4, (count, 2)) * library.cone[0] * normal[:, None]
    begin = time.process_time()
    for k in range(0, count, 4000):
        part = slice(k, k + 4000)
        library.fields(library.states(tilt[part], normal[part], pull[part]).weights, modes)
    return count / (time.process_time() - begin)
