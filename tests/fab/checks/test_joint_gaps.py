"""The gap of a joint: what the kernel's own edges leave uncertain is allowed, a wrong gap is not."""

from __future__ import annotations

import pytest
from build123d import Box, Pos, Solid

from cad.mold.core import core_body, core_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.fit import CLEARANCE_MM, MOST_EDGE_MM, _gap_mm, clearance_checks


def test_faces_leave_nothing_uncertain_and_a_shifted_piece_fails():
    names = ("cup_bowl_1", "cup_bowl_2", "cup_collar_1", "cup_collar_2", "core_centre", "core_key_1", "core_wedge_1")
    layout = MoldLayout(EndcapParams(130.0, 8.0))
    for gap_mm, fits in ((0.15, True), (0.1495, True), (0.148, False), (0.152, False)):
        first, second = Box(10, 10, 10).solid(), (Pos(10 + gap_mm, 0, 0) * Box(10, 10, 10)).solid()
        gap, edge = _gap_mm(first, second)
        assert gap == pytest.approx(gap_mm, abs=1e-9) and edge < 1e-6
        solids = dict.fromkeys(names, first) | {"interface": first, "cup_bowl_2": second}
        check = next(check for check in clearance_checks(layout, solids) if check.name == "joint_bowl.gap_mm")
        assert check.ok == fits, gap_mm


def test_a_piece_inside_another_one_has_no_gap():
    outer, inner = Box(10, 10, 10).solid(), Box(2, 2, 2).solid()
    hollow = (Box(10, 10, 10) - Box(4, 4, 4)).solid()
    for pair, gap_mm in (((outer, inner), 0.0), ((hollow, inner), 1.0), ((hollow, Box(6, 6, 6).solid()), 0.0)):
        assert _gap_mm(*pair)[0] == _gap_mm(*pair[::-1])[0] == pytest.approx(gap_mm, abs=1e-9)


@pytest.mark.long
def test_an_edge_that_the_kernel_knows_to_a_micrometre_only_is_no_narrow_joint():
    """D=126.92 T=10.77: a B-spline edge 0.15 mm long, beside its cone by 0.0011 mm; every face has its gap."""
    layout = MoldLayout(EndcapParams(126.92, 10.77))
    parts: dict[str, Solid] = {part.name: part.solid for part in core_parts(layout, core_body(layout))}
    gap, edge = _gap_mm(parts["core_centre"], parts["core_key_1"])
    assert gap < layout.joint_clearance_mm - CLEARANCE_MM < gap + edge
    assert edge < MOST_EDGE_MM
