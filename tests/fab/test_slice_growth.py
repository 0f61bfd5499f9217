"""The explicit gyroid prints as much TPU as was asked for, and leaves open what that leaves open."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest

from cad.interface import zone_radii_mm
from cad.params import EndcapParams
from fab.meshing.gyroid import interface_mesh
from fab.slice.growth import BULK, CROSSING, END_MM, growth_mm
from fab.slice.printers import printer
from fab.slice.projects import gyroid_project
from fab.slice.result import slice_project
from fab.slice.run import NAMES
from fab.slice.settings import ROUNDING_MM

TABLE = Path(__file__).parents[2] / "bench" / "slice_growth.csv"
SLICER = next((path for name in NAMES if (path := shutil.which(name))), None)


def test_outlines_move_less_where_walls_are_thick_or_dense():
    fraction = 0.1
    right = END_MM / (BULK + CROSSING * fraction)  # here the line's round sides are all that is missing
    assert growth_mm(right, fraction) == pytest.approx(ROUNDING_MM / 2)
    assert growth_mm(4.5, fraction) > growth_mm(8.0, fraction) > growth_mm(23.0, fraction) > 0
    assert growth_mm(8.0, 0.12) < growth_mm(8.0, 0.08)


def test_the_law_is_the_least_squares_of_its_table():
    rows = np.genfromtxt(TABLE, delimiter=",", names=True)
    designs = [EndcapParams(row["D_mm"], row["T_mm"], gyroid=row["gyroid_percent"] / 100) for row in rows]
    radii = np.array([zone_radii_mm(params) for params in designs])
    excess = rows["fraction_percent"] / rows["gyroid_percent"] - 1
    terms = np.stack([np.ones(len(rows)), rows["gyroid_percent"] / 100, -1 / np.ptp(radii, axis=1)], axis=1)
    found, *_ = np.linalg.lstsq(terms, excess, rcond=None)
    assert found == pytest.approx([BULK, CROSSING, END_MM], rel=2e-3)
    assert np.std(excess - terms @ found) < 0.0035


@pytest.mark.long
@pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
def test_the_explicit_gyroid_prints_its_fraction_and_more_does_not_pass(tmp_path):
    params = EndcapParams(131.0, 13.0, gyroid=0.12)
    project = gyroid_project(params, interface_mesh(params).mesh, "TPU 95A", printer())
    result = slice_project(SLICER, project, tmp_path, params, keep_gcode=False)
    assert result.zone.fraction == pytest.approx(0.12, rel=0.01)  # 0.124 with a growth that knows no thickness
    assert all(check.ok for check in result.checks)
    covered = dataclasses.replace(result.zone, open_share=0.879)
    failed = [check.name for check in dataclasses.replace(result, zone=covered).checks if not check.ok]
    assert failed == ["interface_gyroid.zone_open_share"]
