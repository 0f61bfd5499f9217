"""Wrench models: error against network size, input, training data and training time; latency by runtime.

    make evaluate                                   # makes exports/wrench_train and exports/wrench_test
    python bench/bench_wrench.py                    # bench/wrench.csv, bench/wrench.png
    python bench/bench_wrench.py data time          # these studies anew; the rows of the others stay

Errors on the test folders through the real tracker, N and N m about the sphere's centre. Seconds are CPU seconds of one
core, microseconds the median of many calls in this process.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.camera.mount import MountedCamera
from sensing.learning.contenders import RELEASED_SHAPE, read_all
from sensing.learning.fit_config import FitConfig
from sensing.learning.fitting import fit
from sensing.learning.net import as_net
from sensing.learning.paper_recipe import random_split, train_paper_model
from sensing.learning.ridge import fit_ridge
from sensing.learning.samples import MARKERS, Samples
from sensing.records_labelled import LabelledSet, read_shard
from sensing.tracking.tracker import DotTracker
from sensing.wrench.model import WrenchModel
from sensing.wrench.paper_model import predict
from sensing.wrench_onnx import onnx_graph

HERE = Path(__file__).parent
ROWS = ("study", "name", "x", "force_rmse_n", "torque_rmse_nm", "seconds", "microseconds")
EPOCHS = 10
PATHS = (5, 15, 50, 150)  # and all there are
NEAR_PX = 12.0  # a found dot is the labelled one within this distance
Row = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the studies asked for and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("studies", nargs="*", default=["size", "cells", "data", "time", "latency"])
    parser.add_argument(
        "--train", type=Path, nargs="+", default=[Path("exports/wrench_train"), Path("exports/wrench_motion")]
    )
    parser.add_argument("--test", type=Path, nargs="+", default=[Path("exports/wrench_test")])
    parser.add_argument("--out", type=Path, default=HERE / "wrench.csv")
    options = parser.parse_args(arguments)
    known = {"size": size, "cells": cells, "data": data, "time": times, "latency": latency, "tracking": tracking}
    for study in set(options.studies) - set(known):
        parser.error(f"{study!r} is no study: choose from {', '.join(known)}")
    for folder in (*options.train, *options.test):
        if not (folder / "shards").is_dir():
            parser.error(f"{folder}: no frames here yet: run make evaluate first, or name other sets (--train, --test)")
    rows: list[Row] = []
    for study in options.studies:
        for row in known[study](options.train, options.test):
            rows.append({name: row.get(name, "") for name in ROWS} | {"study": study})
            print(*(f"{v:.4g}" if isinstance(v, float) else v for v in rows[-1].values()), flush=True)
    save(rows, options.out)
    plot(read(options.out), options.out.with_suffix(".png"))
    return 0


def read(path: Path) -> list[Row]:
    """Rows of the table, its numbers as numbers; none where there is no table."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    return [
        {name: float(cell) if cell and name not in ROWS[:2] else cell for name, cell in row.items()} for row in table
    ]


def save(rows: list[Row], path: Path) -> None:
    """Put the rows in the place of those of the same studies.

    Args:
        rows: of whole studies.
        path: of the table.
    """
    made = {row["study"] for row in rows}
    rows = [row for row in read(path) if row["study"] not in made] + rows
    write_table(path, rows, ROWS, figures=5)


def errors(reported: np.ndarray, test: Samples) -> Row:
    """RMSE over the three axes each."""
    square = ((reported - test.wrenches) ** 2).mean(axis=0)
    return {"force_rmse_n": float(np.sqrt(square[:3].mean())), "torque_rmse_nm": float(np.sqrt(square[3:].mean()))}


def size(train: list[Path], test: list[Path]) -> Iterator[Row]:
    """Principal fields and width; one ablation without the symmetries, and the linear part alone."""
    known, unseen = read_all(train, MARKERS), read_all(test, "dots")
    plain = FitConfig(epochs=EPOCHS)
    for components, hidden in ((10, 64), (30, 64), (60, 16), (60, 64), (120, 128)):
        config = replace(plain, components=components, hidden=hidden)
        yield trained(known, unseen, config) | {"name": f"{components} fields, width {hidden}"}
    yield trained(known, unseen, replace(plain, symmetric=False)) | {"name": "60, 64 without symmetries"}
    weights, _ = fit_ridge(known.inputs, known.wrenches, known.path, known.fields.shape[2])
    yield errors(unseen.inputs @ weights.T, unseen) | {"name": "ridge"}


def cells(train: list[Path], test: list[Path]) -> Iterator[Row]:
    """Resolution of the input field."""
    for side in (8, 16, 24):
        known, unseen = read_all(train, MARKERS, (side, side)), read_all(test, "dots", (side, side))
        yield trained(known, unseen, FitConfig(epochs=EPOCHS)) | {"name": f"{side}x{side}", "x": side}


def data(train: list[Path], test: list[Path]) -> Iterator[Row]:
    """Number of loading paths, ours and ridge."""
    known, unseen = read_all(train, MARKERS), read_all(test, "dots")
    names = np.random.default_rng(0).permutation(np.unique(known.path))
    for count in sorted({min(count, len(names)) for count in (*PATHS, len(names))}):
        part = known.take(np.isin(known.path, names[:count]))
        yield trained(part, unseen, FitConfig(epochs=EPOCHS)) | {"name": "ours", "x": count}
        weights, _ = fit_ridge(part.inputs, part.wrenches, part.path, part.fields.shape[2])
        yield errors(unseen.inputs @ weights.T, unseen) | {"name": "ridge", "x": count}


def times(train: list[Path], test: list[Path]) -> Iterator[Row]:
    """Training time, ours and the paper's recipe on the same frames."""
    known, unseen = read_all(train, MARKERS), read_all(test, "dots")
    for epochs in (0, 1, 3, 10, 30):
        row = trained(known, unseen, FitConfig(epochs=epochs))
        yield row | {"name": "ours", "x": row["seconds"]}
    released, seen = read_all(train, "gelslim", RELEASED_SHAPE), read_all(test, "gelslim", RELEASED_SHAPE)
    split = random_split(len(released), 0)
    for epochs in (1, 3, 10, 30, 100):
        begin = time.process_time()
        result = train_paper_model(released.fields, released.wrenches.astype(np.float32), 0, epochs, split)
        spent = time.process_time() - begin
        reported = predict(result.model, seen.fields)
        yield errors(reported, seen) | {"name": "paper", "seconds": spent, "x": spent}


def latency(train: list[Path], test: list[Path]) -> Iterator[Row]:
    """Field to wrench and covariance, for one and six sensors at once."""
    import onnxruntime
    import torch

    torch.set_num_threads(1)
    known, unseen = read_all(train, MARKERS), read_all(test, "dots")
    for components, hidden in ((20, 32), (60, 64), (120, 128)):
        model = fit(known, FitConfig(components=components, hidden=hidden, epochs=1))
        net = as_net(model)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(onnx_graph(model).SerializeToString(), options)
        for count in (1, 6):
            x = unseen.inputs[:count]
            single = x.astype(np.float32)
            tensor = torch.from_numpy(single)

            def by_torch(net: Any = net, tensor: Any = tensor) -> None:
                with torch.inference_mode():
                    net(tensor)

            runs: dict[str, Callable[[], object]] = {
                "compiled": lambda model=model, x=x: model.predict(x),  # type: ignore[misc]
                "torch": by_torch,
                "ONNX": lambda session=session, single=single: session.run(None, {"field": single}),  # type: ignore[misc]
            }
            for name, run in runs.items():
                what = f"{name}, {components} fields, width {hidden}"
                yield {"name": what, "x": count, "microseconds": microseconds(run)}


def tracking(train: list[Path], test: list[Path]) -> Iterator[Row]:
    """What the real tracker's dots are off by on rendered frames, against their centres and against their outlines.

    The second is the noise that learning.marker_fields assumes.
    """
    moved, off, beside = [], [], []
    for folder in train[:1]:
        data, tracker, now = LabelledSet(folder), None, None
        camera, rest_mm = MountedCamera.load(folder / "camera.json"), read_shard(folder / "dots.npz")["dots_mm"]
        outlines = np.concatenate([read_shard(file, ("outline_mm",))["outline_mm"] for file in data.shards])
        for item, outline_mm in zip(data.frames(), outlines, strict=True):
            run = (item.path, float(item.labels["azimuth_deg"]))
            if run != now:
                tracker, now = DotTracker(item.reference), run
                rest = item.dots_px  # the first frame of a run is apart: at rest
                distance = np.linalg.norm(tracker.reference_px[:, None] - rest[None], axis=2)
                distance = np.where(np.isnan(distance), np.inf, distance)
                match = np.where(distance.min(axis=1) < NEAR_PX, distance.argmin(axis=1), -1)
            assert tracker is not None
            tracks = tracker.update(item.frame)
            good = (match >= 0) & ~tracks.lost
            true = (item.dots_px - rest)[match[good]]
            shown = camera.project(rest_mm + outline_mm) - camera.project(rest_mm + item.dots_mm)
            off.append(tracks.displacement_px[good] - true)
            beside.append(shown[match[good]])
            moved.append(np.linalg.norm(true, axis=1))
    size_px, error, outline = np.concatenate(moved), np.concatenate(off), np.concatenate(beside)
    for low, high in ((0, 0.05), (0.05, 1), (1, 3), (3, 6), (6, 12), (12, 30), (1, 30)):
        inside = (size_px >= low) & (size_px < high)
        for what, part in (("centre", error[inside]), ("outline", (error - outline)[inside])):
            if len(part):
                typical = float(1.4826 * np.nanmedian(np.abs(part)))
                yield {"name": f"{what}, displacement {low} to {high} px: median-based sigma, rms px", "x": typical,
                       "seconds": float(np.sqrt(np.nanmean(part**2)))}  # fmt: skip


def trained(known: Samples, unseen: Samples, config: FitConfig) -> Row:
    """Error, CPU seconds of the fit, weights of the perceptron (x), and latency of one frame."""
    begin = time.process_time()
    model: WrenchModel = fit(known, config)
    spent = time.process_time() - begin
    x = unseen.inputs
    reported, count = model.predict(x)[0], sum(w.size for name, w in model.weights.items() if name.startswith("mean."))
    latency_us = microseconds(lambda: model.predict(x[:1]))
    return errors(reported, unseen) | {"seconds": spent, "microseconds": latency_us, "x": count}


def microseconds(run: Callable[[], object], calls: int = 300) -> float:
    """Median of single calls."""
    for _ in range(20):
        run()
    spent = []
    for _ in range(calls):
        begin = time.perf_counter()
        run()
        spent.append(time.perf_counter() - begin)
    return float(np.median(spent)) * 1e6


def plot(rows: list[Row], path: Path) -> None:
    """Four curves."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, axes = pyplot.subplots(2, 2, figsize=(11, 8))
    for axis, (study, label, title) in zip(
        axes.ravel(),
        (("size", "weights of the perceptron", "network size"), ("data", "loading paths", "training data"),
         ("time", "CPU seconds of training", "training time"), ("cells", "cells along a side", "input field")),
        strict=True,
    ):  # fmt: skip
        part = [row for row in rows if row["study"] == study and row["force_rmse_n"] != ""]
        for name in dict.fromkeys("ours" if study == "cells" else row["name"] for row in part):
            chosen = [row for row in part if study == "cells" or row["name"] == name]
            x = [row["x"] for row in chosen]
            if x == [""]:
                axis.axhline(chosen[0]["force_rmse_n"], color="gray", ls=":", label=name)
                continue
            axis.plot(x, [row["force_rmse_n"] for row in chosen], "o-", label=name, ms=4)
        axis.set(xlabel=label, ylabel="force RMSE, N", title=title, ylim=(0, None))
        if study != "cells":
            axis.set_xscale("log")
            axis.xaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.minorticks_off()
        if len(axis.lines) > 1:
            axis.legend(fontsize=7)
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
