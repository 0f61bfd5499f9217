"""The plot of ``bench/bench_floor.py``: bounds and error by load, a column for each range of tilts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot


def plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Bound and error of fz, and of fx and fy, by load at each tilt."""
    tilts = sorted({(row["tilt_from_deg"], row["tilt_to_deg"]) for row in rows})
    figure, axes = pyplot.subplots(2, len(tilts), figsize=(3 * len(tilts), 6), sharex=True, sharey="row", squeeze=False)
    for line, wanted in zip(axes, (("fz_n",), ("fx_n", "fy_n")), strict=True):
        for axis, (low, high) in zip(line, tilts, strict=True):
            part = [row for row in rows if row["tilt_from_deg"] == low and row["axis"] in wanted]
            loads = sorted({(row["load_from_n"], row["load_to_n"]) for row in part})
            for name, style, label in (
                ("bound_known", ":", "bound, history known"), ("bound_unknown", "--", "bound, history unknown"),
                ("bound_camera", "-", "bound, and camera calibrated"), ("rmse", "o", "live pipeline"),
            ):  # fmt: skip
                of_load = [[row[name] for row in part if row["load_from_n"] == load] for load, _ in loads]
                at = [np.sqrt(np.mean(np.square(values))) for values in of_load]
                color = "tab:red" if name == "rmse" else "black"
                axis.plot(np.mean(loads, axis=1), at, style, color=color, label=label)
            axis.set(title=f"{', '.join(name[:2] for name in wanted)}, {low:g} to {high:g} degrees", yscale="log")
            axis.grid(alpha=0.3, which="both")
    axes[0, 0].legend(fontsize=7)
    for axis in axes[:, 0]:
        axis.set_ylabel("N")
    for axis in axes[1]:
        axis.set_xlabel("load, N")
    figure.tight_layout()
    figure.savefig(path, dpi=80)
