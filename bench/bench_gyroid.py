"""Gyroid: grid step against error, and wall of the shell against what a ball reaches (D=130 unless said).

    python bench/bench_gyroid.py            all curves, about four minutes on one core
    python bench/bench_gyroid.py --only grid

Writes beside this file: gyroid.csv (one row a grid step and number of Newton steps, at a fixed period: density error
against the finest grid extrapolated, sheet wall, processor time, triangles, self-intersections), gyroid_ball.csv (share
of the voids that a 2.5 mm ball reaches, by D, T and voxel) and gyroid.png.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.feasible import MIN_WALL_MM
from cad.params import EndcapParams
from fab.checks.gyroid import sheet_walls_mm
from fab.meshing.cast_space import COVERED_SHARE, VOXEL_MM, ball_reach, cast_space
from fab.meshing.gyroid import STEP_MM, WALL_MM, gyroid_sheet, standing_sheet, volume_above
from fab.meshing.self_intersections import self_intersections
from fab.meshing.zone_grid import zone_grid

HERE = Path(__file__).parent
STEPS_MM = (1.6, 1.2, 1.0, 0.8, 0.6, 0.5, 0.4)
PERIOD_MM = 13.95
BALLS = (  # D, T, voxel
    *((130.0, wall, VOXEL_MM) for wall in (6.5, 7.0, 8.0, 13.0)),
    *((98.9, wall, VOXEL_MM) for wall in (6.5, 7.0)),
    *((250.0, wall, VOXEL_MM) for wall in (6.5, 8.0)),
    *((130.0, 6.5, voxel) for voxel in (0.4, 0.2)),
)


def grid_rows(params: EndcapParams) -> list[dict[str, float]]:
    """One row a step and number of Newton steps."""
    rows = []
    for newton_steps in (1, 2):
        for step in STEPS_MM:
            _say(f"grid {step} mm, {newton_steps} Newton steps")
            start = time.process_time()
            grid = zone_grid(params, step)
            sheet, _ = standing_sheet(
                grid, grid.points(), PERIOD_MM, params.flange_thickness_mm, newton_steps=newton_steps
            )
            seconds = time.process_time() - start
            walls = sheet_walls_mm(params, sheet)
            rows.append(
                {
                    "newton_steps": newton_steps,
                    "step_mm": step,
                    "tpu_mm3": volume_above(sheet, params.flange_thickness_mm),
                    "wall_mean_mm": float(walls.mean()),
                    "wall_std_mm": float(walls.std()),
                    "wall_p1_mm": float(np.percentile(walls, 1)),
                    "wall_p99_mm": float(np.percentile(walls, 99)),
                    "seconds": seconds,
                    "triangles": len(sheet.faces),
                    "self_intersections": self_intersections(sheet),
                }
            )
    finest = {row["step_mm"]: row["tpu_mm3"] for row in rows if row["newton_steps"] == 2}
    # Second order: error goes with the step squared, so two steps give the limit.
    limit = finest[0.4] + (finest[0.4] - finest[0.8]) * 0.4**2 / (0.8**2 - 0.4**2)
    return [row | {"density_error": row["tpu_mm3"] / limit - 1} for row in rows]


def ball_rows() -> list[dict[str, float]]:
    """One row a shell and voxel; sizes that cannot be made are left out."""
    rows = []
    for diameter, wall, voxel in BALLS:
        if wall < MIN_WALL_MM:
            continue
        _say(f"ball D={diameter:g} T={wall:g}, {voxel} mm voxels")
        params = EndcapParams(diameter, wall)
        cast = cast_space(params, gyroid_sheet(params).mesh, voxel)
        covered, gap = ball_reach(params, cast)
        rows.append(
            {"diameter_mm": diameter, "wall_mm": wall, "voxel_mm": voxel, "covered_share": covered, "floor_gap_mm": gap}
        )
    return rows


def read_csv(path: Path) -> list[dict[str, float]]:
    """Read a table back."""
    with path.open(newline="", encoding="utf-8") as stream:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(stream)]


def plot(path: Path, grid: list[dict[str, float]], balls: list[dict[str, float]]) -> None:
    """Density error, wall, cost, and the ball's reach."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from plain_ticks import plain_digits

    figure, axes = plt.subplots(1, 4, figsize=(17, 4), constrained_layout=True)
    for newton_steps, colour in ((1, "tab:gray"), (2, "tab:orange")):
        rows = [row for row in grid if row["newton_steps"] == newton_steps]
        step = [row["step_mm"] for row in rows]
        label = f"{newton_steps} Newton step{'s' * (newton_steps > 1)}"
        axes[0].loglog(step, [100 * abs(row["density_error"]) for row in rows], "o-", color=colour, label=label)
        axes[1].plot(step, [row["wall_mean_mm"] for row in rows], "o-", color=colour, label=label)
        low, high = ([row[key] for row in rows] for key in ("wall_p1_mm", "wall_p99_mm"))
        axes[1].fill_between(step, low, high, color=colour, alpha=0.25, lw=0)
    axes[2].loglog(step, [row["seconds"] for row in rows], "o-", label="processor time of one mesh, s")
    axes[2].loglog(step, [row["triangles"] / 1e5 for row in rows], "s-", label="triangles, 100,000")
    axes[0].set(xlabel="grid step, mm", ylabel="density error, %", title="density (period fixed)")
    axes[1].set(xlabel="grid step, mm", ylabel="mm", title="sheet wall: mean, 1st to 99th percentile")
    axes[2].set(xlabel="grid step, mm", title="cost")
    plain_digits(axes[0].xaxis, axes[0].yaxis, axes[2].xaxis, axes[2].yaxis)
    for axis in axes[:3]:
        axis.axvline(STEP_MM, color="k", ls=":", label=f"default {STEP_MM} mm")
    axes[1].axhline(WALL_MM, color="k", lw=0.5)
    for diameter in sorted({row["diameter_mm"] for row in balls}):
        rows = [row for row in balls if row["diameter_mm"] == diameter and row["voxel_mm"] == VOXEL_MM]
        axes[3].plot([r["wall_mm"] for r in rows], [r["covered_share"] for r in rows], "o-", label=f"D={diameter:g}")
    axes[3].axhline(COVERED_SHARE, color="k", ls=":", label="limit")
    axes[3].set(xlabel="wall T of the shell, mm", ylabel="share of the voids", title="reached by a 2.5 mm ball")
    for axis in axes:
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> None:
    """Run the studies asked for and draw what is there."""
    parser = argparse.ArgumentParser(description="Gyroid: grid step against error and cost; wall against ball reach.")
    parser.add_argument("--only", choices=("grid", "ball", "plot"), help="run one study; default: all")
    only = parser.parse_args(arguments).only
    grid_path, ball_path = HERE / "gyroid.csv", HERE / "gyroid_ball.csv"
    if only in (None, "grid"):
        write_table(grid_path, grid_rows(EndcapParams(130, 8)), figures=5)
    if only in (None, "ball"):
        write_table(ball_path, ball_rows(), figures=5)
    if grid_path.exists() and ball_path.exists():
        plot(HERE / "gyroid.png", read_csv(grid_path), read_csv(ball_path))


def _say(text: str) -> None:
    if sys.stderr.isatty():
        print(text, file=sys.stderr)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
