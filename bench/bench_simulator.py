"""Speed against error of the simulator: ``python bench/bench_simulator.py`` writes bench/simulator.csv and .png.

Three curves on D = 130, T = 8, tilt 30, friction 0.5 (half model, processor time on one core): mesh density against the
converged mesh, contact penalty against the stiffest, and both factorisations in the same run.
"""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import numpy as np

from cad.materials import silicone
from sensing.simulator.geometry import shell_geometry
from sensing.simulator.indenter import Indenter
from sensing.simulator.mesh import DENSITIES, MeshDensity
from sensing.simulator.press import Press, Target
from sensing.simulator.shell import shell_model
from sensing.simulator.surface import dot_directions, surface_sampler
from sensing.simulator.system import factorise, factorise_sparse

FORCES_N = (2.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
GEOMETRY, LAW = shell_geometry(130, 8), silicone().neo_hooke()
HERE = Path(__file__).parent


def run(density: MeshDensity, penalty: float) -> dict:
    """One path: markers, seconds a step, the model."""
    model = shell_model(GEOMETRY, LAW, density, half=True, penalty_ratio=penalty)
    sampler = surface_sampler(model, dot_directions(GEOMETRY))
    press = Press(model, Indenter(30.0), 0.5)
    press.advance(press.start(), Target(normal_n=1.0))  # compile
    state, markers, depths = press.start(), [], []
    begin = time.process_time()
    for force in FORCES_N:
        state = press.advance(state, Target(normal_n=force))
        markers.append(sampler.sample(state.displacement))
        depths.append(state.depth_mm)
    seconds = (time.process_time() - begin) / len(FORCES_N)
    return {"markers": markers, "depths": depths, "seconds": seconds, "model": model}


def errors(found: dict, best: dict) -> list[float]:
    """Relative rms marker error at every force."""
    pairs = zip(found["markers"], best["markers"], strict=True)
    return [float(np.sqrt(((a - b) ** 2).mean() / (b**2).mean())) for a, b in pairs]


def row(curve: str, setting: str, found: dict, wrong: list[float]) -> dict:
    """One line of the table."""
    return {
        "curve": curve, "setting": setting, "unknowns": found["model"].solid.unknowns, "seconds": found["seconds"],
        "error_2n": wrong[0], "error_5n": wrong[1], "error_15n_up": float(np.mean(wrong[3:])),
    }  # fmt: skip


def main() -> None:
    """Run the curves and write table and plot."""
    rows, curve = [], []
    best = run(DENSITIES["converged"], 25.0)
    for name in ("draft", "data", "fine", "reference", "converged"):
        found = best if name == "converged" else run(DENSITIES[name], 25.0)
        size = found["model"].solid.unknowns
        wrong = errors(found, best)
        curve.append((size, found["seconds"], wrong))
        rows.append(row("mesh", name, found, wrong))
    stiff = run(DENSITIES["data"], 400.0)
    for penalty in (6.0, 25.0, 100.0, 400.0):
        found = stiff if penalty == 400.0 else run(DENSITIES["data"], penalty)
        wrong = errors(found, stiff)
        rows.append(row("penalty", str(penalty), found, wrong))
    for name in ("data", "reference"):
        solid = shell_model(GEOMETRY, LAW, name, half=True).solid
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
            rows.append({"curve": "factorisation", "setting": f"{label} {name}", "unknowns": solid.unknowns,
                         "seconds": min(times)})  # fmt: skip
    with (HERE / "simulator.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in line.items()} for line in rows)
    plot(curve[:-1])
    for line in rows:
        print(line, file=sys.stderr)


def plot(curve: list) -> None:
    """Error against seconds a step."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5, 3.2), layout="constrained")
    for index, label in ((0, "2 N"), (1, "5 N"), (4, "20 N"), (7, "35 N")):
        axes.loglog([c[1] for c in curve], [100 * c[2][index] for c in curve], marker="o", label=label)
    for unknowns, seconds, wrong in curve:
        axes.annotate(f"{unknowns}", (seconds, 100 * wrong[7]), fontsize=7)
    axes.set(xlabel="processor seconds a press step", ylabel="marker error, % rms", title="Level 1")
    axes.legend(fontsize=7)
    figure.savefig(HERE / "simulator.png", dpi=110)


if __name__ == "__main__":
    main()
