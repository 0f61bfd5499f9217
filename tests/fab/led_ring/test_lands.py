"""Lands by package: whatever the parts' table holds, its leads lie on the copper, or the ring is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cad.errors import ParameterError
from cad.led_ring import parts as led_parts
from cad.led_ring.placement import placements
from fab.led_ring.__main__ import main
from fab.led_ring.circuit import PINS
from fab.led_ring.copper import build_copper
from fab.led_ring.gerber import board_files, read_archive, write_archive
from fab.led_ring.lands import LANDS, LEADS, PACKAGES, lands_of, leads_of
from fab.led_ring.rules import lead_checks, rule_checks

CHIPS = {"0603": (1.6, 0.8), "0805": (2.0, 1.25), "1206": (3.2, 1.6)}  # length and width, mm


@pytest.fixture
def table(monkeypatch):
    """Change rows of the parts' table: ``table(c_out="0805")`` is another chip, of that size; ``rows`` are all rows."""
    rows = dict(led_parts.led_parts())
    monkeypatch.setattr(led_parts, "led_parts", lambda: rows)

    def change(**packages: str) -> None:
        for part, package in packages.items():
            length, width = CHIPS.get(package, (rows[part].length_mm, rows[part].width_mm))
            rows[part] = replace(rows[part], package=package, length_mm=length, width_mm=width)

    change.rows = rows
    return change


def failed(tmp_path) -> set[str]:
    copper = build_copper()
    write_archive(board_files(copper), tmp_path / "board.zip")
    layers, holes = read_archive(tmp_path / "board.zip")
    return {check.name for check in rule_checks(layers, holes, copper.pads, placements()) if not check.ok}


def test_every_part_of_the_table_has_a_land_with_the_pins_of_the_circuit_and_leads_for_it():
    assert {part: set(lands_of(row)) for part, row in led_parts.led_parts().items()} == {
        part: set(pins) for part, pins in PINS.items()
    }
    for part, packages in PACKAGES.items():
        assert {frozenset(LANDS[package]) for package in packages} == {frozenset(PINS[part])}
    assert LEADS.keys() | {"SH 1.0"} == LANDS.keys()
    for package, leads in LEADS.items():
        assert set(leads) == set(LANDS[package])
    assert set(leads_of(led_parts.led_part("plug"))) == {"1", "2"}


@pytest.mark.parametrize(
    ("part", "package"),
    [
        *(("c_in", package) for package in CHIPS),
        *(("c_out", package) for package in CHIPS),
        ("c_comp", "0603"),
        ("c_comp", "0805"),
        ("r_set", "0603"),
    ],
)
def test_another_chip_gets_its_own_land_and_the_tracks_reach_it(tmp_path, table, part, package):
    table(**{part: package})
    wanted = {(width, height) for _, _, width, height in LANDS[package].values()}
    (reference,) = (place.reference for place in placements() if place.kind == part)
    assert {(pad.width, pad.height) for pad in build_copper().pads if pad.reference == reference} == wanted
    assert failed(tmp_path) == set()


def test_a_chip_too_large_for_its_place_is_refused(tmp_path, table, capsys):
    table(c_out="0603", r_set="1206")
    assert main([f"exports={tmp_path}"]) == 1
    assert "ring.shorted_nets = 1" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_tables_are_utf_8_whatever_the_locale_is(tmp_path, table, monkeypatch):
    """A row of one's own with an ohm sign, where files are Latin-1 or ASCII unless they say otherwise."""

    def written(path, text, encoding="ascii"):
        path.write_bytes(text.encode(encoding))

    monkeypatch.setattr(Path, "write_text", written)
    table.rows["r_set"] = replace(table.rows["r_set"], description="10 \u03a9, 1 %")
    assert main([f"exports={tmp_path}"]) == 0
    assert "10 \u03a9, 1 %" in (tmp_path / "led_ring" / "led_ring-bom.csv").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("part", "package", "fitting"),
    [
        ("c_out", "0402", "c_out can be 0603, 0805, 1206"),
        ("r_set", "SOD-123", "r_set can be 0603, 0805, 1206"),  # a land of another kind of part
        ("led", "2835", "led can be 3030"),
        ("driver", "WSON-6", "driver can be SOT-23-6"),
        ("inductor", "5030", "inductor can be 4018"),
        ("diode", "SMA", "diode can be SOD-123"),
        ("plug", "PH 2.0", "plug can be SH 1.0"),
    ],
)
def test_a_package_without_a_land_is_one_line(tmp_path, table, capsys, part, package, fitting):
    table(**{part: package})
    assert main([f"exports={tmp_path}"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"package={package} of {part} in cad/led_parts.csv has no land on the LED ring: {fitting}" in line
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ParameterError):
        build_copper()


BOTH = {"ring.lead_off_land_mm2", "ring.land_beyond_lead_mm"}


@pytest.mark.parametrize(
    ("part", "size", "names"),
    [
        ("c_out", (1.6, 0.8), BOTH),  # a 0603 in a row that says 1206
        ("c_in", (1.6, 0.8), BOTH),  # in one that says 0805
        ("r_set", (3.2, 1.6), BOTH),  # a 1206 in a row that says 0603
        ("r_set", (2.0, 1.25), {"ring.lead_off_land_mm2"}),
        ("driver", (3.8, 2.9), BOTH),
        ("diode", (2.7, 1.6), BOTH),
        ("inductor", (4.6, 4.6), {"ring.lead_off_land_mm2"}),
        ("led", (3.5, 2.8), {"ring.lead_off_land_mm2"}),
    ],
)
def test_leads_beside_their_lands_are_seen(table, part, size, names):
    table.rows[part] = replace(table.rows[part], length_mm=size[0], width_mm=size[1])
    found = {check.name for check in lead_checks(build_copper().pads, placements()) if not check.ok}
    assert found == names


def test_a_land_that_is_moved_leaves_its_lead():
    pads = build_copper().pads
    moved = [
        replace(pad, centre=(pad.centre[0] + 0.3, pad.centre[1])) if pad.reference == "J1" and pad.pin == "1" else pad
        for pad in pads
    ]
    assert [check.ok for check in lead_checks(pads, placements())] == [True, True]
    assert "ring.lead_off_land_mm2" in {c.name for c in lead_checks(moved, placements()) if not c.ok}
