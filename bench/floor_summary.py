"""The bounds of bench_floor.py beside the errors of single frames, by axis and load: docs/floor.md's table.

    python bench/floor_summary.py          # reads bench/floor.csv and bench/wrench_cells.csv, prints Markdown

Root mean squares over all frames to 55 degrees of tilt: bound with the loading history known, with it unknown, and
with what calibration leaves of the camera; error on the same frames (nominal sensor); error on the eight other
sensors of docs/wrench_accuracy.md, each calibrated from its rest picture, and that without the mean error of each
sensor in the range of load: no gain, and no shift, can take out more. N, N m.

Last, how many cells of those sensors would be over a goal if the estimate were at the bound: a goal near it cannot hold
in every cell, because a cell has three paths and one camera.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
LARGEST_TILT_DEG = 55.0
BOUNDS = ("bound_known", "bound_unknown", "bound_camera")
COLUMNS = (
    "load", "axis", "history known", "unknown", "and camera", "nominal sensor", "other sensors", "without their mean",
)  # fmt: skip
OTHERS = tuple(f"ours, sensor{number}" for number in range(91, 99))
GOAL_N, GOAL_LOAD_N = 0.10, (20.0, 30.0)  # of fz, in every cell
PATHS = 3  # of a cell
DRAWS = 20_000
Rows = list[dict[str, str]]


def main() -> None:
    """Print the table."""
    bounds, cells = (_read(HERE / name) for name in ("floor.csv", "wrench_cells.csv"))
    print("|", " | ".join(COLUMNS), "|")
    print("|---" * len(COLUMNS) + "|")
    for load in sorted({(float(row["load_from_n"]), float(row["load_to_n"])) for row in bounds}):
        for axis in dict.fromkeys(row["axis"] for row in bounds):
            here = [row for row in _of_load(bounds, load) if row["axis"] == axis]
            values = [_rms(here, name) for name in (*BOUNDS, "rmse")]
            values += _others(_of_load(cells, load), axis)
            print(f"| {load[0]:g} to {load[1]:g} N | {axis} |", " | ".join(f"{value:.2g}" for value in values), "|")
    print(f"\n{_over_the_goal(bounds, cells)}")


def _read(file: Path) -> Rows:
    """Rows of a table to the largest tilt, with frames."""
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [row for row in rows if float(row["tilt_to_deg"]) <= LARGEST_TILT_DEG and int(row["frames"])]


def _of_load(rows: Rows, load: tuple[float, float]) -> Rows:
    """Those from the same load on; the last range ends at 60 N in one table, at the largest force in the other."""
    return [row for row in rows if float(row["load_from_n"]) == load[0]]


def _rms(rows: Rows, name: str) -> float:
    """Root mean square over all frames of the rows."""
    frames = np.array([int(row["frames"]) for row in rows])
    return float(np.sqrt(frames @ np.array([float(row[name]) for row in rows]) ** 2 / frames.sum()))


def _others(cells: Rows, axis: str) -> list[float]:
    """Error on the other sensors, and what it is without each sensor's mean."""
    square, left, count = 0.0, 0.0, 0
    for name in OTHERS:
        rows = [row for row in cells if row["name"] == name]
        frames = np.array([int(row["frames"]) for row in rows])
        mean = frames @ np.array([float(row[f"bias_{axis}"]) for row in rows]) / frames.sum()
        own = frames.sum() * _rms(rows, f"rmse_{axis}") ** 2
        square, left, count = square + own, left + own - frames.sum() * mean**2, count + frames.sum()
    return [float(np.sqrt(total / count)) for total in (square, left)]


def _over_the_goal(bounds: Rows, cells: Rows) -> str:
    """Cells over the goal on the other sensors, and of as many at the bound.

    A sensor has one camera and a path one history, so these parts of the bound are drawn once for each:
    RMSE^2 = c^2 + sum h_k^2 / PATHS, c of the variance camera - unknown, h_k of the variance unknown.
    """
    found = [float(row["rmse_fz_n"]) for row in _of_load(cells, GOAL_LOAD_N) if row["name"] in OTHERS]
    fz = [row for row in _of_load(bounds, GOAL_LOAD_N) if row["axis"] == "fz_n"]
    unknown, camera = (np.array([float(row[name]) for row in fz]) for name in BOUNDS[1:])
    rng = np.random.default_rng(0)
    of_sensor = rng.standard_normal((DRAWS, len(OTHERS), 1)) ** 2 * (camera**2 - unknown**2)
    of_paths = (rng.standard_normal((DRAWS, len(OTHERS), len(fz), PATHS)) ** 2).mean(axis=3) * unknown**2
    drawn = np.sqrt(of_sensor + of_paths).reshape(DRAWS, -1)
    over, worst = (drawn > GOAL_N).sum(axis=1), drawn.max(axis=1)
    return (
        f"fz at {GOAL_LOAD_N[0]:g} to {GOAL_LOAD_N[1]:g} N: {sum(value > GOAL_N for value in found)} of {len(found)} "
        f"cells over {GOAL_N:.2f} N, {max(found):.2f} N at most; at the bound {over.mean():.1f} "
        f"({np.quantile(over, 0.05):.0f} to {np.quantile(over, 0.95):.0f} in 90 %), {np.median(worst):.2f} N at most "
        f"({np.quantile(worst, 0.05):.2f} to {np.quantile(worst, 0.95):.2f})"
    )


if __name__ == "__main__":
    main()
