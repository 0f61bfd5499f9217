"""Words of the sheet's steps that depend on the size, the silicone and what is known of its recipe."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from cad.mold.core import REMOVAL_ORDER
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.build_sheet.blocks import Paragraph, Table
from fab.build_sheet.casting import _recipe_rows, casting
from fab.build_sheet.data import SheetData
from fab.build_sheet.finishing import assembling, light_check
from fab.build_sheet.prints import _coupon_words, _preset, bed_needed, prints
from fab.build_sheet.steps import filled
from fab.recipe import overflow_of, recipe
from fab.slice.printers import printer
from fab.steps.cast import cast_steps
from fab.steps.endcap import all_steps
from fab.supplies import supply_lines

PARAMS = EndcapParams(150.0, 9.0)


@pytest.mark.parametrize(("material", "degassed"), [("Smooth-Sil 950", True), ("Ecoflex 00-50", False)])
def test_the_step_degasses_where_the_clock_does(material, degassed):
    layout = MoldLayout(PARAMS, silicone=material)
    mix = recipe(2e5, overflow_of(layout), material)
    data = SheetData(layout, {}, None, mix, [], [], [], [], 0.0, {})
    step = next(step for step in cast_steps(layout, dict.fromkeys(REMOVAL_ORDER, ())) if step.key == "mix")
    words = " ".join(filled(data, step.lines))
    assert ("degas until" in words) == degassed == any("degas" in row.what for row in mix.timeline)
    assert ("do not degas" in words) != degassed
    assert any(line.item == "vacuum chamber and pump" for line in supply_lines(mix, layout)) == degassed


@pytest.mark.parametrize(("clearance", "leak"), [(0.053, "0.04"), (0.15, "0.8")])
def test_a_leak_through_tight_joints_is_small_but_not_nothing(clearance, leak):
    layout = MoldLayout(EndcapParams(99.37, 6.63), clearance, "Ecoflex 00-50")
    mix = recipe(93.6e3, overflow_of(layout), "Ecoflex 00-50")
    data = SheetData(layout, {}, None, mix, [], [], [], [], 0.0, {})
    assert filled(data, ("up to {leak_ml} ml",)) == (f"up to {leak} ml",)
    assert f"as much as {leak} ml creeps out" in dict(_recipe_rows(mix))["pour"]


@pytest.mark.parametrize(
    ("size", "clearance", "material", "can_be"),
    [
        ((248.6, 11.31), 0.06, "Ecoflex 00-30", "0.05 to 0.114 mm, and Ecoflex 00-30 would leak through a wider joint"),
        ((209.9, 20.77), 0.247, "Smooth-Sil 940", "0.05 to 0.3 mm"),
    ],
)
def test_the_sheet_says_which_joints_of_the_coupon_these_molds_can_have(size, clearance, material, can_be):
    layout = MoldLayout(EndcapParams(*size), clearance, material)
    mix = recipe(2e5, overflow_of(layout), material)
    text = _coupon_words(SheetData(layout, {}, None, mix, [], [], [], [], 0.0, {}))
    assert f"joints of {clearance:g} mm a side. If another step of the coupon fits" in text
    assert f"For this size it can be {can_be}. Where no such step fits" in text


def test_a_preset_is_named_for_the_slicer_whose_files_name_it():
    both, orca_alone, none = (_preset(asdict(printer(name))) for name in ("mk4", "a1_mini", "generic180"))
    assert ".prusa.3mf files name the preset Original Prusa MK4 Input" in both and "has none" not in both
    assert orca_alone.startswith("The .orca.3mf files name the preset Bambu Lab A1 mini 0.4 nozzle.")
    assert ".prusa.3mf" not in orca_alone and "PrusaSlicer has none of this printer." in orca_alone
    assert none.startswith("Choose your printer's own preset")


@pytest.mark.parametrize("robot", ["iso_9409_1_50_4_m6", "tensegrity_arm", "blank"])
def test_the_sheet_says_how_deep_screws_enter_the_robots_flange(robot):
    layout = MoldLayout(PARAMS)
    mix = recipe(2e5, overflow_of(layout))
    data = SheetData(layout, {"robot": robot}, None, mix, [], [], [], [], 0.0, {})
    fixing = filled(data, ("{robot_fixing}",))[0]
    said = "A screw enters the flange 6 mm: compare with your robot's flange, never longer than its thread"
    assert (said in fixing) == (robot != "blank")
    table = next(block for block in assembling(data) if isinstance(block, Table))
    rows = [row for row in table.rows if row[0] == "adapter_to_robot"]
    assert [row[1:5] for row in rows] == [
        (f"{count} x M6 x 20", "14.00", "6.00 in the flange", "6.00")
        for count in {"iso_9409_1_50_4_m6": [4], "tensegrity_arm": [6], "blank": []}[robot]
    ]


def test_the_bed_is_that_of_the_part_with_the_largest_square():
    squares = {"cup_bowl_2": 136.3, "hanger": 167.95, "base": 166.5}  # the bowl is the longest before it is turned
    checks = [{"name": f"{name}.bed_mm", "value": value, "ok": True} for name, value in squares.items()]
    checks.append({"name": "plate_1.outside_bed_mm", "value": 900.0, "ok": True})
    layout, heights = MoldLayout(PARAMS), {"cup_bowl_2": 97.2, "hanger": 15.0}
    mix = recipe(2e5, overflow_of(layout))
    data = SheetData(layout, {}, None, mix, [], [], [], checks, 0.0, {}, heights, ("A1 mini (180 x 180 x 180 mm)",))
    words = bed_needed(data)
    assert words.startswith(
        "hanger needs the most, a square of 168 mm when it is turned to fit best; the tallest part is 98 mm"
    )
    assert words.endswith("with 4 mm round each part these take all: A1 mini (180 x 180 x 180 mm)")
    assert bed_needed(SheetData(layout, {}, None, mix, [], [], [], [], 0.0, {})) == "not known"


def test_core_tape_and_coupon_are_named_before_the_step_that_is_too_late_for_them():
    """The core was smoothed under what stops the cure, the tape never cut, the coupon named once molds were sliced."""
    layout = MoldLayout(PARAMS)
    data = SheetData(layout, {}, None, recipe(2e5, overflow_of(layout)), [], [], [], [], 0.0, {})
    opening = next(step for step in cast_steps(layout, dict.fromkeys(REMOVAL_ORDER, ())) if step.key == "bowl_off")
    tape = opening.lines[1]
    assert "grit 240" in casting(data)[1].text and tape.startswith("Cut the tape") and "Draw the segments off" in tape
    assert "First the fit coupon" in prints(data)[1].text and "Not sliced yet" in prints(data)[-1].text


def test_the_endcap_is_weighed_on_a_table_before_it_goes_onto_the_robot():
    """The robot came first, and the calibration by weight then asked for an endcap that stands on a table."""
    layout = MoldLayout(PARAMS)
    data = SheetData(layout, {}, None, recipe(2e5, overflow_of(layout)), [], [], [], [], 0.0, {})
    before = assembling(data)[1].text
    assert "First light comes after A4, and the robot after it" in before and "five screws of A5" in before
    light = [block.text for block in light_check(data) if isinstance(block, Paragraph)]
    assert light[0].startswith("The endcap stands on its adapter, and is not on the robot yet")
    assert any("Stand the endcap on its adapter, upright on a level table" in text for text in light)
    keys = [step.key for step in all_steps(layout, dict.fromkeys(REMOVAL_ORDER, ())) if step.stage == "assemble"]
    assert keys[3:] == ["base", "adapter"]  # A4 and A5


def test_heads_in_a_blank_adapter_are_sunk():
    """The base lies on the drilled side: heads that stand out would carry it."""
    layout = MoldLayout(PARAMS)
    data = SheetData(layout, {"robot": "blank"}, None, recipe(2e5, overflow_of(layout)), [], [], [], [], 0.0, {})
    fixing = filled(data, ("{robot_fixing}",))[0]
    assert "sink the screws' heads" in fixing and "clear of bore and groove" in fixing and "5 mm stay under" in fixing


@pytest.mark.parametrize(("robot", "words"), [("iso_9409_1_50_4_m6", "(ISO 9409-1-50-4-M6)"), ("blank", "(your own")])
def test_the_robots_flange_is_called_a_flange_once(robot, words):
    layout = MoldLayout(PARAMS)
    data = SheetData(layout, {"robot": robot}, None, recipe(2e5, overflow_of(layout)), [], [], [], [], 0.0, {})
    assert filled(data, ("the robot's flange ({robot})",))[0].startswith(f"the robot's flange {words}")
