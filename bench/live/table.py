"""Table and plot of the live benchmark (bench_live.py)."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

TABLE = Path(__file__).resolve().parents[1] / "live.csv"
COLUMNS = (
    "model", "method", "endcaps", "workers", "outputs", "rate_hz", "in_step", "frames", "work_ms", "work_p99_ms",
    "frames_s_core", "core_share", "loop_share", "page_share", "p50_ms", "p99_ms", "idle_share", "dropped",
    "force_error_n", "torque_error_nm", "contact_right",
)  # fmt: skip


def save(rows: Sequence[Mapping[str, Any]], path: Path = TABLE) -> None:
    """The table."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})


def draw(rows: list[dict], path: Path) -> None:
    """Error against time on a frame, beside the table at a path."""
    figure, axis = plt.subplots(figsize=(6, 4))
    for row in rows:
        if "force_error_n" in row:
            mark = "o" if row["model"] == "default" else "s"
            axis.plot(row["work_ms"], row["force_error_n"], mark)
            axis.annotate(f" {row['model']}, {row['method']}", (row["work_ms"], row["force_error_n"]))
    axis.set(xscale="log", xlabel="CPU time on a frame, ms", ylabel="rms force error on the robot scene, N")
    axis.set_ylim(bottom=0)
    axis.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    axis.minorticks_off()
    axis.set_xlim(1, 40)
    axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path.with_suffix(".png"), dpi=110)
