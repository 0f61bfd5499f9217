"""What the library of states needs: ``python bench/bench_library.py``. Writes bench/library.csv and .png.

1. Nodes: surface of every node that is left out, by how many of the others serve (median over its states), the nearest
   ones first to go.
2. Nodes and paths: force error of weights for one node that is left out, by nodes and by paths that they are trained
   on, tested on the same eight paths as that shell's own simulation gives them.
3. Mesh: error of weights that know the library's ``data`` mesh of D=130 T=8, on four paths solved on other meshes.

4. Study: its figures for every node that is left out, against those of the solved shell.
5. Training: force error of weights of three sizes by the processor time that their training took, on paths held out.

Seven minutes of processor time, and ten for the training.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from bench_similarity import TEST, TRAIN, Alone, errors, own_states, some_nodes, tested_on, without
from one_line import in_one_line
from table_file import write_table

from cad.params import EndcapParams
from sensing.design.figures import figures
from sensing.design.pressed import Study
from sensing.design.weights import DesignRequest, design_weights
from sensing.learning.fit_config import FitConfig
from sensing.simulator.similarity.labelled import library_source, shell_of, solved_source
from sensing.simulator.similarity.library import Library, load_library
from sensing.simulator.similarity.nodes import NODES, Design
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.solid.geometry import shell_geometry

HERE = Path(__file__).parent
LEFT_OUT: Design = (165.0, 11.0)
NODE_COUNTS, PATH_COUNTS = (5, 7, 9), (4, 8)
MESHES = ("draft", "data", "fine")
TRAINED: tuple[Design, ...] = ((110.0, 8.5), (165.0, 11.0), (200.0, 16.0))
EPOCHS = (1, 3, 7, 20, 60)
STUDIED = ("stiffness_0_n_mm", "stiffness_25_n_mm", "stiffness_50_n_mm", "safe_n", "strain_percent", "depth_mm")
STUDIED += ("patch_mm2", "px_per_n", "bound_10_n", "bound_25_n", "bound_40_n", "bound_50_n", "bound_nm")
FIRST = (0, 1, 4, 6, 7)  # nodes at the ends of the region: those a library starts with
COLUMNS = (
    "study", "diameter_mm", "wall_mm", "nodes", "paths", "mesh", "surface_percent", "force_percent", "off_percent",
    "train_cpu_s",
)  # fmt: skip


def surface_percent(library: Library, design: Design) -> float:
    """Median over the states: how far the interpolated surface is from the node's own."""
    ratios = ShellRatios.of(shell_geometry(*design))
    a, b = library.states(ratios), own_states(design, Path()).states(ratios)
    known = a.known & b.known
    off = np.linalg.norm((a.surface - b.surface)[known], axis=(1, 2)) / np.linalg.norm(b.surface[known], axis=(1, 2))
    return 100 * float(np.median(off))


def by_nodes() -> list[dict[str, Any]]:
    """Surface of each node from the others, as the library grew."""
    library, rows = load_library(), []
    for left, design in enumerate(NODES):
        others = [k for k in (*FIRST, *(k for k in range(len(NODES)) if k not in FIRST)) if k != left]
        for count in range(len(FIRST), len(NODES)) if left not in FIRST else ():
            found = surface_percent(some_nodes(library, others[:count]), design)
            rows.append(_row("nodes", design, count, 24, "data", surface_percent=found))
    return rows


def by_nodes_and_paths() -> list[dict[str, Any]]:
    """Weights for the shell that is left out."""
    library, rows = load_library(), []
    others = [*FIRST, *(k for k in range(len(NODES)) if k not in FIRST and NODES[k] != LEFT_OUT)]
    cases = [(count, 16) for count in sorted({*NODE_COUNTS, len(others)})]
    cases += [(len(others), paths) for paths in PATH_COUNTS]
    for count, paths in [*cases, (0, 16)]:
        request = DesignRequest(EndcapParams(*LEFT_OUT), pictures=False, numbers=TRAIN[:: 16 // paths])
        simulator, scale = shell_of(request.data("off", 1))
        own = own_states(LEFT_OUT, Path())
        served: Library | Alone = own if not count else some_nodes(library, others[:count])
        model = design_weights(request, FitConfig(), None, library_source(simulator, served))
        error = errors(model, tested_on(request, TEST, library_source(simulator, own))).force_n
        off = surface_percent(served, LEFT_OUT) if isinstance(served, Library) else 0.0
        percent = 100 * error / scale.top_n
        rows.append(_row("nodes and paths", LEFT_OUT, count, paths, "data", surface_percent=off, force_percent=percent))
        print(rows[-1], flush=True)
    return rows


def by_study() -> list[dict[str, Any]]:
    """Figures of the study without a node against the same with it, which is the solved shell's own."""
    library, rows = load_library(), []
    for left, design in enumerate(NODES):
        if left in FIRST:
            continue
        served = without(library, left)
        quick, full = (_figures(design, which) for which in (served, library))
        for name, value in full.items():
            off = 100 * (quick[name] / value - 1)
            rows.append(_row(f"study: {name}", design, len(NODES) - 1, 24, "data", off_percent=off))
    return rows


def _figures(design: Design, library: Library) -> dict[str, float]:
    names = [f"sensing.design.{module}.load_library" for module in ("pressed", "bound")]
    with mock.patch(names[0], lambda: library), mock.patch(names[1], lambda: library):
        lines = figures(Study(EndcapParams(*design)))
    return {line.key: line.value for line in lines if line.key in STUDIED and line.value}


def by_mesh() -> list[dict[str, Any]]:
    """The library's weights on states of other meshes."""
    design, rows = (130.0, 8.0), []
    request = DesignRequest(EndcapParams(*design), pictures=False, numbers=TRAIN)
    model = design_weights(request, FitConfig())
    for mesh in MESHES:
        simulator, scale = shell_of(replace(request.data("off", 1), density=mesh))
        test = tested_on(request, TEST[1::2], solved_source(simulator), mesh)
        error = errors(model, test).force_n
        rows.append(_row("mesh", design, len(NODES), 16, mesh, force_percent=100 * error / scale.top_n))
        print(rows[-1], flush=True)
    return rows


def by_training() -> list[dict[str, Any]]:
    """Weights of three sizes by passes over their data; the time is ``sensing.train --design``'s, pictures left out."""
    library, rows = load_library(), []
    for design in TRAINED:
        request = DesignRequest(EndcapParams(*design), pictures=False, numbers=TRAIN)
        simulator, scale = shell_of(request.data("off", 1))
        test = tested_on(request, TEST, library_source(simulator, own_states(design, Path())))
        for epochs in (0, *EPOCHS):  # the first compiles and is not counted
            begin = time.process_time()
            model = design_weights(request, FitConfig(epochs=epochs), None, library_source(simulator, library))
            spent = time.process_time() - begin
            if not epochs:
                continue
            percent = 100 * errors(model, test).force_n / scale.top_n
            rows.append(_row("training", design, len(NODES), 16, "data", force_percent=percent, train_cpu_s=spent))
            print(rows[-1], flush=True)
    return rows


def _row(study: str, design: Design, nodes: int, paths: int, mesh: str, **percent: float) -> dict[str, Any]:
    given = dict(zip(COLUMNS, (study, *design, nodes, paths, mesh), strict=False))
    return given | {name: percent.get(name, np.nan) for name in COLUMNS[len(given) :]}


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    studies = {
        "nodes": by_nodes, "study": by_study, "paths": by_nodes_and_paths, "mesh": by_mesh, "training": by_training,
    }  # fmt: skip
    parser = argparse.ArgumentParser(description="Nodes, paths and mesh of the library, and training, against error.")
    parser.add_argument("--studies", nargs="+", choices=list(studies), default=list(studies))
    options = parser.parse_args(arguments)
    rows = [row for name in options.studies for row in studies[name]()]
    made = {row["study"] for row in rows}
    path = HERE / "library.csv"
    if path.exists():
        with path.open(newline="") as stream:
            rows = [row for row in csv.DictReader(stream) if row["study"] not in made] + rows
    write_table(path, rows, COLUMNS, figures=5, missing="nan")
    plot()
    return 0


def plot() -> None:
    """The studies that have rows, side by side."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with (HERE / "library.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    panels = {
        "nodes": _plot_nodes, "nodes and paths": _plot_paths, "mesh": _plot_mesh, "training": _plot_training,
        "study": _plot_study,
    }  # fmt: skip
    parts = {name: [row for row in rows if row["study"].split(": ")[0] == name] for name in panels}
    shown = [name for name in panels if parts[name]]
    figure = Figure(figsize=(1 + 4 * len(shown), 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    for axis, name in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        panels[name](axis, parts[name])
    figure.savefig(HERE / "library.png", dpi=110)


def _plot_nodes(axis, rows) -> None:
    for design in dict.fromkeys((row["diameter_mm"], row["wall_mm"]) for row in rows):
        line = [row for row in rows if (row["diameter_mm"], row["wall_mm"]) == design]
        place = [int(row["nodes"]) for row in line], [float(row["surface_percent"]) for row in line]
        axis.plot(*place, "o-", label=f"D={design[0]} T={design[1]}")
    axis.set(xlabel="shells in the library, itself left out", ylabel="surface off by, %", ylim=(0, None))
    axis.legend(fontsize=7)


def _plot_paths(axis, rows) -> None:
    served = [row for row in rows if row["nodes"] != "0"]
    most = max(int(row["nodes"]) for row in served)
    by_node = [(int(r["nodes"]), float(r["force_percent"])) for r in served if r["paths"] == "16"]
    by_path = [(int(r["paths"]), float(r["force_percent"])) for r in served if int(r["nodes"]) == most]
    axis.plot(*np.array(sorted(by_node)).T, "o-", label="shells, 16 paths")
    axis.plot(*np.array(sorted(by_path)).T, "s-", label=f"paths, {most} shells")
    for row in rows:
        if row["nodes"] == "0":
            axis.axhline(float(row["force_percent"]), ls="--", c="k", label="own full simulation")
    axis.set(xlabel="number of shells or of paths", ylabel="force error an axis, % of the range", ylim=(0, None))
    axis.legend(fontsize=7)


def _plot_mesh(axis, rows) -> None:
    axis.bar([row["mesh"] for row in rows], [float(row["force_percent"]) for row in rows])
    axis.set(xlabel="mesh of the tested states", ylabel="force error an axis, % of the range")


def _plot_training(axis, rows) -> None:
    for design in dict.fromkeys((row["diameter_mm"], row["wall_mm"]) for row in rows):
        line = [row for row in rows if (row["diameter_mm"], row["wall_mm"]) == design]
        place = [float(row["train_cpu_s"]) for row in line], [float(row["force_percent"]) for row in line]
        axis.plot(*place, "o-", label=f"D={design[0]} T={design[1]}")
    axis.set(xlabel="processor time of a training, s", ylabel="force error an axis, % of the range", ylim=(0, None))
    axis.legend(fontsize=7)


FIGURES = {  # of the study, as the plot names them
    "stiffness_0_n_mm": "stiffness, 0 degrees", "stiffness_25_n_mm": "stiffness, 25 degrees",
    "stiffness_50_n_mm": "stiffness, 50 degrees", "safe_n": "safe load", "strain_percent": "largest strain",
    "depth_mm": "depth", "patch_mm2": "contact patch", "px_per_n": "pixels per newton",
    "bound_10_n": "bound, 10 degrees", "bound_25_n": "bound, 25 degrees", "bound_40_n": "bound, 40 degrees",
    "bound_50_n": "bound, 50 degrees", "bound_nm": "bound, torque",
}  # fmt: skip


def _plot_study(axis, rows) -> None:
    names = list(dict.fromkeys(row["study"].removeprefix("study: ") for row in rows))
    for row in rows:
        axis.plot(float(row["off_percent"]), names.index(row["study"].removeprefix("study: ")), "b.", alpha=0.6)
    said = [FIGURES.get(name, name) for name in names]
    axis.set(yticks=range(len(names)), yticklabels=said, xlabel="study's figure off the solved shell's, %")
    axis.axvline(0, c="k", lw=0.5)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
