"""Screws, nuts and inserts on their way in: free where they should pass, the volume of what is put in their way."""

from __future__ import annotations

import math

import manifold3d
import pytest
import trimesh

from cad import robot_sides as robot_sides_module
from cad.arm_adapter import adapter_part
from cad.base import base_part
from cad.fasteners import ScrewJoint
from cad.hanger import hanger_part, screw_joints
from cad.interface import build_flange
from cad.mold.core import REMOVAL_ORDER
from cad.mold.cup import cup_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.robot_sides import robot_sides
from fab.bom import all_joints
from fab.checks.extraction import Leg
from fab.checks.meshes import OVERLAP_MM3
from fab.checks.screw_fit import ScrewFit, fitted
from fab.meshing.mesh import tessellate, to_manifold
from fab.steps.endcap import all_steps
from fab.steps.fasteners import (
    inserts_on_their_way,
    nuts_on_their_way,
    robot_fixings_on_their_way,
    screw_overlap_mm3,
    screws_on_their_way,
)
from fab.steps.record import Move, Step

PARAMS = EndcapParams(98.9, 6.5)
STEP = Step("drive", "assemble", "", (), (Move(("plate", "lid"), (Leg((0.0, 0.0, 1.0), 40.0),), ("block",)),))


def test_nuts_pass_the_mouths_of_their_pockets_and_nothing_else():
    flange, nuts = to_manifold(tessellate(build_flange(PARAMS))), nuts_on_their_way(PARAMS)
    assert (nuts ^ flange).volume() < OVERLAP_MM3
    assert (nuts ^ flange.rotate([0.0, 0.0, 3.0])).volume() > 20.0
    assert (nuts.translate([0.0, 0.0, 0.2]) ^ flange).volume() > 20.0


@pytest.mark.long
def test_inserts_pass_the_holes_of_the_lugs_and_nothing_else():
    base, inserts = to_manifold(tessellate(base_part(PARAMS).solid)), inserts_on_their_way(PARAMS)
    assert (inserts ^ base).volume() < OVERLAP_MM3
    assert (inserts ^ base.rotate([0.0, 0.0, 1.0])).volume() > 20.0


@pytest.mark.parametrize("robot", sorted(robot_sides()))
def test_screws_and_pin_of_every_robot_pass_the_adapter_and_nothing_else(robot):
    adapter = to_manifold(tessellate(adapter_part(PARAMS, robot).solid))
    swept = robot_fixings_on_their_way(PARAMS, robot)
    assert (swept is None) == (robot == "blank")
    if swept is not None:
        assert (swept ^ adapter).volume() < OVERLAP_MM3
        assert (swept.rotate([0.0, 0.0, 3.0]) ^ adapter).volume() > 20.0


@pytest.mark.parametrize(
    ("rows", "head_mm"),
    [
        ("mine,screw,4,25,45,5.5,9.5,5,8,ISO 4762 M5 x 20,E,\nmine,pin,1,25,90,5,0,0,0,ISO 2338 5 m6,E,\n", 8.5),
        ("mine,screw,4,25,45,9,13.5,8,10,ISO 4762 M8 x 20,E,\n", 13.0),
    ],
)
def test_screws_of_another_thread_sweep_what_is_ordered(rows, head_mm, tmp_path, monkeypatch):
    copy = tmp_path / "robot_sides.csv"
    copy.write_text(robot_sides_module.TABLE.read_text() + rows)
    monkeypatch.setattr(robot_sides_module, "TABLE", copy)
    table = robot_sides_module.robot_sides.__wrapped__()
    monkeypatch.setattr(robot_sides_module, "robot_sides", lambda: table)
    adapter = to_manifold(tessellate(adapter_part(PARAMS, "mine").solid))
    swept = robot_fixings_on_their_way(PARAMS, "mine")
    assert (swept ^ adapter).volume() < OVERLAP_MM3
    above = swept.trim_by_plane((0.0, 0.0, 1.0), -PARAMS.base_thickness_mm)  # where heads and their keys come from
    least_x, _, _, most_x, _, _ = above.bounding_box()
    assert most_x - least_x == pytest.approx(2 * 25.0 * math.cos(math.pi / 4) + head_mm, abs=0.05)


def joint(holder: str, up: bool) -> ScrewFit:
    made = ScrewJoint(
        "a_to_b", "a", "screw_m3", "ISO 4762", "", ((0.0, 0.0),), up, "plate", ("plate",), "block", holder
    )
    return ScrewFit(made, 16.0, 6.0, 9.0, 7.5, 1.0, 0.0, seat_mm=0.0)


def slab(low: float, high: float, hole_radius: float) -> manifold3d.Manifold:
    hole = manifold3d.Manifold.cylinder(100.0, hole_radius, circular_segments=96).translate([0.0, 0.0, -50.0])
    return manifold3d.Manifold.cube([40.0, 40.0, high - low], True).translate([0.0, 0.0, (low + high) / 2]) - hole


def slab_mesh(low: float) -> trimesh.Trimesh:
    """A block over the whole mold from a height on."""
    return trimesh.creation.box(bounds=((-200.0, -200.0, low), (200.0, 200.0, low + 20.0)))


@pytest.mark.parametrize("up", [True, False])
def test_a_screw_passes_its_holes_and_meets_what_covers_its_head(up):
    fit, sign = joint("plastic", up), 1.0 if up else -1.0

    def body(low: float, high: float, hole: float) -> manifold3d.Manifold:
        ends = sorted((sign * low, sign * high))
        return slab(ends[0], ends[1], hole)

    parts = {"plate": body(0.0, 6.0, 1.7), "block": body(6.0, 20.0, 1.3), "lid": body(-20.0, -15.0, 3.0)}
    assert screw_overlap_mm3(fit, STEP, parts) == 0.0
    lid = screw_overlap_mm3(fit, STEP, parts | {"lid": body(-20.0, -15.0, 1.0)})
    assert lid == pytest.approx(math.pi * (2.75**2 - 1.0) * 5.0, rel=0.01)
    root = (3.0 - 1.2269 * 0.5) / 2
    full = screw_overlap_mm3(fit, STEP, parts | {"block": body(6.0, 20.0, 0.5)})
    assert full == pytest.approx(math.pi * (root**2 - 0.25) * 10.0, rel=0.01)
    wide = screws_on_their_way(joint("captured nut", up), "block")  # a thread that cuts nothing is swept whole
    assert (wide ^ body(6.0, 20.0, 1.3)).volume() == pytest.approx(math.pi * (1.5**2 - 1.3**2) * 10.0, rel=0.02)


@pytest.mark.parametrize("size", [(98.86, 6.5), (99.0, 8.0), (99.3, 9.9)])
def test_the_collars_screws_end_before_the_bowl(size):
    layout = MoldLayout(EndcapParams(*size))
    parts = {part.name: tessellate(part.solid, 0.1) for part in (hanger_part(layout), *cup_parts(layout))}
    joints = [j for j in screw_joints(layout) if j.anchor.startswith("cup_collar")]
    for fit in (fitted(j, parts) for j in joints):
        assert [check.name for check in fit.checks if not check.ok] == []
        tip = fit.length_mm - layout.hanger_thickness_mm
        screws = [manifold3d.Manifold.cylinder(tip + 0.35, 1.5).translate([*xy, 0.0]) for xy in fit.joint.places]
        for name in ("cup_bowl_1", "cup_bowl_2", "cup_bowl_3"):  # it held the mold open by half a millimetre
            assert sum((screw ^ to_manifold(parts[name])).volume() for screw in screws) < 1e-6
        closed = parts | {name: slab_mesh(layout.seam_height_mm) for name in fit.joint.beyond}
        sound = all(check.ok for check in fitted(fit.joint, closed).checks)
        assert sound == (layout.seam_height_mm > tip + 0.45)  # a bowl without its holes is seen


@pytest.mark.parametrize("size", [(98.9, 6.5), (130.0, 8.0)])
def test_every_joint_is_driven_in_one_step(size):
    layout = MoldLayout(EndcapParams(*size))
    ways = {name: (Leg((0.0, 0.0, -1.0), 100.0),) for name in REMOVAL_ORDER}
    steps = [step for step in all_steps(layout, ways) if step.enters]
    driven = [j.name for step in steps if step.screws for j in all_joints(layout) if j.name.startswith(step.screws)]
    assert sorted(driven) == sorted(j.name for j in all_joints(layout))
    assert {extra for step in steps for extra in step.extras} >= {"nuts", "inserts"}
