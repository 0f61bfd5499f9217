"""Presets of OrcaSlicer and Bambu Studio: what a project sets stays, all else comes from the presets that it names."""

from __future__ import annotations

import json
from zipfile import ZipFile

import pytest
import trimesh

from fab.slice.printers import printer
from fab.slice.project_3mf import Volume, single, write_orca
from fab.slice.settings import part_settings

NAMED = ("mk4", "x1c", "a1_mini", "ender3")
IDS = ("print_settings_id", "filament_settings_id", "printer_settings_id")
PRESET = {
    "printer_model": "of the preset",
    "machine_max_acceleration_x": "of the preset",
    "bridge_speed": "of the preset",
}


def as_opened(project: dict, preset: dict) -> dict:
    """Settings after the slicer's rule: a key that no list names is the preset's, one that it names the project's."""
    own = {key for keys in project["different_settings_to_system"] for key in keys.split(";")}
    return {key: value if key in own else preset.get(key, value) for key, value in {**preset, **project}.items()}


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize(
    ("part", "material"), [("cup_bowl_1", "PLA"), ("ring_spacer", "PETG"), ("interface", "TPU 95A")]
)
def test_an_opened_project_keeps_its_settings_and_takes_the_rest_from_the_presets(name, part, material, tmp_path):
    settings = part_settings(part, material, printer(name))
    write_orca(single("a", settings, (Volume("a", trimesh.creation.box((9, 9, 9))),)), tmp_path / "a.3mf")
    project = json.loads(ZipFile(tmp_path / "a.3mf").read("Metadata/project_settings.config"))
    header = ("from", "name", "version", "different_settings_to_system", *IDS)
    own = {key: value for key, value in project.items() if key not in header}
    system = {**PRESET, **{key: "of the preset" for key in own}}
    opened = as_opened(project, system)
    assert {key: opened[key] for key in own} == own
    assert all(opened[key] == "of the preset" for key in PRESET)
    process, spool, machine = (set(keys.split(";")) for keys in project["different_settings_to_system"])
    assert {"machine_start_gcode", "printable_area", "retraction_length"} <= machine
    assert {"nozzle_temperature", "fan_min_speed", "filament_max_volumetric_speed"} <= spool
    assert {"wall_loops", "layer_height", "brim_object_gap", "xy_contour_compensation"} <= process
    assert not process & spool and not spool & machine and not process & machine


def test_filaments_are_named_as_each_vendor_names_them():
    names = {
        name: [part_settings(part, material, printer(name)).orca()["filament_settings_id"][0] for part, material in (
            ("base", "PLA"), ("ring_spacer", "PETG"), ("interface", "TPU 95A"),
        )]
        for name in NAMED
    }  # fmt: skip
    assert names["x1c"] == ["Generic PLA", "Generic PETG", "Generic TPU"]
    assert names["a1_mini"][0] == "Generic PLA @BBL A1M"
    assert names["mk4"][2] == "Prusa Generic TPU" and names["ender3"][1] == "Creality Generic PETG"


def test_a_printer_without_presets_names_none_and_sets_what_the_slicers_own_defaults_would_spoil():
    """Their defaults fuse the brim with the part, and lay the first layer at 30 and 60 mm/s."""
    project, prusa = part_settings("core_key_1", "PLA").orca(), part_settings("core_key_1", "PLA").prusa()
    assert not set(project) & {"different_settings_to_system", *IDS}
    assert project["brim_object_gap"] == prusa["brim_separation"] == "0.1"
    assert project["initial_layer_speed"] == project["initial_layer_infill_speed"] == prusa["first_layer_speed"] == "20"
