"""Recipe: closed forms of mix, clock and overflow, faults planted."""

from __future__ import annotations

import dataclasses
import math

import pytest

from bench.sizes import random_sizes
from cad.errors import FileError, ParameterError
from cad.interface import edge_room_mm3, zone_clip_radius_mm
from cad.leak import sizing_volume_mm3
from cad.materials import mix_parts, silicone, silicones
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.cavity import leak_check
from fab.recipe import SHOWN_RATIO, closed_cast_mm3, overflow_checks, overflow_of, recipe, shell_volume_mm3
from fab.supplies import silicone_line

OVERFLOW = overflow_of(MoldLayout(EndcapParams(130.0, 8.0)))


@pytest.mark.parametrize("name", sorted(silicones()))
def test_parts_have_the_tables_ratio_and_cover_cast_and_surplus(name):
    mix = recipe(200_000.0, OVERFLOW, name)
    row = silicone(name)
    a, b = mix_parts(row.mix_ratio)
    assert mix.part_a_g / mix.part_b_g == pytest.approx(a / b, rel=0.01)
    total = 200.0 * row.density_g_cm3 * (1 + mix.surplus)
    assert mix.surplus >= 0.15
    assert total <= mix.part_a_g + mix.part_b_g + 1e-9 < total + 0.2  # rounded up, by a tenth of a gram each
    assert mix.expected_g == pytest.approx(200.0 * row.density_g_cm3)
    assert mix.lightest_g < mix.expected_g < mix.poured_g
    assert mix.heaviest_g == pytest.approx(mix.poured_g + 1.0 + 0.1)  # no more can be in it: hand and scale


def test_smooth_sil_950_of_a_litre_is_a_hundred_to_ten():
    mix = recipe(1e6, OVERFLOW)  # 1240 g, and 15 % over
    assert (mix.part_a_g, mix.part_b_g) == (pytest.approx(1296.4), pytest.approx(129.7))
    assert mix.pot_life_to_spare_min >= 0 and mix.air_mm3_per_g == pytest.approx(806.45, abs=0.01)


@pytest.mark.parametrize(("cast_g", "kits"), [(480.0, 1), (499.0, 2), (2498.8, 6)])
def test_kits_hold_what_stays_in_their_bottles_too(cast_g, kits):
    mix = recipe(1e5, OVERFLOW)
    mix = dataclasses.replace(mix, part_a_g=cast_g / 1.1, part_b_g=cast_g / 11)
    assert f"{kits} x Smooth-On Smooth-Sil 950" in silicone_line(mix).order_as


@pytest.mark.parametrize("name", sorted(silicones()))
def test_the_clock_runs_without_gaps_and_ends_within_the_pot_life(name):
    before = 0.0
    for volume_mm3 in (8.7e4, 1.9e5, 3e5, 6.7e5, 1.1e6, 1.6e6, 2.0e6):  # from D=98.86 to D=250 T=25
        mix = recipe(volume_mm3, OVERFLOW, name)
        ends = [0.0, *(step.end_min for step in mix.timeline)]
        lasts = {step.what.split()[0].strip(","): step.end_min - step.start_min for step in mix.timeline}
        assert [step.start_min for step in mix.timeline] == ends[:-1]
        assert mix.pot_life_to_spare_min >= (1.0 if mix.is_degassed else 0.0)
        assert lasts["pour"] + lasts["mix"] >= before
        assert 3.0 <= lasts.get("degas", 3.0) <= 5.0
        before = lasts["pour"] + lasts["mix"]
    assert before > 8.0  # a larger cast takes longer


def test_a_short_pot_life_is_degassed_for_less_long_or_not_at_all():
    lasts = {}
    for name in ("Dragon Skin 30", "Dragon Skin 10 Medium", "Ecoflex 00-50"):  # pot life 45, 20, 18 min
        steps = recipe(3e5, OVERFLOW, name).timeline
        lasts[name] = sum(step.end_min - step.start_min for step in steps if "degas" in step.what)
    assert list(lasts.values()) == [5.0, 4.0, 0.0]


def test_thick_silicone_runs_slower():
    """2 l through one stream: 200 ml a minute of 35 Pa s, in proportion to 1 / viscosity."""
    pours = [recipe(2e6, OVERFLOW, name).timeline[-2] for name in ("Smooth-Sil 950", "Dragon Skin 30")]
    assert [step.end_min - step.start_min for step in pours] == [10.0, 6.0]  # 5.7 min, up to the next half


@pytest.mark.parametrize(
    ("size", "gyroid", "mesh_mm3", "fillet_ratio"),
    [
        ((180.0, 18.0), 0.10, 1157623.9, 1e-3),
        ((180.0, 18.0), 0.08, 1161368.8, 1e-3),
        ((99.4, 9.9), 0.12, 128585.4, 2e-3),
    ],
)
def test_the_closed_form_of_the_cast_is_near_what_the_parts_are_made_with(size, gyroid, mesh_mm3, fillet_ratio):
    """M: solid of the shell less the gyroid's mesh above the flange; dents and fillet are the difference."""
    assert closed_cast_mm3(EndcapParams(*size, gyroid=gyroid)) == pytest.approx(mesh_mm3, rel=fillet_ratio)


def test_joints_are_sized_by_no_more_than_the_cast():
    clipped = 0
    for size in random_sizes(7, 200):
        closed, sizing = closed_cast_mm3(size.params), sizing_volume_mm3(size.params)
        if zone_clip_radius_mm(size.params):
            clipped += 1
            assert 0.996 * closed < sizing < closed
        else:
            assert sizing == pytest.approx(closed, rel=1e-12)
    assert 20 < clipped < 180


def test_unknown_material_and_manifest_are_refused():
    with pytest.raises(ParameterError, match="Smooth-Sil 950"):
        recipe(1e5, OVERFLOW, "Smooth-Sil 951")
    with pytest.raises(FileError, match="no part named shell"):
        shell_volume_mm3({"parts": []})


@pytest.mark.parametrize(
    ("size", "clearance", "material"),
    [
        ((142.0, 7.5), 0.15, "Smooth-Sil 950"),
        ((130.0, 8.0), 0.217, "Smooth-Sil 950"),
        ((104.0, 6.5), 0.10, "Smooth-Sil 950"),
        ((130.0, 8.0), 0.15, "Dragon Skin 30"),
        ((249.0, 24.9), 0.30, "Smooth-Sil 950"),
    ],
)
def test_the_wells_show_silicone_after_the_largest_leak_and_the_rest_has_its_place(size, clearance, material):
    layout = MoldLayout(EndcapParams(*size), clearance, material)
    cast = closed_cast_mm3(layout.params)
    places = overflow_of(layout)
    mix = recipe(cast, places, material)
    assert places.film == pytest.approx(math.pi * (layout.hanger_radius_mm**2 - 10 * 3.5**2) * 1.0)
    assert places.dam == pytest.approx(math.pi * layout.params.inner_radius_mm**2 * 1.5)  # the core stands in the bowl
    leaked = leak_check(layout, cast).value * cast
    density = silicone(material).density_g_cm3 / 1000
    left = (mix.poured_g - 1.0) / density - cast - leaked  # poured a gram short
    wells = 10 * math.pi * 3.5**2 * 4.0
    vents = 10 * math.pi * 1.75**2 * (layout.hanger_thickness_mm - 4.0)
    ring = (layout.piston_radius_mm + clearance) ** 2 - layout.piston_radius_mm**2
    gap = math.pi * ring * (layout.seam_height_mm - layout.dam_top_mm)
    edge = edge_room_mm3(layout.params)
    assert left - gap - vents - edge == pytest.approx(SHOWN_RATIO * wells)
    assert places.room == pytest.approx(gap + vents + edge + wells)  # what the sheet says stays inside
    assert all(check.ok for check in overflow_checks(mix))
    most = (mix.poured_g + 1.0) / density - cast  # poured a gram too much, nothing lost
    assert most - vents - wells < math.pi * layout.hanger_radius_mm**2 * 1.0
    assert most < math.pi * layout.params.inner_radius_mm**2 * 1.5  # lifts the level by less than the dam's margin


@pytest.mark.parametrize(
    ("changed", "gate"),
    [
        ({"film": 0.0}, "recipe.overflow_spare_mm3"),
        ({"dam": 1000.0}, "recipe.dam_spare_mm3"),
    ],
)
def test_a_place_that_is_too_small_fails_its_gate(changed, gate):
    mix = recipe(282e3, dataclasses.replace(OVERFLOW, **changed))
    assert [check.name for check in overflow_checks(mix) if not check.ok] == [gate]


def test_a_pour_that_forgets_the_leak_fails_its_gate(monkeypatch):
    mix = recipe(282e3, OVERFLOW)
    monkeypatch.setattr(type(mix), "beyond_mm3", OVERFLOW.room / 2)
    assert [check.name for check in overflow_checks(mix) if not check.ok] == ["recipe.least_in_wells_mm3"]
