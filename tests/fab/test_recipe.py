"""Recipe, screws and bill of materials: closed forms, screws on blocks made for the test, faults planted."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import re

import pytest
import trimesh
from long_cases import others_long

from cad.errors import FileError, GeometryError, ParameterError
from cad.fasteners import ScrewJoint
from cad.leak import cast_volume_mm3
from cad.materials import silicone, silicones
from cad.mold_layout import MoldLayout
from cad.params import EndcapParams
from fab.bom import all_joints, bom_checks, bom_csv, bom_lines
from fab.checks.cavity import leak_check
from fab.checks.screw_fit import LENGTHS_MM, ScrewFit, fitted, length_tolerance_mm, screw_fit
from fab.recipe import SHOWN_RATIO, mix_parts, overflow_checks, overflow_of, recipe, shell_volume_mm3
from fab.supplies import plastic_g, silicone_line, supply_lines, with_spools

LAYOUT = MoldLayout(EndcapParams(130.0, 8.0))
OVERFLOW = overflow_of(LAYOUT)


# --- recipe -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(silicones()))
def test_parts_have_the_tables_ratio_and_cover_cast_and_surplus(name):
    mix = recipe(200_000.0, OVERFLOW, name, surplus=0.2)
    row = silicone(name)
    a, b = mix_parts(row)
    assert mix.part_a_g / mix.part_b_g == pytest.approx(a / b, rel=0.01)
    total = 200.0 * row.density_g_cm3 * 1.2
    assert total <= mix.part_a_g + mix.part_b_g + 1e-9 < total + 0.2  # rounded up, by a tenth of a gram each
    assert mix.expected_g == pytest.approx(200.0 * row.density_g_cm3)
    assert mix.lightest_g < mix.expected_g < mix.poured_g
    assert mix.heaviest_g == pytest.approx(mix.poured_g + 1.0 + 0.1)  # no more can be in it: hand and scale


def test_smooth_sil_950_of_a_litre_is_a_hundred_to_ten():
    mix = recipe(1e6, OVERFLOW, surplus=0.0)
    assert (mix.part_a_g, mix.part_b_g) == (pytest.approx(1127.3), pytest.approx(112.8))
    assert mix.pot_life_to_spare_min >= 0 and mix.air_mm3_per_g == pytest.approx(806.45, abs=0.01)


@pytest.mark.parametrize(("cast_g", "kits"), [(480.0, 1), (499.0, 2), (2498.8, 6)])
def test_kits_hold_what_stays_in_their_bottles_too(cast_g, kits):
    mix = recipe(1e5, 2e3)
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


def test_unknown_material_ratio_and_manifest_are_refused():
    with pytest.raises(ParameterError, match="Smooth-Sil 950"):
        recipe(1e5, OVERFLOW, "Smooth-Sil 951")
    with pytest.raises(FileError, match="mix_ratio 'some of each'"):
        mix_parts(dataclasses.replace(silicone(), mix_ratio="some of each"))
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
    cast = cast_volume_mm3(layout.params)
    mix = recipe(cast, overflow_of(layout), material)
    leaked = leak_check(layout, cast).value * cast
    density = silicone(material).density_g_cm3 / 1000
    left = (mix.poured_g - 1.0) / density - cast - leaked  # poured a gram short
    wells = 10 * math.pi * 3.5**2 * 4.0
    vents = 10 * math.pi * 1.75**2 * (layout.hanger_thickness_mm - 4.0)
    ring = (layout.piston_radius_mm + clearance) ** 2 - layout.piston_radius_mm**2
    gap = math.pi * ring * (layout.seam_height_mm - layout.dam_top_mm)
    assert left - gap - vents == pytest.approx(SHOWN_RATIO * wells)
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


# --- screws -------------------------------------------------------------------------------------------------------


def block(low: float, high: float, hole_radius: float = 0.0, hole: tuple[float, float] | None = None):
    """A block 20 x 20 between two heights with an upright hole."""
    body = trimesh.creation.box((20, 20, high - low))
    body.apply_translation((0, 0, (low + high) / 2))
    if not hole_radius:
        return body
    bottom, top = hole or (low - 1, high + 1)
    bore = trimesh.creation.cylinder(hole_radius, top - bottom, sections=96)
    bore.apply_translation((0, 0, (bottom + top) / 2))
    return trimesh.boolean.difference([body, bore], engine="manifold")


def joint(holder: str, washers: int = 0, thread: str = "screw_m3") -> ScrewJoint:
    return ScrewJoint(
        "plate_to_block", "plate", thread, "ISO 4762", "test", ((0.0, 0.0),), True, "plate", ("plate",), "block",
        holder, washers,
    )  # fmt: skip


def test_a_screw_in_plastic_holds_what_is_left_of_its_length():
    meshes = {"plate": block(-8, 0, 1.7), "block": block(0, 30, 1.3, (-1, 14))}
    fit = screw_fit(joint("plastic"), meshes, 16.0)
    assert fit.grip_mm == pytest.approx(8.0, abs=1e-4)
    assert fit.engagement_mm == pytest.approx(16 - 0.35 - 8, abs=1e-4)
    assert fit.tip_room_mm == pytest.approx(14 - (16.35 - 8), abs=1e-4)
    assert all(check.ok for check in fit.checks)
    assert fitted(joint("plastic"), meshes).length_mm == 16.0


@pytest.mark.parametrize(
    ("length", "failing"), [(12.0, "engagement_mm"), (25.0, "tip_room_mm"), (8.0, "engagement_mm")]
)
def test_a_screw_too_short_or_too_long_fails_its_gate(length, failing):
    meshes = {"plate": block(-8, 0, 1.7), "block": block(0, 30, 1.3, (-1, 14))}
    fit = screw_fit(joint("plastic"), meshes, length)
    assert [check.name for check in fit.checks if not check.ok] == [f"plate_to_block.{failing}"]


def test_a_loose_nut_needs_its_height_and_one_pitch():
    meshes = {"plate": block(-6, 0, 2.25), "block": block(0, 6, 2.25)}
    bolt = joint("loose nut", washers=1, thread="screw_m4")
    fit = screw_fit(bolt, meshes, 20.0)
    assert fit.grip_mm == pytest.approx(12 + 2 * 0.8, abs=1e-4)
    assert all(check.ok for check in fit.checks) and fitted(bolt, meshes).length_mm == 20.0
    assert not all(check.ok for check in screw_fit(bolt, meshes, 16.0).checks)


def test_a_head_on_an_edge_or_beside_its_part_is_seen():
    tilted = block(-8, 0, 1.7)
    tilted.vertices[:, 2] += 0.1 * tilted.vertices[:, 0] * (tilted.vertices[:, 2] < -4)
    anchor = block(0, 30, 1.3, (-1, 14))
    fit = screw_fit(joint("plastic"), {"plate": tilted, "block": anchor}, 16.0)
    assert not next(check for check in fit.checks if check.name.endswith("seat_error_mm")).ok
    anchor.apply_translation((40, 0, 0))
    with pytest.raises(GeometryError, match="block is not where the screw"):
        screw_fit(joint("plastic"), {"plate": tilted, "block": anchor}, 16.0)


def test_tolerances_are_those_of_the_standard():
    assert [length_tolerance_mm(length) for length in (3.0, 6.0, 10.0, 12.0, 20.0, 40.0)] == [
        0.20, 0.24, 0.29, 0.35, 0.42, 0.50
    ]  # fmt: skip
    assert list(LENGTHS_MM) == sorted(LENGTHS_MM)


@pytest.fixture(scope="module")
def fits():
    """The real base, hanger and interface flange, with their screws."""
    from cad.base import base_part, screw_joints
    from cad.hanger import hanger_part
    from cad.hanger import screw_joints as hanger_joints
    from cad.interface import build_flange
    from fab.meshing.mesh import tessellate

    meshes = {
        "base": tessellate(base_part(LAYOUT.params).solid, 0.05),
        "hanger": tessellate(hanger_part(LAYOUT).solid, 0.05),
        "interface": tessellate(build_flange(LAYOUT.params), 0.05),
    }
    joints = [screw_joints(LAYOUT.params)[0], hanger_joints(LAYOUT)[0]]
    return {j.name: (j, meshes) for j in joints}


@pytest.mark.parametrize(
    ("name", "length"), others_long([("base_to_interface", 8.0), ("hanger_to_interface", 12.0)], unpack=True)
)
def test_the_real_screws_hold_all_of_their_nuts(fits, name, length):
    group, meshes = fits[name]
    fit = fitted(group, meshes)
    assert fit.length_mm == length and all(check.ok for check in fit.checks)
    shorter = screw_fit(group, meshes, LENGTHS_MM[LENGTHS_MM.index(length) - 1])
    assert not shorter.checks[0].ok
    thick = {**meshes, group.seat: meshes[group.seat].copy()}
    thick[group.seat].vertices[:, 2] -= 1.0  # a seat a millimetre lower: the same screw no longer reaches
    assert not screw_fit(group, thick, length).checks[0].ok


# --- bill of materials --------------------------------------------------------------------------------------------


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
    lines = bom_lines(MANIFEST, fake_fits(), recipe(282e3, OVERFLOW), None)
    assert all(check.ok for check in bom_checks(MANIFEST, all_joints(LAYOUT), fake_fits(), lines))
    assert sum(line.quantity for line in lines if line.owner == "screws") == 10 + 4 + 5 + 10 + 6 + 8 + 6
    rows = list(csv.DictReader(io.StringIO(bom_csv(lines))))
    assert len(rows) == len(lines) and math.isclose(float(rows[0]["quantity"]), 1)


@pytest.mark.parametrize(("grams", "spools"), [(900.0, 1), (950.0, 2), (2000.0, 3)])
def test_as_many_spools_as_the_slices_take_and_a_tenth_to_spare(grams, spools):
    parts = [{"name": name, "material": "PLA", "quantity": 1} for name in ("base", "hanger", "not_sliced")]
    plastics = plastic_g(parts, {"base": (100.0, 2.0), "hanger": (grams - 100.0, 2.0), "camera": (50.0, 1.0)})
    assert plastics == {"PLA": grams}
    amounts = {line.item: line.quantity for line in with_spools(supply_lines(recipe(282e3, OVERFLOW)), plastics)}
    assert amounts["PLA filament"] == spools and amounts["TPU filament"] == 1


@pytest.mark.parametrize("volume_mm3", [100e3, 282e3, 1.25e6, 2.9e6])
def test_the_mixing_cup_goes_into_the_vacuum_chamber(volume_mm3):
    asked = {line.item: line.order_as for line in supply_lines(recipe(volume_mm3, OVERFLOW))}
    cup_ml = float(re.search(r"(\d+) ml", asked["mixing cup"])[1])
    chamber_l = float(re.match(r"(\d+) l", asked["vacuum chamber and pump"])[1])
    assert chamber_l >= max(5.0, 1.3e-3 * cup_ml) and chamber_l < 1.3e-3 * cup_ml + 5.0


@pytest.mark.parametrize("name", sorted(silicones()))
def test_what_only_degassing_needs_is_asked_for_where_there_is_time_to_degas(name):
    mix = recipe(282e3, OVERFLOW, name)
    asked = {line.item: (line.order_as, line.use) for line in supply_lines(mix)}
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
    lines = bom_lines(MANIFEST, fake_fits(), recipe(282e3, OVERFLOW), None)
    index = next(k for k, line in enumerate(lines) if line.owner == dropped)
    checks = bom_checks(MANIFEST, all_joints(LAYOUT), fake_fits(), [*lines[:index], *lines[index + 1 :]])
    assert [check.name for check in checks if not check.ok] == [gate]


def test_every_segment_of_the_mold_is_bolted_to_two_of_the_other_half():
    pairs = [j.through for j in all_joints(LAYOUT) if j.owner == "cup"]
    assert len(set(pairs)) == 6
    for name in {segment for pair in pairs for segment in pair}:
        assert sum(name in pair for pair in pairs) == 2
