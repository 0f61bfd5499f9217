"""Weights by similarity against a design's own full simulation, on rendered pictures: ``bench_similarity_pictures.py``.

Both are trained on the same paths, the library without the design's own node. They are judged as a user would:
`sensing.evaluate` (pictures through the tracker and the live pipeline) on rendered motions of the dynamic protocol,
pressed in proportion to the design's range; each is trained with several seeds, because one training differs from the
next by a third. Writes bench/similarity_pictures.csv. Five minutes of processor time.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from bench_similarity import own_states, without
from one_line import in_one_line
from table_file import write_table

from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing.design.weights import DesignRequest, design_weights
from sensing.evaluate import evaluate
from sensing.learning.fit_config import FitConfig
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.writer import write_dataset
from sensing.simulator.similarity.labelled import library_source, shell_of
from sensing.simulator.similarity.library import load_library
from sensing.simulator.similarity.nodes import NODES

HERE = Path(__file__).parent
SEED = 301  # of the motions: on it no choice was made


def main(arguments: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(description="Weights by similarity against own simulation, on pictures.")
    parser.add_argument("--design", default="165/11", metavar="D/T", help="a node of the library, mm")
    parser.add_argument("--silicone", default=DEFAULT_SILICONE)
    parser.add_argument("--frames", type=int, default=140, help="at least so many")
    parser.add_argument("--seeds", type=int, default=2, help="of training")
    options = parser.parse_args(arguments)
    diameter, wall = (float(number) for number in options.design.split("/"))
    request, rows = DesignRequest(EndcapParams(diameter, wall), options.silicone, pictures=False), []
    left, own = without(load_library(), NODES.index((diameter, wall))), own_states((diameter, wall), Path())
    asked = DataRequest(
        options.frames, diameter, wall, options.silicone, protocol="dynamic", seed=SEED, loads="design", azimuths=1
    )
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_dataset(asked, folder / "test")
        simulator = shell_of(request.data("off", 1))[0]
        for name, source, seed in [
            (*each, s) for each in (("library", left), ("own", own)) for s in range(options.seeds)
        ]:
            model = design_weights(request, FitConfig(seed=seed), None, library_source(simulator, source))
            model.save(folder / f"{name}.safetensors")
            scores, _ = evaluate([folder / "test"], folder / f"{name}.safetensors")
            for said, score in scores.items():
                row = {"diameter_mm": diameter, "wall_mm": wall, "silicone": options.silicone, "states": name}
                row |= {"train_seed": seed, "range_n": request.scale.top_n, "score": said.removesuffix(", test")}
                rows.append(row | score.row())
                axes = {axis: f"{value:.3f}" for axis, value in score.row().items() if axis.startswith("rmse_")}
                print(f"{name}, training {seed}, {said}: {axes}", flush=True)
    for said in dict.fromkeys(row["score"] for row in rows):
        print(said, *(f"{what} {ratio(rows, said, what):.2f}" for what in ("n", "nm")))
    write_table(HERE / "similarity_pictures.csv", rows, figures=5)
    return 0


def ratio(rows: Sequence[dict[str, Any]], score: str, unit: str) -> float:
    """Error by similarity over that of the own simulation, root mean square over axes and trainings.

    Args:
        rows: of the table. score: which. unit: ``n`` for forces, ``nm`` for torques.
    """
    axes = ("fx", "fy", "fz") if unit == "n" else ("tx", "ty", "tz")
    error = {
        name: np.mean([
            [row[f"rmse_{axis}_{unit}"] ** 2 for axis in axes]
            for row in rows if row["states"] == name and row["score"] == score
        ])
        for name in ("library", "own")
    }  # fmt: skip
    return float(np.sqrt(error["library"] / error["own"]))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
