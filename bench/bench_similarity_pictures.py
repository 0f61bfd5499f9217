"""Weights by similarity against a design's own full simulation, on rendered pictures: ``bench_similarity_pictures.py``.

Both are trained on the same paths, the library without the design's own node. They are judged as a user would:
`sensing.evaluate` (pictures through the tracker and the live pipeline) on rendered motions of the dynamic protocol,
pressed in proportion to the design's range. Writes bench/similarity_pictures.csv. Three minutes of processor time.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench_similarity import own_states, without

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
    parser.add_argument("--frames", type=int, default=60, help="at least so many")
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
        for name, source in (("library", left), ("own", own)):
            model = design_weights(request, FitConfig(), None, library_source(simulator, source))
            model.save(folder / f"{name}.safetensors")
            scores, _ = evaluate([folder / "test"], folder / f"{name}.safetensors")
            for said, score in scores.items():
                row = {"diameter_mm": diameter, "wall_mm": wall, "silicone": options.silicone, "states": name}
                rows.append(row | {"range_n": request.scale.top_n, "score": said.removesuffix(", test")} | score.row())
            print(name, {said: score.row() for said, score in scores.items()}, flush=True)
    with (HERE / "similarity_pictures.csv").open("w", newline="") as stream:
        table = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
