"""KiCad's own design rule check of the board, where KiCad is installed (6 or later, with its Python module)."""

from __future__ import annotations

import os
import re
import shutil
import subprocess

import pytest
from shapely import Polygon, box
from shapely.geometry import Point

from fab.led_ring.copper import build_copper
from fab.led_ring.kicad import keyholed, write_project

PYTHON = shutil.which("python3", path="/usr/bin")  # KiCad's module belongs to the system's Python
CHECK = """
import sys, pcbnew
board = pcbnew.LoadBoard(sys.argv[1])
assert board is not None
print(len(board.GetFootprints()), "footprints", len(board.Zones()), "zones")
pcbnew.WriteDRCReport(board, sys.argv[2], pcbnew.EDA_UNITS_MILLIMETRES, True)
"""


def kicad_major() -> int:
    if PYTHON is None:
        return 0
    asked = [PYTHON, "-c", "import pcbnew; print(pcbnew.Version())"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    match = re.match(r"\(?(\d+)", found.stdout.strip())
    return int(match[1]) if match else 0


def for_kicad_6(text: str) -> str:
    """The same board in the words of the format before."""
    text = text.replace("(version 20221018)", "(version 20211014)")
    text = re.sub(r"\(stroke \(width ([\d.]+)\) \(type solid\)\)", r"(width \1)", text)
    return re.sub(r"\(effects (\(font .*?\)) hide\)", r"hide (effects \1)", text)


@pytest.mark.parametrize("leds", [9, 6])
def test_kicad_finds_no_fault_in_the_board(tmp_path, leds):
    major = kicad_major()
    if not 6 <= major <= 9:
        pytest.skip("KiCad is not installed: apt-get install --no-install-recommends kicad")
    write_project(build_copper(leds), leds, tmp_path)
    board, report = tmp_path / "led_ring.kicad_pcb", tmp_path / "drc.txt"
    if major == 6:
        board.write_text(for_kicad_6(board.read_text()))
    run = [str(PYTHON), "-c", CHECK, str(board), str(report)]
    done = subprocess.run(run, capture_output=True, text=True, check=False, env={**os.environ, "HOME": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    assert "1 zones" in done.stdout
    found = re.findall(r"Found (\d+) (?:DRC violations|unconnected pads|Footprint errors)", report.read_text())
    assert found == ["0", "0", "0"], report.read_text()


def test_an_outline_with_slits_encloses_the_same_area():
    shape = box(0, 0, 40, 30)
    for x, y, r in ((10, 10, 3), (20, 10.5, 4), (30, 20, 5), (12, 22, 2), (20, 25, 1.5)):
        shape -= Point(x, y).buffer(r)
    ring = Polygon(keyholed(shape))
    assert ring.area == pytest.approx(shape.area) and len(ring.interiors) == 0
    assert ring.buffer(0.0).symmetric_difference(shape).area < 1e-9
    assert keyholed(box(0, 0, 1, 1)) == list(box(0, 0, 1, 1).exterior.coords[:-1])
