"""Walls round the holes that screws hold in, and holes that break out: measured on blocks, and planted in the mold."""

from __future__ import annotations

import math

import manifold3d
import pytest
import trimesh
from long_cases import others_long

from cad.fasteners import ScrewJoint
from cad.mold.core import core_body, core_parts
from cad.mold.cup import cup_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.bom import all_joints
from fab.checks.hole_walls import ANGLES, hole_wall_checks, hole_wall_mm
from fab.checks.through_holes import through_hole_checks, through_holes
from fab.checks.walls import min_wall_mm
from fab.meshing.mesh import from_manifold
from fab.meshing.parts import PartMeshes

RADIUS_MM, DEPTH_MM = 1.3, 14.0
CHORD_MM = RADIUS_MM * (1 - math.cos(math.pi / 64))


def joint(holder: str = "plastic", up: bool = True) -> ScrewJoint:
    return ScrewJoint("j", "block", "screw_m3", "", "", ((0.0, 0.0),), up, "block", ("block",), "block", holder)


def drilled(beside_mm: float, up: bool = True, depth_mm: float = DEPTH_MM) -> dict[str, trimesh.Trimesh]:
    """A block from z = 0 upward, or downward, with a blind hole on the axis, its side that far from the block's."""
    block = manifold3d.Manifold.cube([40, 40, 20]).translate([RADIUS_MM + beside_mm - 40, -20, 0])
    solid = block - manifold3d.Manifold.cylinder(depth_mm, RADIUS_MM, RADIUS_MM, 64)
    return {"block": from_manifold(solid if up else solid.rotate([180, 0, 0]))}


@pytest.mark.parametrize("up", [True, False])
@pytest.mark.parametrize("beside_mm", [0.3, 0.9, 3.0])
def test_the_wall_beside_a_hole(beside_mm, up):
    found = hole_wall_mm(joint(up=up), drilled(beside_mm, up)["block"], (0.0, 0.0))
    between_rays = (RADIUS_MM + beside_mm) * (1 / math.cos(math.pi / ANGLES) - 1)
    assert beside_mm - 1e-4 <= found <= beside_mm + 2 * CHORD_MM + between_rays


@pytest.mark.parametrize("beside_mm", [-0.05, -0.6, -1.2])
def test_a_hole_that_is_open_to_the_side_has_no_wall(beside_mm):
    meshes = drilled(beside_mm)
    assert hole_wall_mm(joint(), meshes["block"], (0.0, 0.0)) == 0.0
    assert [check.ok for check in hole_wall_checks([joint()], meshes)] == [False]


def test_a_hole_through_the_part_counts_to_its_far_end():
    assert hole_wall_mm(joint(), drilled(2.0, depth_mm=30.0)["block"], (0.0, 0.0)) == pytest.approx(2.0, abs=0.03)


def test_only_holes_that_a_screw_or_an_insert_holds_in_are_measured():
    assert hole_wall_checks([joint("captured nut"), joint("loose nut")], drilled(0.1)) == []


def test_holes_through_a_block_are_counted():
    block = manifold3d.Manifold.cube([20, 20, 8], True)
    hole = manifold3d.Manifold.cylinder(20, 1, 1, 32, True)
    blind = manifold3d.Manifold.cylinder(3, 1, 1, 32)
    assert through_holes(from_manifold(block)) == 0
    assert through_holes(from_manifold(block - hole.translate([5, 0, 0]) - hole.translate([-5, 0, 0]))) == 2
    assert through_holes(from_manifold(block - blind.translate([0, 0, 1]))) == 0
    assert through_holes(from_manifold(block - blind.translate([9.5, 0, 1]))) == 0  # a notch in an edge is no hole
    assert through_holes(from_manifold(block - blind.rotate([0, 90, 0]).translate([7, 0, 3.5]))) == 0
    deep = manifold3d.Manifold.cylinder(8, 1, 1, 32)
    tunnel = manifold3d.Manifold.cylinder(30, 1, 1, 32, True).rotate([0, 90, 0])
    assert through_holes(from_manifold(block - deep - tunnel)) == 2  # the blind one broke into it


@pytest.mark.parametrize(("diameter", "holes"), others_long([(99.5, 4), (100.5, 2), (104.0, 2)], 2, unpack=True))
def test_a_low_collar_is_drilled_through_and_a_higher_one_keeps_a_roof(diameter, holes, monkeypatch):
    layout = MoldLayout(EndcapParams(diameter, 7.0))

    def collar() -> dict[str, trimesh.Trimesh]:
        meshes = PartMeshes(0.02)
        return {part.name: meshes.of(part) for part in cup_parts(layout) if part.name == "cup_collar_1"}

    sound = collar()
    assert through_holes(sound["cup_collar_1"]) == holes
    assert all(check.ok for check in through_hole_checks(layout, sound))
    assert min_wall_mm(sound["cup_collar_1"]) > 1.15
    monkeypatch.setattr(MoldLayout, "collar_screw_depth_mm", 12.0)  # as they were
    assert (min_wall_mm(collar()["cup_collar_1"]) < 0.8) == (diameter == 100.5)


@pytest.mark.parametrize(("diameter", "wall"), others_long([(170.0, 17.0), (250.0, 25.0), (210.0, 19.55)], unpack=True))
def test_screws_of_the_core_keep_off_the_cavity_under_a_thick_wall(diameter, wall, monkeypatch):
    """Midway to the neck, as they were, they came within 0.3 mm of the cavity at D=170 T=17, and into it at D=250."""
    layout = MoldLayout(EndcapParams(diameter, wall, (1, 3, 3)))

    def pieces() -> dict[str, trimesh.Trimesh]:
        meshes = PartMeshes(0.02)
        return {part.name: meshes.of(part) for part in core_parts(layout, core_body(layout)) if part.name[-1] == "1"}

    def thinnest_mm(meshes: dict[str, trimesh.Trimesh]) -> float:
        joints = [joint for joint in all_joints(layout) if joint.anchor in meshes]
        return min(*map(min_wall_mm, meshes.values()), *(check.value for check in hole_wall_checks(joints, meshes)))

    sound = pieces()
    assert thinnest_mm(sound) > 1.99
    assert all(check.ok for check in through_hole_checks(layout, sound))
    monkeypatch.setattr("cad.mold.layout.CORE_SCREW_INSIDE_MM", -math.inf)
    broken = pieces()
    assert thinnest_mm(broken) < 0.8
    assert all(check.ok for check in through_hole_checks(layout, broken)) == (diameter < 200)
