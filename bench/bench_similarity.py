"""Weights by similarity against weights of a design's own full simulation: ``python bench/bench_similarity.py``.

A design's own full simulation solves the library's paths directly on its shell. The library predicts the same states;
of a design that is one of its nodes it does so without that node, so the one that ships is better there. Both are
trained alike on 16 paths and tested on the directly solved states of the other eight, one at each tilt, as other
domain-randomised sensors see them; three times, so that every path is tested on once (but where nodes were solved on
some paths only and none of those would be left to train on). Writes bench/similarity.csv and .png. Two minutes of
processor time a design and test; solved states are kept in build/similarity.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.errors import ParameterError
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing.design.weights import DesignRequest, design_weights
from sensing.learning.contenders import read_all
from sensing.learning.fit_config import FitConfig
from sensing.learning.samples import MARKERS, SHAPE, Samples
from sensing.simulator.dataset.cluster import Origin
from sensing.simulator.similarity.labelled import (
    StateSource,
    library_source,
    shell_of,
    with_azimuths,
    write_labelled,
)
from sensing.simulator.similarity.library import Library, ShellStates, load_library, solved_node
from sensing.simulator.similarity.node import SolvedNode, read_node, save_node
from sensing.simulator.similarity.nodes import NODES, Design, file_name
from sensing.simulator.similarity.paths import library_paths, touching_steps
from sensing.simulator.similarity.ratios import ShellRatios
from sensing.simulator.similarity.solve import solve_node
from sensing.simulator.solid.geometry import shell_geometry
from sensing.wrench.model import WrenchModel

HERE = Path(__file__).parent
TEST_SEED = 9_001
FOLDS = tuple(tuple(3 * tilt + (tilt + k) % 3 for tilt in range(8)) for k in (1, 0, 2))  # one path at each tilt
TEST = FOLDS[0]
TRAIN = tuple(sorted(set(range(24)) - set(TEST)))
DESIGNS = ["104/6.5", "104.5/10.4", "110/8.5", "110/11", "121/6.5", "125/12.5", "165/6.5", "165/11", "230/18"]
COLUMNS = (
    "diameter_mm", "wall_mm", "silicone", "folds", "nodes", "states_error_percent", "library_force_n", "own_force_n",
    "library_percent", "own_percent", "ratio", "torque_ratio", "library_coverage", "own_coverage", "train_cpu_s",
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


def some_nodes(library: Library, keep: Sequence[int]) -> Library:
    """The library with some of its nodes."""

    def part(states):
        return replace(states, **{name: getattr(states, name)[list(keep)] for name in states.__dataclass_fields__})

    return replace(
        library, ratios=library.ratios[list(keep)], curves=library.curves[list(keep)], travel=part(library.travel),
        standing=part(library.standing),
    )  # fmt: skip


def without(library: Library, node: int) -> Library:
    """The library less one of its nodes."""
    return some_nodes(library, [k for k in range(len(library.ratios)) if k != node])


class Alone:
    """A library that gives one shell's states whatever is asked: a design's own full simulation.

    Args:
        node: the states of that shell.
    """

    def __init__(self, node: SolvedNode) -> None:
        self.node = node

    def states(self, ratios: ShellRatios) -> ShellStates:
        """States of the shell."""
        node = self.node
        known = np.isfinite(node.wrench).all(axis=1)
        surface, wrench, labels = (np.nan_to_num(values) for values in (node.surface, node.wrench, node.labels))
        return ShellStates(surface, wrench, labels, known)


def own_states(design: tuple[float, float], folder: Path) -> Alone:
    """A design's own full simulation: out of the library where it is a node, else solved once by each simulator."""
    if design in NODES:
        return Alone(solved_node(load_library(), NODES.index(design), standing=False))
    path = folder / Origin.here().code[:12] / file_name("own", design)
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        save_node(solve_node(ShellRatios.of(shell_geometry(*design)).shell(), library_paths(), False), path)
    return Alone(read_node(path))


def compare(
    design: tuple[float, float], silicone: str, nodes: Path, config: FitConfig, folds: int
) -> dict[str, float | str]:
    """One row of the table."""
    library, ratios = load_library(), ShellRatios.of(shell_geometry(*design))
    left = without(library, NODES.index(design)) if design in NODES else library
    own = own_states(design, nodes)
    a, b = left.states(ratios), own.states(ratios)
    known = a.known & b.known
    apart = np.linalg.norm((a.surface - b.surface)[known], axis=(1, 2)) / np.linalg.norm(b.surface[known], axis=(1, 2))
    found: dict[str, list[Errors]] = {"library": [], "own": []}
    spent, solved = 0.0, known_paths(a)
    tests = [paths for paths in FOLDS[:folds] if solved - set(paths)]
    for test_paths in tests:
        numbers = tuple(sorted(set(range(24)) - set(test_paths)))
        request = DesignRequest(EndcapParams(*design), silicone, pictures=False, numbers=numbers)
        shell = shell_of(request.data("off", 1))
        test = tested_on(request, test_paths, library_source(shell[0], own))
        for name, source in (("library", left), ("own", own)):
            begin = time.process_time()
            model = design_weights(request, config, _line, library_source(shell[0], source))
            spent += time.process_time() - begin if name == "library" else 0.0
            found[name].append(errors(model, test))
    mine, full = (mean(found[name]) for name in ("library", "own"))
    top = request.scale.top_n
    return {
        "diameter_mm": design[0], "wall_mm": design[1], "silicone": silicone, "folds": len(tests),
        "nodes": len(left.ratios), "states_error_percent": 100 * float(np.median(apart)),
        "library_force_n": mine.force_n,
        "own_force_n": full.force_n, "library_percent": 100 * mine.force_n / top,
        "own_percent": 100 * full.force_n / top, "ratio": mine.force_n / full.force_n,
        "torque_ratio": mine.torque_nm / full.torque_nm, "library_coverage": mine.coverage,
        "own_coverage": full.coverage, "train_cpu_s": spent / len(tests),
    }  # fmt: skip


def known_paths(states: ShellStates) -> set[int]:
    """Numbers of the library's paths of which a shell has most states."""
    paths = library_paths()
    ends = np.cumsum([len(touching_steps(path)) for path in paths])
    parts = np.split(states.known[: ends[-1]], ends[:-1])
    return {path.number for path, part in zip(paths, parts, strict=True) if part.mean() > 0.5}


def tested_on(request: DesignRequest, paths: tuple[int, ...], source: StateSource, mesh: str = "data") -> Samples:
    """Paths of the library on a design, seen by sensors that no training has seen.

    Args:
        request: the design. paths: numbers. source: of their states. mesh: on which they were solved.
    """
    asked = replace(request.data("off", 4), seed=TEST_SEED, density=mesh)
    held = with_azimuths([path for path in library_paths() if path.number in paths], 4)
    with tempfile.TemporaryDirectory() as place:
        write_labelled(asked, held, source, Path(place) / "test", shell_of(asked))
        return read_all([Path(place) / "test"], MARKERS, SHAPE)


def mean(found: list[Errors]) -> Errors:
    """Root mean square of errors and mean of coverages."""
    force, torque = (float(np.sqrt(np.mean([getattr(e, n) ** 2 for e in found]))) for n in ("force_n", "torque_nm"))
    return Errors(force, torque, float(np.mean([e.coverage for e in found])))


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description="Weights by similarity against a design's own simulation.")
    parser.add_argument("--designs", nargs="+", default=DESIGNS, metavar="D/T", help="D/T, mm")
    parser.add_argument("--silicone", default=DEFAULT_SILICONE, help=f"that all are cast of ({DEFAULT_SILICONE})")
    parser.add_argument("--folds", type=int, default=len(FOLDS), choices=range(1, len(FOLDS) + 1), help="of the paths")
    parser.add_argument("--nodes", type=Path, default=Path("build/similarity"), help="folder of the solved nodes")
    parser.add_argument("--epochs", type=int, default=FitConfig().epochs)
    options = parser.parse_args(arguments)
    for design in [design_of(word) for word in options.designs]:
        print(f"D={design[0]:g} T={design[1]:g} in {options.silicone}", flush=True)
        row = compare(design, options.silicone, options.nodes, FitConfig(epochs=options.epochs), options.folds)
        _add(row)
        print({name: round(v, 4) if isinstance(v, float) else v for name, v in row.items()}, flush=True)
    _plot()
    return 0


def design_of(word: str) -> Design:
    """Diameter and wall of a word such as 165/11, mm.

    Args:
        word: of the command line.

    Raises:
        ParameterError: it is no such word, or lies outside the valid region.
    """
    try:
        diameter, wall = (float(number) for number in word.split("/"))
    except ValueError:
        raise ParameterError(f"designs={word!r}: give D/T in mm, such as 165/11", name="designs", value=word) from None
    params = EndcapParams(diameter, wall)
    return params.diameter_mm, params.wall_mm


def _add(row: dict[str, float | str]) -> None:
    """Put a row in place of that of the same design."""
    path = HERE / "similarity.csv"
    rows: list[dict[str, str]] = []
    if path.exists():
        with path.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
    new = {name: row[name] if isinstance(row[name], str) else f"{row[name]:.5g}" for name in COLUMNS}
    rows = [r for r in rows if any(r[name] != new[name] for name in COLUMNS[:3])] + [new]
    write_table(path, rows, COLUMNS)


def _plot() -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with (HERE / "similarity.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    figure = Figure(figsize=(8, 4), layout="constrained")
    FigureCanvasAgg(figure)
    axis = figure.subplots()
    x = np.arange(len(rows))
    for k, (name, label) in enumerate((("own_percent", "own full simulation"), ("library_percent", "by similarity"))):
        axis.bar(x + 0.4 * k - 0.2, [float(row[name]) for row in rows], 0.38, label=label)
    labels = [f"D={row['diameter_mm']} T={row['wall_mm']}\n{row['silicone']}" for row in rows]
    axis.set_xticks(x, labels, rotation=30, ha="right")
    axis.set_ylabel("force error an axis, % of the range")
    axis.legend()
    figure.savefig(HERE / "similarity.png", dpi=120)


def _line(text: str) -> None:
    print(f"  {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
