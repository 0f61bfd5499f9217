"""The ring's project in KiCad itself, where `kicad-cli` is installed (8 or later).

Its design rules and electrical rules, board against schematic, and its own plots against our Gerber files.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
from dataclasses import replace

import pytest
from gerbonara import ExcellonFile, GerberFile
from shapely import Polygon, box
from shapely.affinity import translate
from shapely.geometry import Point

from cad.led_ring import parts as led_parts
from fab.led_ring.bom import placement_csv
from fab.led_ring.copper import build_copper
from fab.led_ring.gerber import board_files, covered_area, read_archive, write_archive
from fab.led_ring.kicad import ORIGIN_MM, keyholed, write_project

PLOTS = {"F_Silk": "F_Silkscreen", "B_Silk": "B_Silkscreen"}  # our name: KiCad's, where they differ
CORNER_MM2 = 0.005  # a pad, where KiCad rounds the corners of an opening of the solder mask that is grown by 0.05 mm
AREA_MM2 = 0.01


def kicad(folder, *words: object) -> str:
    """Output of a command of `kicad-cli`; its settings go into the folder."""
    run = ["kicad-cli", *map(str, words)]
    home = {"HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    done = subprocess.run(run, cwd=folder, capture_output=True, text=True, check=False, env={**os.environ, **home})
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def folder(tmp_path):
    """An empty folder to work in."""
    if shutil.which("kicad-cli") is None or int(kicad(tmp_path, "version").split(".")[0]) < 8:
        pytest.skip("KiCad 8 or later is not installed: sh scripts/kicad.sh")
    return tmp_path


def faults(folder) -> list[str]:
    """Kinds of what KiCad finds in board and schematic, warnings too; unconnected pads and wrong nets among them."""
    board, sheet = folder / "drc.json", folder / "erc.json"
    report = ("--severity-all", "--format", "json", "-o")
    kicad(folder, "pcb", "drc", "--schematic-parity", *report, board, "led_ring.kicad_pcb")
    kicad(folder, "sch", "erc", *report, sheet, "led_ring.kicad_sch")
    drc, erc = json.loads(board.read_text()), json.loads(sheet.read_text())
    lists = [drc["violations"], drc["unconnected_items"], drc["schematic_parity"]]
    lists += [page["violations"] for page in erc["sheets"]]
    return sorted({fault["type"] for faults in lists for fault in faults})


@pytest.mark.parametrize("leds", [6, 7, 8, 9])
def test_kicad_finds_no_fault_in_board_and_schematic(folder, leds):
    write_project(build_copper(leds), leds, folder)
    assert faults(folder) == []


def test_kicad_finds_no_fault_with_chips_of_other_packages(folder, monkeypatch):
    rows = dict(led_parts.led_parts())
    for part, package in (("c_in", "0603"), ("c_out", "0805"), ("c_comp", "0805")):
        rows[part] = replace(rows[part], package=package)
    monkeypatch.setattr(led_parts, "led_parts", lambda: rows)
    write_project(build_copper(9), 9, folder)
    assert faults(folder) == []


@pytest.mark.parametrize(
    ("name", "old", "new", "wanted"),
    [
        # the ground plane grown by half a line, as it was before
        ("led_ring.kicad_pcb", " (filled_areas_thickness no)", "", "clearance"),
        ("led_ring.kicad_pcb", 'reference "C3"', 'reference "C4"', "missing_footprint"),
        ("led_ring.kicad_sch", "(xy 83.82 63.5) (xy 91.44", "(xy 83.82 63.5) (xy 90.17", "pin_not_connected"),
        ("led_ring.kicad_sch", '(global_label "FB"', '(global_label "COMP"', "net_conflict"),
    ],
)  # fmt: skip
def test_kicad_finds_a_planted_fault(folder, name, old, new, wanted):
    write_project(build_copper(9), 9, folder)
    text = (folder / name).read_text()
    assert old in text
    (folder / name).write_text(text.replace(old, new, 1))
    assert wanted in faults(folder)


@pytest.mark.filterwarnings("ignore:.*G90 header statement:SyntaxWarning")
@pytest.mark.parametrize("leds", [6, 9])
def test_what_kicad_plots_are_our_gerber_files(folder, leds):
    copper = build_copper(leds)
    write_project(copper, leds, folder)
    write_archive(board_files(copper), folder / "ours.zip")
    layers, holes = read_archive(folder / "ours.zip")
    # turned pads as plain polygons: gerbonara turns KiCad's macro of a turned rectangle the wrong way
    kicad(folder, "pcb", "export", "gerbers", "--disable-aperture-macros", "-o", "plots/", "led_ring.kicad_pcb")
    kicad(folder, "pcb", "export", "drill", "-o", "plots/", "led_ring.kicad_pcb")
    for name, area in layers.items():
        if name == "Edge_Cuts":
            continue
        (path,) = (folder / "plots").glob(f"led_ring-{PLOTS.get(name, name)}.*")
        plotted = translate(covered_area(GerberFile.open(path)), -ORIGIN_MM, ORIGIN_MM)
        side = {"F": "top", "B": "bottom"}[name[0]]
        corners = sum(pad.side == side for pad in copper.pads) if name.endswith("Mask") else 0
        assert plotted.symmetric_difference(area).area < AREA_MM2 + CORNER_MM2 * corners, name
    drilled = [hole.converted("mm") for hole in ExcellonFile.open(folder / "plots" / "led_ring.drl").objects]
    found = sorted((hole.x - ORIGIN_MM, hole.y + ORIGIN_MM, hole.aperture.diameter) for hole in drilled)
    assert found == [pytest.approx(hole, abs=1e-3) for hole in sorted(holes)]


def test_kicads_position_file_is_our_placement_table(folder):
    write_project(build_copper(9), 9, folder)
    kicad(folder, "pcb", "export", "pos", "--units", "mm", "--format", "csv", "-o", "pos.csv", "led_ring.kicad_pcb")
    rows = {row["Ref"]: row for row in csv.DictReader((folder / "pos.csv").read_text().splitlines())}
    ours = {row["designator"]: row for row in csv.DictReader(placement_csv(9).splitlines())}
    assert set(rows) == set(ours)
    for name, row in ours.items():
        theirs = float(rows[name]["PosX"]) - ORIGIN_MM, float(rows[name]["PosY"]) + ORIGIN_MM
        assert theirs == pytest.approx((float(row["mid_x_mm"]), float(row["mid_y_mm"])), abs=1e-3), name
        assert abs((float(rows[name]["Rot"]) - float(row["rotation_deg"]) + 180) % 360 - 180) < 0.01, name
        assert rows[name]["Side"] == row["layer"], name


def test_an_outline_with_slits_encloses_the_same_area():
    shape = box(0, 0, 40, 30)
    for x, y, r in ((10, 10, 3), (20, 10.5, 4), (30, 20, 5), (12, 22, 2), (20, 25, 1.5)):
        shape -= Point(x, y).buffer(r)
    ring = Polygon(keyholed(shape))
    assert ring.area == pytest.approx(shape.area) and len(ring.interiors) == 0
    assert ring.buffer(0.0).symmetric_difference(shape).area < 1e-9
    assert keyholed(box(0, 0, 1, 1)) == list(box(0, 0, 1, 1).exterior.coords[:-1])
