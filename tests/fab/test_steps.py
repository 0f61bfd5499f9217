"""The list of steps: every part gets in, the order follows the geometry, a wrong order overlaps, the words agree."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from cad.feasible import wall_range_mm
from cad.hanger import hanger_part
from cad.interface import build_flange, build_zone
from cad.mold.core import REMOVAL_ORDER
from cad.mold.cup import BOWL, COLLAR
from cad.mold.layout import MoldLayout, rotated
from cad.params import EndcapParams
from fab.build_sheet.steps import BLANK
from fab.checks.extraction import Leg, core_path
from fab.meshing.mesh import joined, tessellate, to_manifold
from fab.recipe import closed_cast_mm3, overflow_of, recipe
from fab.steps.cast import cast_steps
from fab.steps.endcap import all_steps
from fab.steps.mold import UPPER, core_passes_gyroid, mold_steps
from fab.steps.radial_spans import BodySpans
from fab.steps.record import Move, one_by_one
from fab.steps.sweep import move_overlap_mm3, places, step_bodies, sweep_checks
from fab.supplies import supply_lines

UP = (Leg((0.0, 0.0, 1.0), 120.0),)


@pytest.fixture(scope="module")
def workshop(released_mold):
    """Layout, meshes of all mold parts and of the interface's envelope, and the ways out of the core's pieces."""
    layout, _, meshes = released_mold
    flange, zone = (tessellate(build(layout.params)) for build in (build_flange, build_zone))
    interface = joined([flange, zone])
    made = {**meshes, "hanger": tessellate(hanger_part(layout).solid), "interface": interface}
    return layout, made, {name: core_path(layout, name, meshes[name]) for name in REMOVAL_ORDER}


def ways(layout: MoldLayout):
    """Ways of any size, for the list alone."""
    return {name: (Leg((0.0, 0.0, -1.0), 100.0),) for name in REMOVAL_ORDER}


def steps_of_the_mold(layout: MoldLayout, way):
    """From the printed parts to the demolded endcap."""
    return (*mold_steps(layout, way), *cast_steps(layout, way))


@pytest.mark.parametrize("size", [(98.86, 6.5), (110.0, 8.0), (130.0, 8.0), (250.0, 25.0)])
def test_every_part_enters_once_and_leaves_again(size):
    layout = MoldLayout(EndcapParams(*size))
    steps = steps_of_the_mold(layout, ways(layout))
    entered = [
        name for step in steps if step.enters and step.stage != "cast" for move in step.moves for name in move.parts
    ]
    left = [name for step in steps if not step.enters for move in step.moves for name in move.parts]
    first = "hanger" if core_passes_gyroid(layout) else "interface"  # stands on the table, and the rest is put to it
    assert set(entered) | {first} == {*UPPER, *BOWL}
    assert sorted(left) == sorted({*UPPER, *BOWL} - {"interface"})
    keys = [step.key for step in all_steps(layout, ways(layout))]
    assert len(set(keys)) == len(keys)
    assert keys.index("collar") < min(keys.index(key) for key in keys if key.startswith(("interface_on", "upper_unit")))


def test_the_core_goes_into_the_interface_first_where_the_gyroid_closes_over_its_equator():
    assert core_passes_gyroid(MoldLayout(EndcapParams(130.0, 8.0)))
    assert core_passes_gyroid(MoldLayout(EndcapParams(250.0, 15.0)))
    assert not core_passes_gyroid(MoldLayout(EndcapParams(99.0, 6.5)))
    order = [
        core_passes_gyroid(MoldLayout(EndcapParams(d, wall_range_mm(d)[0] + 1e-6)))
        for d in np.arange(100.0, 250.0, 5.0)
    ]
    assert order == sorted(order)  # one change of order, from the small sizes to the large


@pytest.mark.parametrize("size", [(104.0, 6.5), (130.0, 8.0)])
def test_the_upper_half_is_turned_over_once_and_drawn_as_it_is_held(size):
    layout = MoldLayout(EndcapParams(*size))
    steps = {step.key: step for step in steps_of_the_mold(layout, ways(layout))}
    unit, close = steps.get("upper_unit"), steps["close"]
    assert "Turn the upper half over" in close.lines[0] or unit is not None
    assert (unit is None) == ("Turn the upper half over" in close.lines[0])
    if unit:
        (move,) = unit.moves
        assert move.parts == ("hanger", *COLLAR) and move.way_out[0].direction == (0.0, 0.0, -1.0)
        assert unit.look.startswith("dome down")


@pytest.mark.parametrize("size", [(104.0, 6.5), (130.0, 8.0)])
def test_the_numbers_of_keys_and_wedges_are_where_the_sheet_sees_their_holes(size):
    """Seen from the hanger, along z, with the piece's outside up: a hole at a larger azimuth is on the right."""
    layout = MoldLayout(EndcapParams(*size))
    words = str(mold_steps(layout, ways(layout)))
    sides = re.search(r"number 1 has its hole on the (\w+), 2 in the (\w+), 3 on the (\w+)", words)
    assert sides
    for first, kind in ((0.0, "key"), (60.0, "wedge")):
        for k, side in enumerate(sides.groups()):
            x, y = rotated(layout.core_screws_mm[f"core_{kind}_{k + 1}"][0], -first - 120.0 * k)
            assert x > 0 and side == ("middle" if abs(y) < 1e-9 else "right" if y > 0 else "left")
    clockwise = re.search(r"Clockwise lie key 1, wedge 1, key 2", words)
    assert bool(clockwise) != core_passes_gyroid(layout)


@pytest.mark.parametrize("size", [(104.0, 6.5), (130.0, 8.0)])
def test_the_core_is_set_by_what_is_in_sight(size):
    """Toward the pins of the hanger, said the sheet; these lie hidden in the sockets of the collar by then."""
    layout = MoldLayout(EndcapParams(*size))
    steps = {step.key: step for step in mold_steps(layout, ways(layout))}
    later = [step for step in steps.values() if step.stage == "upper half" and step.key not in ("nuts", "collar")]
    words = " ".join(line for step in later for line in step.lines)
    assert "pins" not in words and "the middles of the collar's segments" in words
    assert list(layout.key_azimuths_deg) == [seam - 60.0 for seam in layout.collar_seams_deg]  # 120 degrees wide


@pytest.mark.parametrize("size", [(104.0, 6.5), (130.0, 8.0)])
def test_the_upper_half_is_lowered_with_its_seams_between_those_of_the_bowl(size):
    """Six bolts fit every 60 degrees; with seam on seam each ties a segment of the collar to the one under it alone."""
    layout = MoldLayout(EndcapParams(*size))
    close = next(step for step in cast_steps(layout, ways(layout)) if step.key == "close")
    assert "midway between the bowl's" in " ".join(close.lines)
    assert [seam - 60.0 for seam in layout.collar_seams_deg] == list(layout.bowl_seams_deg)


def test_the_lens_is_bare_only_after_the_last_glue():
    """Vapour of cyanoacrylate blooms on a lens; the cover came off a step before spacer and ring were glued."""
    layout = MoldLayout(EndcapParams(130.0, 8.0))
    words = [" ".join(step.lines) for step in all_steps(layout, ways(layout))]
    (bare,) = (k for k, step in enumerate(words) if "ens cover off" in step)
    assert bare > max(k for k, step in enumerate(words) if "glue at" in step or "drop of glue" in step)


def test_silicone_in_the_cores_joints_is_made_up_from_the_cup_and_trimmed():
    """The joints of the core hold 1.7 ml at D=104.6, 10 at D=173.7, as measured; half the wells hold 0.8."""
    layout = MoldLayout(EndcapParams(130.0, 8.0))
    words = {step.key: " ".join(step.lines) for step in cast_steps(layout, ways(layout))}
    assert len(re.findall(r"fill it (?:with the stick )?from (?:what is left in )?the cup", words["closed"])) == 2
    assert "fins" in words["wedges_out"]
    mix = recipe(closed_cast_mm3(layout.params), overflow_of(layout))
    assert mix.part_a_g + mix.part_b_g - mix.poured_g > 0.05 * mix.expected_g  # is left, part of it on cup and stick


def test_a_soft_ring_is_at_hand_and_where_a_step_names_it_the_core_hangs_through_it():
    """Without the bowl, its foot, a dome lies in the ring at every size; it was listed for the core alone."""
    for size, listed in (((104.0, 6.5), 1), ((130.0, 8.0), 0)):
        layout = MoldLayout(EndcapParams(*size))
        steps = mold_steps(layout, ways(layout))
        (ring,) = (line for line in supply_lines(recipe(2e5, overflow_of(layout)), layout) if line.item == "soft ring")
        assert ("interface while the core goes into it" in ring.use) == listed == ("soft ring" in str(steps))
        for width, height in re.findall(r"soft ring (\d+) mm wide inside and (\d+) mm high", str(steps)):
            params = layout.params
            above = params.interlock_top_mm - params.centre_height_mm
            assert 2 * math.sqrt(params.inner_radius_mm**2 - above**2) < float(width)
            assert float(width) < 2 * math.sqrt((params.outer_radius_mm - params.skin_mm) ** 2 - above**2)
            assert float(height) > params.tip_height_mm - params.wall_mm - params.interlock_top_mm


def test_no_step_of_the_upper_half_overlaps(workshop):
    layout, meshes, way = workshop
    close = next(step for step in cast_steps(layout, way) if step.key == "close")
    steps = [*mold_steps(layout, way), close]
    checks = sweep_checks(layout, steps, step_bodies(layout, steps, meshes))
    assert [check.name for check in checks if not check.ok] == []
    assert {check.name for check in checks} >= {
        f"step_{key}.overlap_mm3" for key in ("collar", "core_on_hanger", "close")
    }


def test_the_collar_does_not_pass_interface_or_core(workshop):
    """What the build sheet once asked for: the collar last."""
    _, meshes, _ = workshop
    bodies = {name: to_manifold(mesh) for name, mesh in meshes.items() if name != "interface"}
    bodies["interface"] = to_manifold(trimesh.creation.annulus(45.0, 63.6, 25.0))
    late = Move(COLLAR[:1], UP, ("core_centre", *REMOVAL_ORDER[1:]))
    assert move_overlap_mm3(late, bodies) > 1000.0
    assert move_overlap_mm3(Move(COLLAR[:1], UP, ("interface",)), bodies) > 1000.0


def test_a_segment_that_comes_from_the_side_meets_the_tabs(workshop):
    _, meshes, _ = workshop
    bodies = {name: to_manifold(meshes[name]) for name in COLLAR}
    sideways = (Leg((math.cos(math.radians(120.0)), math.sin(math.radians(120.0)), 0.0), 60.0),)
    assert move_overlap_mm3(Move(COLLAR[:1], sideways, COLLAR[1:]), bodies) > 5.0


def test_the_overlap_is_the_volume_of_two_boxes():
    box = to_manifold(trimesh.creation.box((10, 10, 10)))
    bodies = {"a": box, "b": box.translate([0, 0, 35])}
    way = (Leg((0.0, 0.0, 1.0), 50.0),)
    shifts = [place[2] for place in places(way)]
    wanted = max(max(0.0, 10 - abs(35 - shift)) for shift in shifts) * 100
    assert wanted > 0 and move_overlap_mm3(Move(("a",), way, ("b",)), bodies) == pytest.approx(wanted, rel=1e-6)
    spans = {name: BodySpans(body) for name, body in bodies.items()}.__getitem__  # apart at first, not on the way
    found = move_overlap_mm3(Move(("a",), way, ("b",)), bodies, spans=spans)
    assert found == pytest.approx(wanted, rel=1e-6)


def test_a_part_passes_those_that_entered_before_and_those_that_leave_after():
    entering = one_by_one(("a", "b"), UP, ("x",), True)
    assert [move.past for move in entering] == [("x",), ("x", "a")]
    leaving = one_by_one(("a", "b"), UP, ("x",), False)
    assert [move.past for move in leaving] == [("x", "b"), ("x",)]


def test_the_readme_has_the_titles_of_the_list_in_order():
    layout = MoldLayout(EndcapParams(130.0, 8.0))
    text = " ".join((Path(__file__).resolve().parents[2] / "README.md").read_text().lower().split())
    text = text[text.index("**casting, in short**") : text.index("## from files to a finished endcap")]
    at = [text.find(step.title.lower()) for step in steps_of_the_mold(layout, ways(layout))]
    assert min(at) > 0 and at == sorted(at)


def test_blanks_of_the_lines_are_known():
    layout = MoldLayout(EndcapParams(99.0, 6.5))
    blanks = {m[1] for step in all_steps(layout, ways(layout)) for line in step.lines for m in BLANK.finditer(line)}
    volumes = {"beyond_ml", "room_ml", "leak_ml"}
    lifts = {"lift_n", "lift_kg", "reach_mm"}
    masses = {"part_a_g", "part_b_g", "poured_g", "left_g"}
    numbers = {"fill_depth_mm", "cure_h", "pot_life_min", *masses, *lifts, *volumes}
    assert blanks <= {"screws", "count", "degas", "robot", "robot_fixing"} | numbers
