"""Weights by similarity against weights of a design's own full simulation: ``python bench/bench_similarity.py``.

A design's own full simulation solves the library's paths directly on its shell. The library predicts the same states;
of a design that is one of its nodes it does so without that node, so the one that ships is better there. Both are
trained alike on 16 paths and tested on the directly solved states of the other eight, one at each tilt, as other
domain-randomised sensors see them. Writes bench/similarity.csv and .png. A minute of processor time a design; solved
states are kept in build/similarity.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing.design.weights import DesignRequest, design_weights
from sensing.learning.contenders import read_all
from sensing.learning.fit_config import FitConfig
from sensing.learning.samples import MARKERS, SHAPE, Samples
from sensing.simulator.similarity.labelled import library_source, shell_of, with_azimuths, write_labelled
from sensing.simulator.similarity.library import Library, ShellStates, joined, load_library
from sensing.simulator.similarity.node import read_node, save_node
from sensing.simulator.similarity.nodes import NODES, file_name
from sensing.simulator.similarity.paths import library_paths
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.similarity.solve import solve_node
from sensing.simulator.solid.geometry import shell_geometry
from sensing.wrench.model import WrenchModel

HERE = Path(__file__).parent
TEST_SEED = 9_001
TEST = tuple(3 * tilt + (tilt + 1) % 3 for tilt in range(8))  # one path at each tilt, none of the thinnest node's
TRAIN = tuple(sorted(set(range(24)) - set(TEST)))
MODES = 96
COLUMNS = (
    "diameter_mm", "wall_mm", "nodes", "states_error_percent", "library_force_n", "own_force_n", "library_percent",
    "own_percent", "ratio", "torque_ratio", "library_coverage", "own_coverage", "train_cpu_s",
)  # fmt: skip


@dataclass(frozen=True)
class Errors:
    """Errors of a model on a test set: root mean square force and torque an axis, and coverage of 95 %."""

    force_n: float
    torque_nm: float
    coverage: float


def errors(model: WrenchModel, test: Samples) -> Errors:
    """Of the states in contact."""
    held = test.take(test.contact)
    value, covariance = model.predict(held.inputs)
    off = value - held.wrenches
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    force, torque = (float(np.sqrt((off[:, part] ** 2).mean())) for part in (slice(0, 3), slice(3, 6)))
    return Errors(force, torque, float((np.abs(off) < 1.96 * sigma).mean()))


def without(library: Library, node: int) -> Library:
    """The library less one of its nodes."""
    keep = np.arange(len(library.ratios)) != node

    def part(states):
        return replace(states, **{name: getattr(states, name)[keep] for name in states.__dataclass_fields__})

    return replace(
        library, ratios=library.ratios[keep], curves=library.curves[keep], travel=part(library.travel),
        standing=part(library.standing),
    )  # fmt: skip


def only(design: tuple[float, float], folder: Path) -> Library:
    """A library of one shell alone: a design's own full simulation, solved once."""
    name = file_name("node" if design in NODES else "own", design)
    if not (folder / name).exists():
        folder.mkdir(parents=True, exist_ok=True)
        shell = ShellRatios.of(shell_geometry(*design)).shell()
        save_node(solve_node(shell, library_paths(), False), folder / name)
    node = read_node(folder / name)
    return joined([node], [node], 3 * MODES)


class _Alone:
    """A library that gives its only node's states whatever is asked."""

    def __init__(self, library: Library) -> None:
        self._library = library

    def states(self, ratios: ShellRatios):
        """States of the node."""
        stored, modes = self._library.travel, self._library.modes.astype(float)
        weights = stored.solved.astype(float)
        surface = np.tensordot(stored.mixed(weights, "coefficients"), modes, axes=1)
        wrench = stored.mixed(weights, "wrench") * ratios.wall**2
        return ShellStates(surface, wrench, stored.mixed(weights, "labels"), stored.solved[0])


def compare(design: tuple[float, float], nodes: Path, config: FitConfig) -> dict[str, float]:
    """One row of the table."""
    library, ratios = load_library(), ShellRatios.of(shell_geometry(*design))
    left = without(library, NODES.index(design)) if design in NODES else library
    own = _Alone(only(design, nodes))
    a, b = left.states(ratios), own.states(ratios)
    known = a.known & b.known
    apart = np.linalg.norm((a.surface - b.surface)[known], axis=(1, 2)) / np.linalg.norm(b.surface[known], axis=(1, 2))
    request = DesignRequest(EndcapParams(*design), pictures=False, numbers=TRAIN)
    shell = shell_of(request.data("off", 1))
    with tempfile.TemporaryDirectory() as place:
        asked = replace(request.data("off", 4), seed=TEST_SEED)  # another seed: other sensors
        held = with_azimuths([path for path in library_paths() if path.number in TEST], 4)
        write_labelled(asked, held, library_source(shell[0], own), Path(place) / "test", shell)
        test = read_all([Path(place) / "test"], MARKERS, SHAPE)
    made, spent = {}, 0.0
    for name, source in (("library", left), ("own", own)):
        begin = time.process_time()
        model = design_weights(request, config, _line, library_source(shell[0], source))
        spent = time.process_time() - begin if name == "library" else spent
        made[name] = errors(model, test)
    top = request.scale.top_n
    return {
        "diameter_mm": design[0], "wall_mm": design[1], "nodes": len(left.ratios),
        "states_error_percent": 100 * float(np.median(apart)), "library_force_n": made["library"].force_n,
        "own_force_n": made["own"].force_n, "library_percent": 100 * made["library"].force_n / top,
        "own_percent": 100 * made["own"].force_n / top, "ratio": made["library"].force_n / made["own"].force_n,
        "torque_ratio": made["library"].torque_nm / made["own"].torque_nm,
        "library_coverage": made["library"].coverage, "own_coverage": made["own"].coverage, "train_cpu_s": spent,
    }  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description="Weights by similarity against a design's own simulation.")
    parser.add_argument("--designs", nargs="+", default=["130/8", "121/6.5", "180/10"], metavar="D/T", help="D/T, mm")
    parser.add_argument("--nodes", type=Path, default=Path("build/similarity"), help="folder of the solved nodes")
    parser.add_argument("--epochs", type=int, default=FitConfig().epochs)
    options = parser.parse_args(arguments)
    for word in options.designs:
        design = tuple(float(number) for number in word.split("/"))
        print(f"D={design[0]:g} T={design[1]:g} in {DEFAULT_SILICONE}", flush=True)
        row = compare(design, options.nodes, FitConfig(epochs=options.epochs))
        _add(row)
        print({name: round(value, 4) for name, value in row.items()}, flush=True)
    _plot()
    return 0


def _add(row: dict[str, float]) -> None:
    """Put a row in place of that of the same design."""
    path = HERE / "similarity.csv"
    rows: list[dict[str, str]] = []
    if path.exists():
        with path.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
    new = {name: f"{row[name]:.5g}" for name in COLUMNS}
    rows = [r for r in rows if (r["diameter_mm"], r["wall_mm"]) != (new["diameter_mm"], new["wall_mm"])] + [new]
    with path.open("w", newline="") as stream:
        table = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def _plot() -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with (HERE / "similarity.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    figure = Figure(figsize=(6, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    x = np.arange(len(rows))
    for k, (name, label) in enumerate((("own_percent", "own full simulation"), ("library_percent", "by similarity"))):
        axis.bar(x + 0.4 * k - 0.2, [float(row[name]) for row in rows], 0.38, label=label)
    axis.set_xticks(x, [f"D={row['diameter_mm']} T={row['wall_mm']}" for row in rows])
    axis.set_ylabel("force error an axis, % of the range")
    axis.legend()
    figure.savefig(HERE / "similarity.png", dpi=120)


def _line(text: str) -> None:
    print(f"  {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
