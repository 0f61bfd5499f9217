"""Errors by tilt and load: loads are parted in proportion to the weights' range, and no frame falls out."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sensing.evaluation.cells import CSV_COLUMNS, LOADS_N, cell_tables, cells, cells_csv
from sensing.evaluation.live_answers import LiveAnswers


def answers(loads_n: np.ndarray, off_n: float = 0.5) -> LiveAnswers:
    """Frames with a force along z, answered wrong by a constant."""
    count = len(loads_n)
    truth = np.zeros((count, 6))
    truth[:, 2] = -loads_n
    value = truth + np.array([0, 0, off_n, 0, 0, 0])
    covariance = np.tile(np.eye(6), (count, 1, 1))
    here = np.full(count, 30.0), np.full((count, 4), np.nan), np.full(count, True), np.full(count, "p")
    return LiveAnswers(value, truth, covariance, covariance, np.full(count, False), *here)


@pytest.mark.parametrize("scale", [1.0, 9.766, 0.06])
def test_loads_are_parted_alike_in_every_range(scale):
    loads = scale * np.array([2.0, 7.0, 15.0, 25.0, 35.0, 50.0])
    found = cells(answers(loads), scale)
    assert [cell.frames for cell in found] == [1] * 6
    assert np.array([cell.load_n[1] for cell in found]) == pytest.approx(scale * np.array(LOADS_N[1:]), rel=5e-3)
    assert all(cell.rmse[2] == pytest.approx(0.5) for cell in found)
    assert "35 to 45 deg" not in cell_tables(found)


@pytest.mark.parametrize("scale", [1.0, 1.266, 9.766])
def test_columns_stay_apart_at_every_size(scale):
    """Also where edges have more digits than those of the released one; every row is as wide as its head."""
    loads = scale * np.array([2.0, 7.0, 15.0, 25.0, 35.0, 59.0])
    lines = cell_tables(cells(answers(loads), scale)).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert all(len(re.findall(r"(?<= )[\d.]+ to [\d.]+ N(?= |$)", line)) == 6 for line in lines if "tilt" in line)


def test_a_frame_beyond_the_last_edge_is_counted():
    assert sum(cell.frames for cell in cells(answers(np.array([3.0, 59.0, 341.0])))) == 3


@pytest.mark.parametrize("off_n", [2.0, -2.0])
def test_frames_far_off_are_counted_with_and_without_a_flag(off_n):
    far = replace(answers(np.array([3.0, 3.5, 4.0, 4.5]), off_n), flagged=np.array([True, False, True, True]))
    near = answers(np.array([3.0, 3.5]), off_n=0.9)
    assert [(cell.far, cell.far_flagged, cell.bias[2]) for cell in cells(far)] == [(4, 3, off_n)]
    assert cells(far)[0].coverage == pytest.approx(5 / 6)  # 2 standard deviations are beyond 1.96, the other axes right
    assert "3 of 4" in cell_tables(cells(far)) and cells(near)[0].far == 0


def test_what_is_far_off_goes_with_the_endcaps_forces():
    """0.5 N is nothing at D=130 T=8, and twice what the softest endcap's weights may be off."""
    soft, hard = cells(answers(np.array([0.2, 0.3])), 0.04), cells(answers(np.array([5.5, 7.0])))
    assert (sum(cell.far for cell in soft), sum(cell.far for cell in hard)) == (2, 0)
    assert "off by 0.04 N, flagged" in cell_tables(soft) and "off by 1 N, flagged" in cell_tables(hard)


def test_a_set_without_contact_has_empty_tables():
    """Untouched recordings, and stands of a robot on no endcap: they ended in an IndexError."""
    untouched = replace(answers(np.array([3.0, 7.0])), contact=np.full(2, False))
    assert cells(untouched) == [] and cell_tables([]) == "no frame in contact"
    assert cells_csv({"ours": []}).decode().strip() == ",".join(CSV_COLUMNS)
    some = cells_csv({"ours": cells(answers(np.array([3.0])))}).decode().splitlines()
    assert some[0] == ",".join(CSV_COLUMNS) and some[1].startswith("ours,25,35,0,5,1,")
