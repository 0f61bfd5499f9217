"""Bill of materials and supplies: a line for everything, amounts in closed form, lines left out."""

from __future__ import annotations

import csv
import io
import math
import re

import pytest

from cad.materials import silicones
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.bom import all_joints, bom_checks, bom_csv, bom_lines
from fab.checks.screw_fit import ScrewFit
from fab.recipe import overflow_of, recipe
from fab.supplies import plastic_g, spool_usd, supply_lines, with_spools

LAYOUT = MoldLayout(EndcapParams(130.0, 8.0))
OVERFLOW = overflow_of(LAYOUT)


def fake_fits() -> list[ScrewFit]:
    return [ScrewFit(j, 12.0, 8.0, 9.0, 5.0, 1.0, 0.0) for j in all_joints(LAYOUT)]


MANIFEST = {
    "parts": [
        {"name": "base", "role": "printed", "material": "PLA", "quantity": 1},
        {"name": "camera", "role": "bought", "material": "camera module", "quantity": 1},
        {"name": "shell", "role": "cast", "material": "silicone", "quantity": 1, "volume_mm3": {"mesh": 282e3}},
    ]
}


def test_every_part_screw_and_nut_has_its_line():
    lines = bom_lines(LAYOUT, MANIFEST, fake_fits(), recipe(282e3, OVERFLOW), None)
    assert all(check.ok for check in bom_checks(MANIFEST, all_joints(LAYOUT), fake_fits(), lines))
    assert sum(line.quantity for line in lines if line.owner == "screws") == 10 + 4 + 5 + 10 + 6 + 8 + 6
    counts = {line.item: line.quantity for line in lines}
    assert counts["M4 washer ISO 7089"] == 2 * 6 and counts["M4 hexagon nut ISO 4032"] == 6  # a washer at either end
    rows = list(csv.DictReader(io.StringIO(bom_csv(lines))))
    assert len(rows) == len(lines) and math.isclose(float(rows[0]["quantity"]), 1)


@pytest.mark.parametrize(("grams", "spools"), [(900.0, 1), (950.0, 2), (2000.0, 3)])
def test_as_many_spools_as_the_slices_take_and_a_tenth_to_spare(grams, spools):
    parts = [{"name": name, "material": "PLA", "quantity": 1} for name in ("base", "hanger", "not_sliced")]
    parts.append({"name": "ring_spacer", "material": "PETG", "quantity": 2})
    figures = {"base": (100.0, 2.0), "hanger": (grams - 100.0, 2.0), "camera": (50.0, 1.0), "ring_spacer": (12.0, 0.2)}
    plastics = plastic_g(parts, figures)
    assert plastics == {"PLA": grams, "PETG": 24.0}
    amounts = {
        line.item: line.quantity for line in with_spools(supply_lines(recipe(282e3, OVERFLOW), LAYOUT), plastics)
    }
    assert amounts["PLA filament"] == spools and amounts["TPU filament"] == 1


def test_spools_of_prints_that_are_not_sliced_follow_the_estimate_and_name_its_range():
    lines = supply_lines(recipe(282e3, OVERFLOW), LAYOUT)
    found = {line.item: line for line in with_spools(lines, {"PLA": 2130.0, "TPU 95A": 40.0}, is_estimate=True)}
    assert (found["PLA filament"].quantity, found["TPU filament"].quantity) == (3, 1)
    assert found["PLA filament"].pack_usd == pytest.approx(3 * spool_usd("PLA filament"))
    assert found["PLA filament"].use.endswith("; estimated 1810 to 2450 g until sliced")
    assert found["TPU filament"].use.endswith("; estimated 34 to 46 g until sliced")
    assert "estimated" not in found["PETG filament"].use


@pytest.mark.parametrize("volume_mm3", [100e3, 282e3, 1.25e6, 2.9e6])
def test_the_mixing_cup_goes_into_the_vacuum_chamber(volume_mm3):
    asked = {line.item: line.order_as for line in supply_lines(recipe(volume_mm3, OVERFLOW), LAYOUT)}
    cup_ml = float(re.search(r"(\d+) ml", asked["mixing cup"])[1])
    chamber_l = float(re.match(r"(\d+) l", asked["vacuum chamber and pump"])[1])
    assert chamber_l >= max(5.0, 1.3e-3 * cup_ml) and chamber_l < 1.3e-3 * cup_ml + 5.0


@pytest.mark.parametrize("name", sorted(silicones()))
def test_what_only_degassing_needs_is_asked_for_where_there_is_time_to_degas(name):
    mix = recipe(282e3, OVERFLOW, name)
    asked = {line.item: (line.order_as, line.use) for line in supply_lines(mix, LAYOUT)}
    assert ("vacuum chamber and pump" in asked) == mix.is_degassed
    assert any("degas" in words for line in asked.values() for words in line) == mix.is_degassed
    order = asked["mixing cup"][0]
    times, cup_ml = (float(word) for word in re.search(r"at least (\d) times the mix: (\d+) ml", order).groups())
    assert times == (5 if mix.is_degassed else 2)
    assert times * 1.15 * 282 <= cup_ml < times * 1.15 * 282 + 110


@pytest.mark.parametrize(
    ("dropped", "gate"),
    [("camera", "bom.parts_without_line"), ("screws", "bom.screws_short"), ("nuts", "bom.nuts_short")],
)
def test_a_missing_line_fails_its_gate(dropped, gate):
    lines = bom_lines(LAYOUT, MANIFEST, fake_fits(), recipe(282e3, OVERFLOW), None)
    index = next(k for k, line in enumerate(lines) if line.owner == dropped)
    checks = bom_checks(MANIFEST, all_joints(LAYOUT), fake_fits(), [*lines[:index], *lines[index + 1 :]])
    assert [check.name for check in checks if not check.ok] == [gate]


def test_every_segment_of_the_mold_is_bolted_to_two_of_the_other_half():
    pairs = [j.through for j in all_joints(LAYOUT) if j.owner == "cup"]
    assert len(set(pairs)) == 6
    for name in {segment for pair in pairs for segment in pair}:
        assert sum(name in pair for pair in pairs) == 2
