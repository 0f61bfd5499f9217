"""The ring's schematic, read back: nets from places alone, the tie to the board, planted faults."""

from __future__ import annotations

import itertools
import re
from collections import Counter

import pytest

from cad.errors import FileError
from cad.led_ring.parts import led_part
from cad.led_ring.placement import placements
from fab.led_ring.circuit import netlist
from fab.led_ring.copper import build_copper
from fab.led_ring.kicad import write_project
from fab.led_ring.schematic import schematic_text, value_text
from fab.led_ring.schematic_check import read_schematic, schematic_checks


@pytest.fixture
def project(tmp_path):
    write_project(build_copper(9), 9, tmp_path)
    return tmp_path / "led_ring.kicad_sch", tmp_path / "led_ring.kicad_pcb"


def failed(project, leds: int = 9) -> set[str]:
    return {check.name for check in schematic_checks(*project, leds) if not check.ok}


@pytest.mark.parametrize("leds", [6, 7, 8, 9])
def test_the_sheet_has_the_nets_of_the_circuit_at_every_led_count(tmp_path, leds):
    write_project(build_copper(leds), leds, tmp_path)
    found, symbols = read_schematic(tmp_path / "led_ring.kicad_sch")
    assert found == {pin: name for name, pins in netlist(leds).items() for pin in pins}
    assert {symbol.reference for symbol in symbols} == {place.reference for place in placements(leds)}
    assert failed((tmp_path / "led_ring.kicad_sch", tmp_path / "led_ring.kicad_pcb"), leds) == set()


def test_two_sheets_are_the_same_bytes_and_all_is_on_the_grid():
    text = schematic_text(9)
    assert text == schematic_text(9) and text.count("(") == text.count(")")
    for x, y in re.findall(r"\(xy ([\d.]+) ([\d.]+)\)", text.split("(junction")[-1]):
        assert float(x) % 1.27 == pytest.approx(0, abs=1e-6) or float(x) % 1.27 == pytest.approx(1.27, abs=1e-6)
        assert 0 < float(x) < 297 and 0 < float(y) < 210


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('(global_label "FB"', '(global_label "COMP"'),  # two nets under one name
        ("(xy 71.12 63.5) (xy 83.82 63.5)", "(xy 71.12 63.5) (xy 85.09 63.5)"),  # a wire past a junction
        ("(xy 83.82 53.34) (xy 83.82 63.5)", "(xy 83.82 54.61) (xy 83.82 63.5)"),  # a wire that ends too early
        ('(symbol (lib_id "endcap:LED") (at 168.91', '(symbol (lib_id "endcap:LED") (at 170.18'),  # a part moved
        ('(pin output line (at 10.16 5.08 180)', '(pin output line (at 10.16 2.54 180)'),  # a pin moved
    ],
)  # fmt: skip
def test_a_planted_fault_shows(project, old, new):
    text = project[0].read_text()
    assert text.count(old) == 1
    project[0].write_text(text.replace(old, new))
    assert "ring.schematic_wrong_pins" in failed(project)


def test_wires_end_where_anything_hangs_on_them_and_dots_stand_where_three_meet(project):
    """KiCad 9 connects the ends of wires, and no more than the first junction within one."""
    text = project[0].read_text()
    numbers = r"(\S+) (\S+)"
    wires = [
        ((float(x0), float(y0)), (float(x1), float(y1)))
        for x0, y0, x1, y1 in re.findall(rf"\n \(wire \(pts \(xy {numbers}\) \(xy {numbers}\)\)", text)
    ]
    dots = {(float(x), float(y)) for x, y in re.findall(rf"\n \(junction \(at {numbers}\)", text)}
    ends = Counter(end for wire in wires for end in wire)
    assert len(dots) == 17 and dots <= ends.keys()
    assert {end for end, count in ends.items() if count > 2} <= dots
    for (x0, y0), (x1, y1) in wires:
        assert x0 == x1 or y0 == y1
        assert not [
            (x, y) for x, y in ends if min(x0, x1) <= x <= max(x0, x1) and min(y0, y1) <= y <= max(y0, y1)
            and (x, y) not in ((x0, y0), (x1, y1))
        ]  # fmt: skip


def test_a_footprint_of_another_part_is_not_tied(project):
    for old, new in (('reference "C1"', 'reference "C9"'), ('value "22 uH"', 'value "10 uH"'), ("/", "/0")):
        text = project[1].read_text()
        line = '(path "/' if old == "/" else old
        changed = text.replace(line, '(path "/0' if old == "/" else new, 1)
        assert changed != text
        project[1].write_text(changed)
        assert failed(project) == {"ring.schematic_parts_not_tied_to_the_board"}
        project[1].write_text(text)


def test_values_are_ratings_or_part_numbers():
    wanted = {"inductor": "22 uH", "c_in": "4.7 uF", "c_comp": "220 nF", "r_set": "10 ohm", "driver": "TPS61165DBVR"}
    assert {part: value_text(led_part(part)) for part in wanted} == wanted


def test_symbols_do_not_overlap_on_the_sheet():
    """Boxes round the pins of any two symbols."""
    text, boxes = schematic_text(9), {}
    for name, x, y in re.findall(r'\(symbol \(lib_id "endcap:(\w+)"\) \(at ([\d.]+) ([\d.]+) 0\)', text):
        body = text.split(f'(symbol "{name}_1_1"')[1].split("  ))")[0]
        pins = [(float(a), float(b)) for a, b in re.findall(r"line \(at (\S+) (\S+) \d+\)", body)]
        boxes[name, x, y] = (
            [(float(x) + sign * max(abs(a) for a, _ in pins)) for sign in (-1, 1)],
            [(float(y) + sign * max(abs(b) for _, b in pins)) for sign in (-1, 1)],
        )
    assert len(boxes) == 17
    for ((a0, a1), (b0, b1)), ((c0, c1), (d0, d1)) in itertools.combinations(boxes.values(), 2):
        assert a1 < c0 or c1 < a0 or b1 < d0 or d1 < b0 or (b0 == b1 and d0 == d1 and b0 != d0)


def test_a_damaged_sheet_is_one_line(project):
    whole = project[0].read_text()
    project[0].write_text(whole[:2000])
    assert "ring.schematic_wrong_pins" in failed(project)
    project[0].write_text(whole.replace("(at 101.6", "(at here"))
    with pytest.raises(
        FileError, match=r"led_ring.kicad_sch: cannot be read as a KiCad schematic .*: make the ring again"
    ):
        read_schematic(project[0])
