"""A sheet is not written for an adapter with other holes than the robot's rows have now."""

from dataclasses import replace
from pathlib import Path

import pytest

from cad.arm_adapter import adapter_part
from cad.errors import FileError
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.robot_sides import robot_side
from fab.build_sheet import robot_holes
from fab.meshing.mesh import tessellate
from fab.slice.projects import Export
from fab.variant import Variant

PARAMS = EndcapParams(117.4, 7.6)
ROBOT = "tensegrity_arm"


@pytest.fixture(scope="module")
def made():
    """An export of that robot, and the mesh of its adapter."""
    export = Export(Path("exports") / "x", Variant(MoldLayout(PARAMS), ROBOT), {})
    return export, tessellate(adapter_part(PARAMS, ROBOT).solid)


def test_the_holes_of_the_adapter_as_it_was_made_are_found(made):
    robot_holes.require_holes(*made)


@pytest.mark.parametrize(
    ("number", "change", "said"),
    [
        (0, {"circle_radius_mm": 25.5}, "no screw's hole 6.6 mm wide at x=22.1, y="),
        (0, {"hole_diameter_mm": 5.5}, "no screw's hole 5.5 mm wide"),
        (1, {"first_azimuth_deg": 90.0}, "no pin's hole 6.3 mm wide at x=0.0, y=25.0"),
    ],
)
def test_rows_that_were_corrected_since_are_refused_with_the_command(made, number, change, said, monkeypatch):
    """The sheet named the new screws and their depth, and the printed adapter had the old holes."""
    holes = list(robot_side(ROBOT))
    holes[number] = replace(holes[number], **change)
    monkeypatch.setattr(robot_holes, "robot_side", lambda robot: holes)
    with pytest.raises(FileError) as caught:
        robot_holes.require_holes(*made)
    assert said in str(caught.value) and f"run `make molds D=117.4 T=7.6 robot={ROBOT}` again" in str(caught.value)
