"""Tools and small things: every one that a step asks for is listed, as large as this size needs; rows that are odd."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from cad.bought import bought_mm
from cad.mold.core import REMOVAL_ORDER
from cad.mold.cup import SPOT_RADIUS_MM
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.silicone_kits import SiliconeKit
from fab import supplies
from fab.bom import all_joints
from fab.build_sheet.casting import casting, demolding
from fab.build_sheet.data import SheetData
from fab.build_sheet.finishing import painting
from fab.build_sheet.judging import judging
from fab.build_sheet.lighting import steps_of_wiring
from fab.build_sheet.steps import screws
from fab.checks.screw_fit import ScrewFit
from fab.lift import lift_g, lift_kg
from fab.recipe import closed_cast_mm3, overflow_of, recipe
from fab.steps.endcap import all_steps
from fab.supplies import bag_size, silicone_line, supply_lines

LAYOUT = MoldLayout(EndcapParams(171.3, 10.1, dot_mm=3.6))
MIX = recipe(6e5, overflow_of(LAYOUT))
ASKED_FOR = {  # words of a step -> what has to be listed
    r"[Ss]older": "solder",
    r"solder the crimped|solder joints|Iron at": "soldering iron",
    r"Cut a USB cable": "side cutter",
    r"insulate each": "wire stripper",
    r"flat piece of metal": "flat piece of metal",
    r"Trim the flash|Cut a gore out": "scissors",
    r"Punch the dots out": "hole punch",
    r"Print this page": "paper printer",
    r"spirit level": "spirit level",
    r"measure on the free": "multimeter",
    r"flat pliers": "pliers",
    r"rubber band": "rubber band",
    r"holds the socket": "socket",
    r"[Aa]lcohol": "isopropyl alcohol",
    r"drop of glue": "glue",
    r"[Ss]afety glasses": "safety glasses",
    r"grit 240": "emery paper",
    r"vacuum chamber": "vacuum chamber and pump",
    r"soft ring": "soft ring",
    r"kg on the middle of the hanger": "weight",
    r"the tray under the bowl": "tray",
    r"[Ww]ear the lamp": "lamp",
    r"a toothpick out of joints": "toothpicks",
    r"ruler across the interface": "ruler",
    r"tape measure or paper strip": "tape measure",
    r"caliper's rod": "caliper",
    r"[Ff]rom a syringe": "syringe",
    r"cotton bud": "cotton buds",
}


def items(robot: str = "iso_9409_1_50_4_m6") -> dict[str, tuple[str, str]]:
    return {line.item: (line.order_as, line.use) for line in supply_lines(MIX, LAYOUT, robot)}


def test_every_tool_that_a_step_asks_for_is_listed():
    data = SheetData(LAYOUT, {}, None, MIX, [], [], [], [], 0.0, {"dots": None})
    ways = dict.fromkeys(REMOVAL_ORDER, ())
    chapters = (steps_of_wiring(), painting(data), casting(data), demolding(data), judging(data))
    words = f"{all_steps(LAYOUT, ways)} {chapters}"
    for asked, item in ASKED_FOR.items():
        if item != "solder":  # its step says "solder the crimped cable on"
            assert re.search(asked, words), asked
        assert item in items(), item
    assert items()["hole punch"][0].startswith("round, 3.6 mm")


@pytest.mark.parametrize("size", [(98.86, 6.5), (250.0, 25.0)])
def test_the_socket_goes_round_the_nuts_of_the_bowl(size):
    """Their recesses are round and 11 mm wide; a spanner of 7 mm is 15 mm wide, and a ring one 11.5 mm."""
    outside_mm, high_mm = map(float, re.findall(r"([\d.]+) mm", items()["socket"][0])[1:])
    layout = MoldLayout(EndcapParams(*size))
    assert outside_mm < 2 * SPOT_RADIUS_MM
    seat_mm = layout.dam_top_mm + layout.bolt_flange_mm
    assert high_mm < layout.stand_height_mm - seat_mm - bought_mm("washer_m4", "thickness")


def test_the_scale_takes_the_whole_mix_in_its_cup():
    """A bucket of polypropylene weighs some 40 g a litre: at D=248 T=22 its 16 l left 519 g of 4.5 kg for it."""
    for size in ((98.86, 6.5), (171.3, 10.1), (248.47, 21.9), (250.0, 25.0)):
        layout = MoldLayout(EndcapParams(*size))
        mix = recipe(closed_cast_mm3(layout.params), overflow_of(layout))
        asked = {line.item: line.order_as for line in supply_lines(mix, layout)}
        scale_g, cup_ml = (float(re.search(rf"(\d+) {unit}", asked[item])[1])
                           for item, unit in (("scale", "g"), ("mixing cup", "ml")))  # fmt: skip
        assert mix.part_a_g + mix.part_b_g + 0.04 * cup_ml < scale_g <= 6000.0


def test_the_spirit_level_reaches_across_the_dam():
    order, use = items()["spirit level"]
    length_mm = float(re.search(r"at least (\d+) mm", order)[1])
    across_mm = 2 * (LAYOUT.params.outer_radius_mm + 5.0 + LAYOUT.joint_clearance_mm)
    assert across_mm == pytest.approx(181.6) and across_mm + 5 < length_mm == 190 and "dam" in use


@pytest.mark.parametrize(("size", "wanted_mm"), [((98.86, 6.5), 150), ((171.3, 10.1), 150), ((250.0, 25.0), 300)])
def test_caliper_ruler_and_tape_reach_what_they_measure(size, wanted_mm):
    layout = MoldLayout(EndcapParams(*size))
    lines = {line.item: line.order_as for line in supply_lines(recipe(6e5, overflow_of(layout)), layout)}
    assert lines["caliper"] == f"{wanted_mm} mm, with a depth rod" and layout.params.tip_height_mm < wanted_mm
    assert float(re.search(r"at least (\d+) mm", lines["ruler"])[1]) > 2 * layout.params.bore_radius_mm + 20
    assert float(re.search(r"at least ([\d.]+) m,", lines["tape measure"])[1]) * 1000 > math.pi * size[0]


@pytest.mark.parametrize(("size", "own_kg"), [((107.0, 7.3), 0.5), ((250.0, 25.0), 6.0)])
def test_the_weight_holds_down_what_the_silicone_lifts(size, own_kg):
    """The push on the bowl, integrated in rings from the tip to the seam, less the silicone's weight."""
    layout = MoldLayout(EndcapParams(*size))
    params, mix = layout.params, recipe(closed_cast_mm3(layout.params), overflow_of(layout))
    level = layout.hanger_thickness_mm - 2.0  # half a well
    polar = (np.arange(2000) + 0.5) * math.pi / 4000  # from the tip of the sphere to its widest section
    depth = params.centre_height_mm + params.outer_radius_mm * np.cos(polar) + level
    rings = 2 * math.pi * params.outer_radius_mm**2 * np.sin(polar) * math.pi / 4000
    bowl_g = (depth * np.cos(polar) * rings).sum() * mix.silicone.density_g_cm3 / 1000
    assert lift_g(layout, mix) == pytest.approx(bowl_g - mix.expected_g, rel=1e-4)
    assert lift_kg(layout, mix) >= lift_g(layout, mix) / 1000 > lift_kg(layout, mix) - 0.5 > own_kg - 1.0
    order = next(line.order_as for line in supply_lines(mix, layout) if line.item == "weight")
    assert order.startswith(f"{lift_kg(layout, mix):g} kg")


def test_a_bag_holds_a_spare_screw():
    assert [bag_size(count) for count in (1, 9, 10, 14, 20, 499, 500)] == [10, 10, 20, 20, 50, 500, 501]


def test_a_blank_adapter_asks_for_a_drill_and_no_key_of_the_robot():
    assert "drill" in items("blank") and "drill" not in items()
    assert items("blank")["hex keys"][0].endswith("3 (M4)")
    assert items()["hex keys"][0].endswith("3 (M4), 5 (M6 of the robot's flange)")


def test_washers_lie_under_the_heads_and_the_screws_come_from_below():
    fits = [ScrewFit(joint, 8.0, 8.0, 9.0, 5.0, 1.0, 0.0) for joint in all_joints(LAYOUT)]
    data = SheetData(LAYOUT, {}, None, MIX, fits, [], [], [], 0.0, {})
    step = next(step for step in all_steps(LAYOUT, dict.fromkeys(REMOVAL_ORDER, ())) if step.key == "base")
    line = next(line for line in step.lines if "{screws:" in line)
    joined = line.replace("{screws:base_to_interface}", screws(data, "base_to_interface"))
    assert joined.startswith("10 x M3 x 8, each with a washer under its head, from below, crosswise")


def row(**changed: str) -> supplies.Supply:
    cells = {"name": "x", "kind": "tool", "order_as": "any", "amount": "1", "unit": "pc", "use": "x", "price_usd": "",
             "provenance": "E"}  # fmt: skip
    return supplies._supply(cells | changed)


def test_words_in_braces_that_are_no_blank_stay_as_they_are(monkeypatch):
    own = row(name="brace", order_as="set {A} of {scale_g} g", use="{}, {0} and {unknown}, {")
    monkeypatch.setattr(supplies, "supplies", lambda: {own.name: own})
    order, use = items()["brace"]
    assert re.fullmatch(r"set \{A\} of \d+ g", order) and use == "{}, {0} and {unknown}, {"


@pytest.mark.parametrize(("price", "expected"), [(None, None), (40.0, 80.0)])
def test_a_silicone_without_a_price_costs_what_is_not_known(price, expected, monkeypatch):
    kit = SiliconeKit(MIX.silicone.name, "any", 500.0, price, "E")
    monkeypatch.setattr(supplies, "silicone_kits", lambda: {kit.name: kit})
    line = silicone_line(MIX)
    assert line.order_as.startswith("2 x ") and line.price_usd == line.paid_usd == expected


def test_a_kit_among_the_supplies_is_sent_to_its_table():
    with pytest.raises(ValueError, match=r"kind='silicone' .* is a row of cad/silicone_kits\.csv"):
        row(name=MIX.silicone.name, kind="silicone", amount="500", unit="g")


def test_a_kit_under_another_name_is_named_where_it_is_missed(monkeypatch):
    kit = SiliconeKit("Smooth Sil 950", "any", 500.0, None, "E")
    monkeypatch.setattr(supplies, "silicone_kits", lambda: {kit.name: kit})
    said = "add its kit to cad/silicone_kits.csv under the name 'Smooth-Sil 950'"
    assert silicone_line(MIX).order_as == f"{said}; its row 'Smooth Sil 950' is of no silicone of cad/materials.csv"
    monkeypatch.setattr(supplies, "silicone_kits", dict)
    assert silicone_line(MIX).order_as == said
