"""What rate effects change and cost: ``python bench/bench_rate_effects.py`` writes bench/rate_effects.csv and .png.

The first circle, stick-slip travel and impact of the ``dynamic`` protocol (D = 130, T = 8, Smooth-Sil 950, level 2,
mesh ``data``), elastic and with the silicone's Prony series, one after the other in one process (processor time).
``step_error``: what halving every time step changes of the difference between both (mesh ``draft``), in percent of
the displacement.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from sensing.simulator.dataset.states import PathState, path_states
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.protocols.catalogue import load_path
from sensing.simulator.protocols.loading import LoadPath, Waypoint
from sensing.simulator.solid.geometry import shell_geometry

MOTIONS = ("circle", "stick-slip", "impact")
SEED = 0
MATERIAL = silicone()
HERE = Path(__file__).parent


def simulator(density: str, rate_effects: bool) -> Simulator:
    """Level 2 of one shell."""
    series = MATERIAL.prony_series() if rate_effects else ()
    return Simulator(shell_geometry(130, 8), MATERIAL.neo_hooke(), density, prony=series)


def follow(tools: Simulator, path: LoadPath) -> tuple[list[PathState], float]:
    """States of a path and the seconds they took."""
    tools.forget()
    begin = time.process_time()
    states, refused = path_states(tools, path)
    if refused:
        sys.exit(refused[0])
    return states, time.process_time() - begin


def solved(path: LoadPath) -> int:
    """How many equilibria an elastic run of a path needs."""
    touching = [point for point in path.waypoints if point.target is not None]
    return sum(1 + len(point.via) + (point.begins is not None) for point in touching)


def middle(a: Target, b: Target) -> Target:
    """Half way in place, force and time."""
    shift = ((a.shift_mm[0] + b.shift_mm[0]) / 2, (a.shift_mm[1] + b.shift_mm[1]) / 2)
    normal = None if b.normal_n is None else ((a.normal_n or 0.0) + b.normal_n) / 2
    depth = None if b.depth_mm is None else ((a.depth_mm or 0.0) + b.depth_mm) / 2
    return Target(normal, depth, shift, None, ((a.time_s or 0.0) + (b.time_s or 0.0)) / 2)


def refined(path: LoadPath) -> LoadPath:
    """The same path with every time step halved."""
    points: list[Waypoint] = []
    last: Target | None = None
    for point in path.waypoints:
        if point.target is None:
            points.append(point)
            last = Target(depth_mm=-point.apart_mm, time_s=point.time_s)
            continue
        via: list[Target] = []
        for target in (*point.via, *([point.begins] if point.begins else []), point.target):
            same = last is not None and (last.depth_mm is None) == (target.depth_mm is None)
            via += [middle(last, target), target] if same and last is not None else [target]
            last = target
        if point.begins is None:
            points.append(replace(point, via=tuple(via[:-1])))
        else:  # the middle of the exposure becomes its beginning: only its end is compared
            points.append(replace(point, via=tuple(via[:-2]), begins=via[-2]))
    return replace(path, waypoints=tuple(points))


def differences(found: list[PathState], still: list[PathState]) -> np.ndarray:
    """(s, 3): change of the inner surface, relative rms, and of the force, both at each contact; change of it in mm."""
    rows = []
    for a, b in zip(found, still, strict=True):
        if b.end.normal_n > 0:
            wrong, size = a.end.surface_mm - b.end.surface_mm, b.end.surface_mm
            force = np.linalg.norm(a.end.wrench[:3] - b.end.wrench[:3]) / np.linalg.norm(b.end.wrench[:3])
            largest = np.linalg.norm(wrong, axis=1).max()
            rows.append((np.sqrt((wrong**2).mean() / (size**2).mean()), force, largest))
    return np.array(rows)


def step_error(path: LoadPath) -> float:
    """Largest rms change of (with rate effects - elastic) when all steps are halved, over the displacement's rms."""
    coarse, fine = ([follow(simulator("draft", on), p)[0] for on in (True, False)] for p in (path, refined(path)))
    worst = 0.0
    for a, b, c, d in zip(*coarse, *fine, strict=True):
        if b.end.normal_n > 0:
            change = (a.end.surface_mm - b.end.surface_mm) - (c.end.surface_mm - d.end.surface_mm)
            worst = max(worst, float(np.sqrt((change**2).mean() / (b.end.surface_mm**2).mean())))
    return worst


def main() -> None:
    """Run the motions and write table and plot."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    tools = {on: simulator("data", on) for on in (False, True)}
    hit = load_path("dynamic", SEED, 2, 1)
    for on in (False, True):  # compile
        follow(simulator("draft", on), replace(hit, waypoints=hit.waypoints[:4]))
    rows, curves = [], []
    for number, name in enumerate(MOTIONS):
        path = load_path("dynamic", SEED, number, 1)
        (still, slow), (found, cost) = (follow(tools[on], path) for on in (False, True))
        wrong, count = differences(found, still), solved(path)
        extra = sum(point.target is None for point in path.waypoints) if name == "impact" else 0
        rows.append(
            {
                "motion": name, "states": count, "solved_in_the_clear": extra,
                "elastic_s_a_state": round(slow / count, 4), "rate_effects_s_a_state": round(cost / count, 4),
                "ratio": round(cost / slow, 3),
                "level_1_elastic": sum(min(s.begin.level, s.end.level) == 1 for s in still),
                "level_1_rate_effects": sum(min(s.begin.level, s.end.level) == 1 for s in found),
                "marker_change_mean_percent": round(100 * wrong[:, 0].mean(), 2),
                "marker_change_largest_percent": round(100 * wrong[:, 0].max(), 2),
                "marker_change_largest_mm": round(wrong[:, 2].max(), 3),
                "force_change_mean_percent": round(100 * wrong[:, 1].mean(), 2),
                "force_change_largest_percent": round(100 * wrong[:, 1].max(), 2),
                "step_error_percent": round(100 * step_error(path), 3),
            }
        )  # fmt: skip
        curves.append((name, wrong))
        print(rows[-1], flush=True)
    write_table(HERE / "rate_effects.csv", rows)
    plot(curves)


def plot(curves: list[tuple[str, np.ndarray]]) -> None:
    """Change of markers and force along the three motions."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8, 3), sharex=True)
    for axis, column, label in zip(axes, (0, 1), ("displacement, % rms", "force, %"), strict=True):
        for name, wrong in curves:
            axis.plot(np.arange(1, len(wrong) + 1), 100 * wrong[:, column], marker=".", label=name)
        axis.set_xlabel("frame in contact")
        axis.set_ylabel(f"change of {label}")
        axis.set_ylim(bottom=0)
    axes[0].legend()
    figure.tight_layout()
    figure.savefig(HERE / "rate_effects.png", dpi=90)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
