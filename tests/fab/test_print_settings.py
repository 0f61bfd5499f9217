"""What a printer needs beside its moves: lift at the end, fan, bed on any plate, filament drawn back."""

from __future__ import annotations

import re
import shutil

import pytest
import trimesh

from fab.slice.filaments import filament
from fab.slice.gcode import _Reader, read_gcode
from fab.slice.printers import printers
from fab.slice.project_3mf import Volume, single, write_prusa
from fab.slice.run import NAMES, slice_to_gcode
from fab.slice.settings import part_settings, zone_region

SLICER = next((path for name in NAMES if (path := shutil.which(name))), None)


def test_every_printer_lifts_its_nozzle_off_the_part_before_it_stops_or_goes_aside():
    """The slicer leaves a nozzle of 215 degrees on the last line: on the tip of the core, where it melts a pit."""
    for name, each in printers().items():
        after = _Reader(name)
        after.z = last_layer = 57.4
        for line in each.end:
            moves_aside = line.startswith("G28") or (line.startswith("G1") and ("X" in line or "Y" in line))
            assert after.z >= last_layer + 5 or not (moves_aside or line.startswith("M84")), (name, line)
            after.line(line)
        assert after.z == pytest.approx(last_layer + 10), name


@pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
def test_pla_is_cooled_however_long_a_layer_takes(tmp_path):
    """By the slicer's own default the fan stands still over every layer of a minute and more: a plate of a mold."""
    ring = trimesh.creation.annulus(20, 60, 2)
    ring.apply_translation((0, 0, 1))
    path = tmp_path / "bowl.3mf"
    write_prusa(single("bowl", part_settings("cup_bowl_1", "PLA"), (Volume("bowl", ring),)), path)
    slice_to_gcode(SLICER, path, tmp_path / "bowl.gcode")
    layers = (tmp_path / "bowl.gcode").read_text().split(";LAYER_CHANGE")[1:]
    assert read_gcode(tmp_path / "bowl.gcode").slicer_time_s > 60 * len(layers)
    fan = re.findall(r"^M10[67].*", "".join(layers[: len(layers) // 2]), re.MULTILINE)
    assert fan[-1] == "M106 S255"
    orca = part_settings("ring_spacer", "PETG").orca()
    assert (orca["reduce_fan_stop_start_freq"], orca["fan_min_speed"]) == (["1"], ["30"])
    assert orca["close_fan_the_first_x_layers"] == [part_settings("base", "PLA").prusa()["disable_fan_first_layers"]]


@pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
@pytest.mark.parametrize(("part", "material"), [("interface", "TPU 95A"), ("ring_spacer", "PETG")])
def test_the_fan_keeps_to_its_filament_over_bridges_and_short_layers(tmp_path, part, material):
    """By the slicer's own defaults it blows at 100 % there: TPU and PETG come off their own layers."""
    lid = trimesh.creation.revolve([(0, 3), (5, 3), (5, 0), (9, 0), (9, 5), (0, 5), (0, 3)])
    assert lid.is_watertight
    settings = part_settings(part, material)
    write_prusa(single("lid", settings, (Volume("lid", lid),)), tmp_path / "lid.3mf")
    slice_to_gcode(SLICER, tmp_path / "lid.3mf", tmp_path / "lid.gcode")
    text = (tmp_path / "lid.gcode").read_text()
    assert ";TYPE:Bridge infill" in text
    assert read_gcode(tmp_path / "lid.gcode").slicer_time_s < 60 * text.count(";LAYER_CHANGE")
    speeds = {float(speed) for speed in re.findall(r"^M106 S([0-9.]+)", text, re.MULTILINE)} - {0.0}
    wanted = filament(material).fan_percent
    assert speeds == ({2.55 * wanted} if wanted else set())
    orca = settings.orca()
    assert {*orca["fan_min_speed"], *orca["fan_max_speed"], *orca["overhang_fan_speed"]} == {str(wanted)}


@pytest.mark.parametrize("material", ["PLA", "PETG", "TPU 95A"])
def test_orca_projects_slice_with_relative_filament_and_keep_their_bed_warm_on_any_plate(material):
    """OrcaSlicer refuses relative filament (its default) without a reset; a plate's own bed is 35 to 45 degrees."""
    settings = part_settings("base", material).orca()
    assert (settings["use_relative_e_distances"], settings["before_layer_change_gcode"]) == ("1", "G92 E0")
    assert "\nM83" in settings["machine_start_gcode"]
    bed = [str(filament(material).bed_c)]
    for kind in ("cool", "eng", "hot", "textured"):
        assert settings[f"{kind}_plate_temp"] == settings[f"{kind}_plate_temp_initial_layer"] == bed


def test_filament_is_drawn_back_as_far_as_the_printers_own_profile_draws_it():
    """5 mm through the Bowden tube of an Ender-3: 0.8 mm, enough for a direct drive, strings every move."""
    for name, each in printers().items():
        settings, retract = part_settings("base", "PLA", each), "5" if name == "ender3" else "0.8"
        assert settings.prusa()["retract_length"] == retract, name
        assert settings.orca()["retraction_length"] == [retract], name


@pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
@pytest.mark.parametrize("name", ["ender3", "mk4"])
def test_tpu_is_not_ground_by_being_drawn_back_again_and_again(tmp_path, name):
    """The zone's lines end at its sides: drawn back at each, 10 mm of TPU passed the gear 45 times, 5 mm each."""
    flange, zone = trimesh.creation.annulus(20, 30, 1.0), trimesh.creation.annulus(22, 29, 2.0)
    flange.apply_translation((0, 0, 0.5))
    zone.apply_translation((0, 0, 2.0))
    where = printers()[name]
    volumes = (Volume("flange", flange), Volume("zone", zone, zone_region(7.0)))
    write_prusa(single("zone", part_settings("interface", "TPU 95A", where), volumes), tmp_path / "zone.3mf")
    slice_to_gcode(SLICER, tmp_path / "zone.3mf", tmp_path / "zone.gcode", where)
    fed_mm, backs = 0.0, []
    for line in (tmp_path / "zone.gcode").read_text().split(";LAYER_CHANGE", 1)[1].splitlines():
        if found := re.match(r"G1 .*E(-?[0-9.]+)", line):
            amount = float(found[1])
            if amount < 0:
                backs.append((fed_mm, -amount))
            elif "X" in line or "Y" in line:
                fed_mm += amount
    assert {amount for _, amount in backs} == {min(2.0, where.retract_mm)}
    most = max(sum(at <= other < at + 10.0 for other, _ in backs) for at, _ in backs)
    assert most <= 15
    assert part_settings("interface", "TPU 95A", where).orca()["reduce_infill_retraction"] == "1"
    assert not any("filament_retract" in key for key in part_settings("base", "PLA", where).prusa())
