"""The size that a printer is too small for: what the refusal proposes is accepted, whole."""

from __future__ import annotations

import re
import shlex
from dataclasses import replace

import numpy as np
import pytest

from cad.data_table import read_table
from cad.errors import FileError, ParameterError
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.pattern import parse_rings
from fab.build_sheet.sliced import require_sliced_for
from fab.slice import printers
from fab.slice.footprints import largest_diameter_mm, require_printer
from fab.slice.printers import fitting_turn_deg, printer, printer_words, require_bed, room_left_mm


def test_the_largest_size_that_a_refusal_names_can_be_made_with_what_it_names_beside():
    crowded = EndcapParams(250.0, 25.0, (1, 8, 16, 24, 32, 39, 45, 51, 55, 59, 61, 62), 8.0)
    with pytest.raises(ParameterError) as refused:
        require_printer(MoldLayout(crowded, 0.3), printer("generic180"))
    words = re.search(r"largest D of this printer is ([\d.]+) with (.*?);", str(refused.value))
    options = dict(word.split("=") for word in words[2].split())
    assert set(options) == {"T", "dots", "joint_clearance"}  # none of the three can be kept
    design = EndcapParams(float(words[1]), float(options["T"]), parse_rings(options["dots"]), 8.0)
    require_printer(MoldLayout(design, float(options["joint_clearance"])), printer("generic180"))


def test_the_largest_size_of_a_low_printer_is_that_of_the_silicone_and_the_joints():
    low = replace(printer(), height_mm=100.0)  # the bowl's wall, 6 to 9 mm by silicone and joints, is a part's height
    wide_joints = MoldLayout(EndcapParams(230.0, 8.0), 0.2)
    largest = largest_diameter_mm(wide_joints, low)
    require_printer(MoldLayout(EndcapParams(largest, 8.0), 0.2), low)
    with pytest.raises(ParameterError, match=f"the largest D of this printer is {largest:g};"):
        require_printer(MoldLayout(EndcapParams(largest + 0.1, 8.0), 0.2), low)


@pytest.mark.parametrize(("width", "depth"), [(7.0, 7.0), (250.0, 7.0), (8.0, 250.0)])
def test_a_bed_without_room_beside_its_margin_takes_nothing(width, depth, tmp_path):
    where, points = replace(printer(), width_mm=width, depth_mm=depth), np.array([[0.0, 0, 0], [300, 200, 5]])
    for size in (1.0, 1e-3):
        assert fitting_turn_deg(size * points, where) is None and room_left_mm(size * points, where) < 0
    copy = tmp_path / "printers.csv"
    row = f"tiny,Tiny,{width:g},{depth:g},200,,0.4,0.8,G29,M84,,,,,,E\n"
    copy.write_text(printers.PRINTER_TABLE.read_text() + row)
    with pytest.raises(FileError, match=r"printers.csv line \d+ \(tiny\): (width|depth)_mm=[78] is not over 8: 4 mm"):
        read_table(copy, printers._printer)


def test_a_printer_whose_name_has_a_space_is_quoted_in_every_command(monkeypatch):
    voron = replace(printer("generic256"), name="Voron 2.4", width_mm=255.0, depth_mm=255.0)
    table = {name: each for name, each in printers.printers().items() if each.width_mm < 250} | {voron.name: voron}
    monkeypatch.setattr(printers, "printers", lambda: table)
    assert shlex.split(printer_words("Voron 2.4")) == ["printer=Voron 2.4"]
    asked = "printer='Voron 2.4'"
    with pytest.raises(ParameterError, match=f"D=240 needs {asked} "):
        require_printer(MoldLayout(EndcapParams(240.0, 12.0)), printer("generic180"))
    with pytest.raises(ParameterError, match=f"takes every part is {asked} "):
        require_bed({"slab": np.array([[0.0, 0, 0], [240, 240, 5]])}, printer("generic180"))
    with pytest.raises(ParameterError, match=f"make slice D=240 T=12 {asked}` first"):
        require_sliced_for("Voron 2.4", {"printer": {"name": "mk4"}}, "D=240 T=12")
