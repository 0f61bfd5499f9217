"""Slicing the interface at sizes and gyroid fractions drawn from the whole region and at two corners of it, both forms.

    python bench/bench_slice_sizes.py           12 designs and the corners, about an hour on one core; needs PrusaSlicer
    python bench/bench_slice_sizes.py --count 4 --seed 7

Writes slice_sizes.csv beside this file, a row a design and form: what the gates of ``make slice`` read from the G-code
(printed fraction of the zone, open share of its boundary) and which of them refuse. Ends with status 1 where one does.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.errors import ParameterError
from cad.feasible import MAX_DIAMETER_MM, MAX_WALL_RATIO, MIN_WALL_MM
from cad.params import EndcapParams
from cad.pattern import GYROID_RANGE
from fab.meshing.gyroid import interface_mesh
from fab.slice.printers import printer
from fab.slice.projects import gyroid_project, infill_project
from fab.slice.result import SliceResult, slice_project
from fab.slice.run import find_slicer

TABLE = Path(__file__).with_name("slice_sizes.csv")
MATERIAL = "TPU 95A"
LEAST_MM = 98.86  # the smallest diameter, rounded up
THIN_MM = 8.0  # a wall below it is thin
CORNERS = (
    EndcapParams(LEAST_MM, MIN_WALL_MM, gyroid=GYROID_RANGE[1]),
    EndcapParams(MAX_DIAMETER_MM, MAX_WALL_RATIO * MAX_DIAMETER_MM / 2, gyroid=GYROID_RANGE[1]),
)


def main() -> int:
    """Slice, write the table, say what was refused."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=12, help="random designs")
    parser.add_argument("--seed", type=int, default=28)
    options = parser.parse_args()
    rows = []
    for params in [*designs(options.count, options.seed), *CORNERS]:
        for result in sliced(params):
            rows.append(row(params, result))
            print(*rows[-1].values(), file=sys.stderr)
    write_table(TABLE, rows)
    return any(entry["refused"] for entry in rows)


def designs(count: int, seed: int) -> list[EndcapParams]:
    """Sizes at random; every other one has an end of the range of fractions, every fourth a thin wall."""
    rng = random.Random(seed)
    found: list[EndcapParams] = []
    while len(found) < count:
        diameter, number = round(rng.uniform(LEAST_MM, MAX_DIAMETER_MM), 2), len(found)
        thickest = THIN_MM if number % 4 == 3 else MAX_WALL_RATIO * diameter / 2
        wall = round(rng.uniform(MIN_WALL_MM, thickest), 2)
        gyroid = GYROID_RANGE[number // 2 % 2] if number % 2 else round(rng.uniform(*GYROID_RANGE), 3)
        try:
            found.append(EndcapParams(diameter, wall, gyroid=gyroid))
        except ParameterError:
            continue  # near D = 99 and 120 the wall has a limit of its own
    return found


def sliced(params: EndcapParams) -> list[SliceResult]:
    """Both forms of the interface."""
    where, slicer = printer(), find_slicer()
    projects = (
        infill_project(params, MATERIAL, where),
        gyroid_project(params, interface_mesh(params).mesh, MATERIAL, where),
    )
    with tempfile.TemporaryDirectory() as folder:
        return [slice_project(slicer, project, Path(folder), params, keep_gcode=False) for project in projects]


def row(params: EndcapParams, result: SliceResult) -> dict[str, object]:
    """One line of the table."""
    assert result.zone is not None
    return {
        "D_mm": params.diameter_mm,
        "T_mm": params.wall_mm,
        "gyroid_percent": round(100 * params.gyroid, 2),
        "form": result.name,
        "fraction_percent": round(100 * result.zone.fraction, 3),
        "open_percent": round(100 * result.zone.open_share, 2),
        "floating_starts": result.figures.floating_starts,
        "refused": " ".join(check.name for check in result.checks if not check.ok),
    }


if __name__ == "__main__":
    sys.exit(in_one_line(main))
