"""Speed against error of the simulator: ``python bench/bench_simulator.py`` writes bench/simulator.csv and .png.

On D = 130, T = 8, tilt 30, half model, processor time on one core: mesh density and element against the converged mesh,
contact penalty against the stiffest, both factorisations in the same run, and the levels against level 1 on the mesh
``data``, on a path and at a friction that level 3 has not seen (level 4 takes forces where this path has travel: the
verification report judges it). Minutes.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Press, Target
from sensing.simulator.scene import Scene, SceneState
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import DENSITIES, MeshDensity
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler
from sensing.simulator.solid.system import factorise, factorise_sparse
from sensing.simulator.verification.reduced import ABOVE_N, UNSEEN_FRICTION, unseen_path

FORCES_N = (2.0, 5.0, 10.0, 20.0, 35.0)
SIZE_N = 20.0
P0_MESHES = ("draft", "data", "fine", "draft, 2 layers", "data, 2 layers")  # finer in the plane and through the wall
GEOMETRY, LAW = shell_geometry(130, 8), silicone().neo_hooke()
TILTED = Indenter(30.0)
PENALTY = 25.0
HERE = Path(__file__).parent


def constant_pressure(model: ShellModel) -> ShellModel:
    """The same mesh with one pressure an element (hex27 / P0) instead of a linear one (P1)."""
    data = model.solid.data
    inverse = np.zeros_like(data.mass_inverse)
    inverse[:, 0, 0] = 1 / data.weight.sum(axis=1)
    return replace(model, solid=replace(model.solid, data=replace(data, mass_inverse=inverse)))


def run(model: ShellModel) -> dict:
    """One press: markers, seconds a step, the model."""
    sampler = surface_sampler(model, dot_directions(GEOMETRY))
    press = Press(model, TILTED, 0.5)
    state, markers = press.advance(press.start(), Target(normal_n=1.0)), []
    begin = time.process_time()
    for force in FORCES_N:
        state = press.advance(state, Target(normal_n=force))
        markers.append(sampler.sample(state.displacement))
    return {"markers": markers, "seconds": (time.process_time() - begin) / len(FORCES_N), "model": model}


def model_of(density: MeshDensity | str, penalty: float = PENALTY) -> ShellModel:
    """Half a shell."""
    return shell_model(GEOMETRY, LAW, density, half=True, penalty_ratio=penalty)


def relative(found: list, exact: list) -> list[float]:
    """Relative rms error of the markers, state by state."""
    return [float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean())) for a, b in zip(found, exact, strict=True)]


def row(curve: str, setting: str, found: dict, best: dict) -> dict:
    """One line of the table: errors at every force, and at one the size of the markers' shift over the exact one."""
    wrong = relative(found["markers"], best["markers"])
    line = {"curve": curve, "setting": setting, "unknowns": found["model"].solid.unknowns, "seconds": found["seconds"]}
    line |= {f"error_{force:g}n": error for force, error in zip(FORCES_N, wrong, strict=True)}
    at = FORCES_N.index(SIZE_N)
    line[f"size_{SIZE_N:g}n"] = float(np.sqrt((found["markers"][at] ** 2).mean() / (best["markers"][at] ** 2).mean()))
    print(line, file=sys.stderr, flush=True)
    return line


def mesh_rows() -> list[dict]:
    """Density, layers and element against the converged mesh."""
    best = run(model_of("converged"))
    settings: dict[str, ShellModel] = {name: model_of(name) for name in ("draft", "data", "fine", "reference")}
    settings |= {f"{name}, 2 layers": model_of(replace(DENSITIES[name], layers=2)) for name in ("draft", "data")}
    found = [row("mesh", name, run(model), best) for name, model in settings.items()]
    found += [row("element P0", n, run(constant_pressure(settings[n])), best) for n in P0_MESHES]
    return [*found, row("mesh", "converged", best, best)]


def penalty_rows() -> list[dict]:
    """Contact penalty over E / T."""
    stiff = run(model_of("data", 400.0))
    found = {str(value): run(model_of("data", value)) for value in (6.0, PENALTY, 100.0)}
    return [row("penalty", name, part, stiff) for name, part in {**found, "400.0": stiff}.items()]


def factor_rows() -> list[dict]:
    """One factorisation of the tangent."""
    found = []
    for name in ("data", "reference"):
        solid = model_of(name).solid
        blocks = solid.tangent(np.zeros_like(solid.mesh.points))
        matrix = solid.assemble(blocks)
        for label, call in (
            ("multifrontal", lambda s=solid, b=blocks: factorise(s, b)),
            ("superlu", lambda m=matrix: factorise_sparse(m)),
        ):
            times = []
            for _ in range(3):
                begin = time.process_time()
                call()
                times.append(time.process_time() - begin)
            found.append({"curve": "factorisation", "setting": f"{label} {name}", "unknowns": solid.unknowns,
                          "seconds": min(times)})  # fmt: skip
    return found


def level_rows() -> list[dict]:
    """Every level along one path, against level 1; the second round has what the first one taught."""
    path = unseen_path(half=True)
    found, answered = [], {}
    exact: list[SceneState] = []
    for name, level, tolerance in (("1", 1, 1e-3), ("2, 1e-2", 2, 1e-2), ("2, 1e-3", 2, 1e-3), ("3", 3, 1e-3)):
        simulator = Simulator(GEOMETRY, LAW, level=level, tolerance=tolerance)
        for _ in range(1 if level == 1 else 2):
            walk = simulator.walk(Scene(TILTED, UNSEEN_FRICTION), half=True)
            begin = time.process_time()
            states = [walk(target) for target in path]
            seconds = (time.process_time() - begin) / len(path)
        answered[name] = [simulator.markers(state) for state in states]
        exact = exact or states
        own = sum(state.level == level for state in states)
        found.append(level_row(name, seconds, answered[name], answered["1"], exact, own))
    return found


def level_row(name: str, seconds: float, markers: list, best: list, exact: list[SceneState], own: int) -> dict:
    """Mean and 95 % above 5 N."""
    wrong = np.array(relative(markers, best))[[state.normal_n >= ABOVE_N for state in exact]]
    line = {"curve": "level", "setting": name, "seconds": seconds, "mean": wrong.mean(),
            "p95": np.percentile(wrong, 95), "answered": f"{own} of {len(exact)}"}  # fmt: skip
    print(line, file=sys.stderr, flush=True)
    return line


def main() -> None:
    """Run the curves and write table and plot."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    rows = mesh_rows() + penalty_rows() + factor_rows() + level_rows()
    write_table(HERE / "simulator.csv", rows, figures=4)
    plot(rows)


def plot(rows: list[dict]) -> None:
    """Mesh and element at four forces, and the levels."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, (mesh, level) = pyplot.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    chosen = [line for line in rows if line["curve"] == "mesh" and line["setting"] in DENSITIES]
    chosen = [line for line in chosen if line["setting"] != "converged"]
    for color, force in enumerate((2, 5, 10, 35)):
        key = f"error_{force}n"
        mesh.loglog([r["seconds"] for r in chosen], [100 * r[key] for r in chosen], "o-", label=f"{force} N",
                    color=f"C{color}")  # fmt: skip
    for curve, double, mark, label in (
        ("mesh", True, "^:", "two layers"),
        ("element P0", False, "x--", "constant pressure"),
        ("element P0", True, "+:", "constant pressure, two layers"),
    ):
        part = [r for r in rows if r["curve"] == curve and r["setting"].endswith("layers") == double]
        mesh.loglog([r["seconds"] for r in part], [100 * r["error_35n"] for r in part], mark, color="C3",
                    label=f"35 N, {label}")  # fmt: skip
    for line in chosen:
        mesh.annotate(f"{line['setting']}, {line['unknowns']}", (line["seconds"], 100 * line["error_35n"]), fontsize=7,
                      xytext=(0, -11), ha="center", textcoords="offset points")  # fmt: skip
    mesh.margins(0.15)
    mesh.set_ylim(bottom=0.05)  # room for the legend
    mesh.set(xlabel="processor seconds a step", ylabel="marker error, % rms", title="Level 1: mesh and element")
    mesh.legend(fontsize=7, loc="lower left")
    _plot_levels(level, rows)
    for axes in (mesh, level):
        axes.xaxis.set_minor_formatter(ticker.NullFormatter())  # labels of less than a decade overlap
    figure.savefig(HERE / "simulator.png", dpi=100)


def _plot_levels(level: Any, rows: list[dict]) -> None:
    """Marker error of the levels against time a state."""
    levels = [line for line in rows if line["curve"] == "level" and line["mean"] > 0]
    for key, mark, label in (("mean", "o", "mean"), ("p95", "^", "95 % quantile")):
        level.loglog([1000 * r["seconds"] for r in levels], [100 * r[key] for r in levels], mark, label=label)
    for line in levels:
        words = f"level {line['setting']}".replace(", ", ", tolerance ")
        level.annotate(words, (1000 * line["seconds"], 100 * line["mean"]), fontsize=7,
                       xytext=(6, -3), textcoords="offset points")  # fmt: skip
    first = next(line for line in rows if line["curve"] == "level")
    level.axvline(1000 * first["seconds"], color="k", ls=":", label="level 1")
    data = next(line for line in rows if line["curve"] == "mesh" and line["setting"] == "data")
    level.axhline(100 * data["error_35n"], color="C7", ls="--", label="the mesh's own error, 35 N")
    level.set(xlabel="processor ms a state", ylabel="marker error, %", title="The levels, N >= 5, mesh data")
    level.legend(fontsize=7)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
