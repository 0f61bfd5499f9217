"""What the stages of a live frame cost beside the released pipeline, on a machine that others use too.

    python bench/bench_stages.py                                        # bench/stages.csv

All frames of the simulated robot, at the camera's rate, go through the pipeline of ``sensing.live`` again and again,
with the dots and with the released method (gelslim) in turn. Both are deterministic, so a stage of a frame does the
same work in every round: its time is the least CPU time of all rounds, and a row is the mean over the frames that have
it: ``drift`` (what has changed since the reference) is looked for in one of thirty. ``ratio`` is to the released
pipeline's whole frame. ``decode half`` is no stage: the same JPEG to half size, which costs little
beyond its entropy decoding, and that every reader of it has to do.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np
from bench_live import frames_of, pipelines  # makes the repository importable, too
from one_line import in_one_line
from table_file import write_table

from bench.parts import table_of
from cad.params import EndcapParams
from sensing.decode import decode_gray
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.demo.scene import scene_film
from sensing.live.run import reduce_pauses
from sensing.records import Frame

METHODS = ("dots", "gelslim")


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3, help="over the film (3)")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every Nth frame (1)")
    parser.add_argument("--out", type=Path, help="table (bench/stages.csv of all frames, else build/stages.csv)")
    options = parser.parse_args()
    out = options.out or table_of("stages.csv", options.every == 1)
    cv2.setNumThreads(1)
    frames = frames_of(0, scene_film().ticks)[:: options.every]
    made = {name: pipelines(load_model("default", EndcapParams(130, 8), None, name), 1)[0] for name in METHODS}
    reduce_pauses()
    rounds: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for _ in range(options.rounds):
        for method, pipeline in made.items():
            for stage, spent_ms in spent(pipeline, frames).items():
                rounds[method, stage].append(spent_ms)
        rounds["", "decode half"].append([decoded_ms(frame) for frame in frames])
    rows = table({key: np.min(spent_ms, axis=0) for key, spent_ms in rounds.items()})
    write_table(out, rows)
    for row in rows:
        print(*row.values())


def spent(pipeline: EndcapPipeline, frames: list[Frame]) -> Mapping[str, list[float]]:
    """Milliseconds of every stage and of the whole, frame by frame, from a restart on."""
    pipeline.restart()
    found: dict[str, list[float]] = defaultdict(list)
    with patch("time.perf_counter", time.thread_time):  # by which the pipeline times its stages
        for frame in frames:
            begin = time.thread_time()
            reading = pipeline.update(frame)
            found["all"].append(1e3 * (time.thread_time() - begin))
            for stage, spent_ms in ({} if reading is None else reading.stage_ms).items():
                found[stage].append(spent_ms)
    return found


def decoded_ms(frame: Frame) -> float:
    """Milliseconds of a JPEG to gray at half size."""
    begin = time.thread_time()
    decode_gray(frame, 2)
    return 1e3 * (time.thread_time() - begin)


def table(least_ms: Mapping[tuple[str, str], np.ndarray]) -> list[dict[str, str]]:
    """A row for each method and stage: mean, median and 99 % over the frames, and the ratio of the means."""
    whole = float(least_ms["gelslim", "all"].mean())
    rows = []
    for (method, stage), spent_ms in least_ms.items():
        sizes = {"mean_ms": spent_ms.mean(), "median_ms": np.median(spent_ms), "p99_ms": np.quantile(spent_ms, 0.99)}
        cells = sizes | {"ratio": spent_ms.mean() / whole}
        rows.append({"method": method, "stage": stage} | {name: f"{value:.4g}" for name, value in cells.items()})
    return rows


if __name__ == "__main__":
    sys.exit(in_one_line(main))
