"""The independent code on a small press with friction; skipped where it is not installed."""

import shutil

import numpy as np
import pytest

from sensing.simulator.solid.element import volume_rule
from sensing.simulator.solid.mesh import MeshDensity, box_mesh
from sensing.simulator.verification import calculix as verify_calculix


def test_the_twenty_nodes_are_corners_and_edges_in_its_order() -> None:
    _, rule = volume_rule()
    assert len(rule) == 27
    points = box_mesh((1, 1, 1), (2.0, 2.0, 2.0)).points[box_mesh((1, 1, 1), (2.0, 2.0, 2.0)).cells[0]]
    twenty = points[verify_calculix.C3D20]
    assert np.array_equal(twenty[:4, 2], np.zeros(4)) and np.array_equal(twenty[4:8, 2], np.full(4, 2.0))
    for first, corners in ((8, (0, 1, 2, 3)), (12, (4, 5, 6, 7))):  # edge nodes lie between consecutive corners
        for k in range(4):
            middle = (twenty[corners[k]] + twenty[corners[(k + 1) % 4]]) / 2
            assert np.array_equal(twenty[first + k], middle)
    assert np.array_equal(twenty[16:], (twenty[:4] + twenty[4:8]) / 2)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")
def test_calculix_finds_the_same_press_and_pull() -> None:
    found = verify_calculix.compare(MeshDensity(4, 7, 2), 3.0, 1.5, tilt_deg=20.0, friction=0.4, increments=2)
    assert found.force_gap.max() < 0.02  # finer meshes come within 1 %: docs/verification.md
    assert found.marker_gap.max() < 0.04
    assert np.abs(found.ours[1, 0] - found.ours[0, 0]) > 3.0  # the pull is there to be compared
