"""No boolean of the kernel runs on several threads: OCCT returns an invalid solid then, rarely."""

from __future__ import annotations

from build123d import Box, Pos
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse, BRepAlgoAPI_Section

import cad.solids


def test_what_build123d_asks_for_is_not_passed_on():
    for kind in (BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse, BRepAlgoAPI_Section):
        operation = kind()
        assert not operation.RunParallel()
        operation.SetRunParallel(True)
        assert not operation.RunParallel(), kind.__name__


def test_booleans_still_work():
    body, tool = Box(2, 2, 2).solid(), (Pos(1, 0, 0) * Box(2, 2, 2)).solid()
    assert abs(cad.solids.intersected(body, tool, "box").volume - 4.0) < 1e-9
