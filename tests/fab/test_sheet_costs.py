"""Cost and use in the build sheet: what is paid, what of it is used, and plain words for what a line is for."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import pytest

from cad.fasteners import BomLine
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.robot_sides import robot_sides
from fab.bom import all_joints, bom_csv, bom_lines
from fab.build_sheet.blocks import Table
from fab.build_sheet.content import _cover
from fab.build_sheet.data import SheetData
from fab.build_sheet.shopping import bill
from fab.build_sheet.sums import cost_facts
from fab.checks.screw_fit import ScrewFit
from fab.part_words import PARTS, part_words
from fab.recipe import overflow_of, recipe
from fab.slice.filaments import filament
from fab.supplies import with_spools

LAYOUT = MoldLayout(EndcapParams(130.0, 8.0))
PRINTED = ("cup_bowl_1", "cup_bowl_2", "cup_bowl_3", "base", "arm_adapter")
MANIFEST = {
    "parts": [
        *({"name": name, "role": "printed", "material": "PLA", "quantity": 1} for name in PRINTED),
        *({"name": name, "role": "bought", "material": "", "quantity": 1} for name in ("camera", "led_ring")),
        {"name": "shell", "role": "cast", "material": "silicone", "quantity": 1, "volume_mm3": {"mesh": 282e3}},
    ]
}
SLICED = {
    "projects": [{"name": "plate", "pieces": [{"name": name, "grams": 31.0, "cost_usd": 0.62} for name in PRINTED]}],
}


def lines_of(sliced: dict | None) -> list[BomLine]:
    fits = [ScrewFit(joint, 12.0, 8.0, 9.0, 5.0, 1.0, 0.0) for joint in all_joints(LAYOUT)]
    return bom_lines(LAYOUT, MANIFEST, fits, recipe(282e3, overflow_of(LAYOUT)), sliced)


def sheet_of(sliced: dict | None, **changed) -> SheetData:
    pictures = {f"thumb_{name}": Path(f"{name}.jpg") for name in (*PRINTED, "camera", "led_ring")}
    data = SheetData(
        LAYOUT, MANIFEST, None, recipe(282e3, overflow_of(LAYOUT)), [], [], lines_of(sliced), [], 0.0, pictures
    )
    return replace(data, **changed)


def test_the_cover_names_what_is_paid_and_what_is_used_and_that_prints_are_missing():
    paid, used = (words for _, words in cost_facts(sheet_of(None)))
    assert "WITHOUT the prints, whose grams make slice D=130 T=8 measures" in used and "by the gram" not in used
    assert "spools by an estimate of the plastic until the prints are sliced" in paid
    paid, used = (words for _, words in cost_facts(sheet_of(SLICED)))
    assert "WITHOUT" not in used and "plastic by the gram" in used and "until" not in paid


def test_the_two_sums_are_those_of_the_lines():
    lines = lines_of(SLICED)
    sums = [int(words.split()[1]) for _, words in cost_facts(sheet_of(SLICED))]
    csv_rows = list(csv.DictReader(io.StringIO(bom_csv(lines))))
    columns = [sum(float(row[name] or 0) for row in csv_rows) for name in ("paid_usd", "price_usd")]
    assert sums == [round(column) for column in columns]
    spools = sum(size * filament(name).price_usd_kg for name, size in (("PLA", 1.0), ("TPU 95A", 0.5), ("PETG", 1.0)))
    bags = sum(line.paid_usd - line.price_usd for line in lines if ", bag of " in line.order_as)
    prints = 0.62 * len(PRINTED)
    assert columns[0] - columns[1] == pytest.approx(spools + bags + 4 * 12.0 - prints) and bags > 0


def test_a_silicone_without_a_kit_is_named_as_missing_in_both_sums():
    line = BomLine("my silicone", 400.0, "g", "shell", "cast", None, kind="silicone")
    facts = cost_facts(sheet_of(SLICED, lines=[*lines_of(SLICED), line]))
    assert all(words.endswith("without my silicone: no price is known") for _, words in facts)


def test_a_bag_is_priced_whole_beside_its_size():
    for line in lines_of(None):
        if ", bag of " in line.order_as:
            size = int(line.order_as.rsplit(" ", 1)[1])
            assert line.paid_usd / size == pytest.approx(line.price_usd / line.quantity) and size >= line.quantity


def test_spools_are_paid_by_their_number():
    paid = {line.item: line.paid_usd for line in with_spools(lines_of(None), {"PLA": 1900.0})}
    assert paid["PLA filament"] == 3 * 20.0 and paid["TPU filament"] == 17.5


def test_no_cell_of_the_shopping_tables_is_a_raw_name_or_says_print_for_a_use():
    tables = [block for block in bill(sheet_of(SLICED)) if isinstance(block, Table)]
    made, bought = tables[0], tables[1]
    assert made.rows[0][3] == f"{PARTS['cup_bowl']}; 31 g each" and made.rows[1][3] == f"{PARTS['base']}; 31 g"
    uses = [row[4] for row in bought.rows]
    assert not any("_" in use or use in ("buy", "print", "order") for use in uses)
    assert "adapter to base, collar to bowl" in uses and "arm adapter to flange ISO 9409-1-50-4-M6" in uses


def test_screws_of_the_robot_do_not_show_the_picture_of_the_adapter():
    bought = [block for block in bill(sheet_of(None)) if isinstance(block, Table)][1]
    rows = {row[1]: row[0] for row in bought.rows}
    assert rows["screw ISO 4762 M6 x 20"] == "" and rows["pin ISO 2338 6 m6 x 16"] == ""


@pytest.mark.parametrize("robot", sorted(robot_sides()))
def test_every_robot_has_words(robot):
    lines = bom_lines(LAYOUT, {"parts": [], "robot": robot}, [], recipe(282e3, overflow_of(LAYOUT)), None)
    assert not any("_" in line.use for line in lines)


def test_every_part_of_the_mold_has_words():
    owners = {joint.anchor for joint in all_joints(LAYOUT)} | {joint.seat for joint in all_joints(LAYOUT)}
    assert all(":" in part_words(name) or name == "camera" for name in owners)


@pytest.mark.parametrize("robot", robot_sides())
def test_the_cover_says_what_the_adapter_fits_and_at_which_size_the_papers_mold_cost_that(robot):
    piece = {"name": "cup_bowl_1", "grams": 31.0, "cost_usd": 0.62}
    sliced = {"printer": {"name": "mk4"}, "projects": [{"time_s": 60.0, "grams": 31.0, "pieces": [piece]}]}
    data = sheet_of(SLICED, manifest={**MANIFEST, "robot": robot}, pictures={"cover": Path("cover.png")})
    data = replace(data, sliced=sliced)
    facts = dict(next(block for block in _cover(data) if isinstance(block, Table)).rows)
    assert facts["mold"].endswith("0.62 USD (the paper, D=130: about 8.50)")
    assert ("drill your own" in facts["robot"]) == (robot == "blank") != facts["robot"].startswith("adapter for ")
