"""Check of the ring's schematic file: pins connected by its wires and labels, and footprint of each symbol."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gerbonara.cad.kicad.pcb import Board
from gerbonara.cad.kicad.schematic import Schematic, SymbolInstance
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from fab.checks.check import Check
from fab.led_ring.circuit import Pin, netlist
from fab.led_ring.kicad import readable

NEAR_MM = 1e-3
Point = tuple[float, float]


def schematic_checks(schematic: Path, board: Path, led_count: int) -> list[Check]:
    """Check that the schematic has the nets of the circuit, and that each footprint is linked to its own symbol.

    Args:
        schematic: path of the ``.kicad_sch``.
        board: path of the ``.kicad_pcb``.
        led_count: LEDs in the string.

    Raises:
        FileError: one of them cannot be read.
    """
    found, symbols = read_schematic(schematic)
    wanted = {pin: name for name, pins in netlist(led_count).items() for pin in pins}
    wrong = sum(found.get(pin) != name for pin, name in wanted.items()) + len(set(found) - set(wanted))
    with readable(board, "board"):
        footprints = {str(footprint.path).lstrip("/"): footprint for footprint in Board.open(board).footprints}
    tied = sum(_same(symbol, footprints.get(str(symbol.uuid.value))) for symbol in symbols)
    return [
        Check("ring.schematic_wrong_pins", float(wrong), high=0),
        Check("ring.schematic_parts_not_tied_to_the_board", float(len(symbols) - tied), high=0),
        Check("ring.schematic_parts", float(len(symbols)), len(footprints), len(footprints)),
    ]


def _same(symbol: SymbolInstance, footprint: object) -> bool:
    """Whether a footprint belongs to a symbol, by reference, value and library name."""
    if footprint is None:
        return False
    texts = {text.type: text.text for text in footprint.texts}  # type: ignore[attr-defined]
    of_board = texts.get("reference"), texts.get("value"), footprint.name  # type: ignore[attr-defined]
    return bool(of_board == (symbol.reference, symbol.value, symbol.footprint))


def read_schematic(path: Path) -> tuple[dict[Pin, str], list[SymbolInstance]]:
    """Net of each pin, found from positions alone as KiCad does, and the symbols.

    A wire connects the items at its two ends; items along it are ignored, as KiCad 9 connects only the first of them.
    Labels of one name are one net.

    Args:
        path: of the ``.kicad_sch``.

    Returns:
        Name of the net by (reference, pin); ``""`` where it has no label, names joined by ``+`` where two meet.

    Raises:
        FileError: it cannot be read.
    """
    with readable(path, "schematic"):
        sheet = Schematic.open(path)
        pins = [(symbol.reference, pin, at) for symbol in sheet.symbols for pin, at in _pins(sheet, symbol)]
        wires = [[(point.x, point.y) for point in wire.points] for wire in sheet.wires]
        labels = [(label.text, (label.at.x, label.at.y)) for label in sheet.global_labels]
    group = _groups([*([at] for *_, at in pins), *([at] for _, at in labels), *wires])
    names: dict[int, set[str]] = {}
    for number, (name, _) in enumerate(labels, len(pins)):
        names.setdefault(group[number], set()).add(name)
    nets = {(reference, pin): "+".join(sorted(names.get(group[k], ()))) for k, (reference, pin, _) in enumerate(pins)}
    return nets, list(sheet.symbols)


def _pins(sheet: Schematic, symbol: SymbolInstance) -> list[tuple[str, Point]]:
    drawn = sheet.lookup_symbol(symbol.lib_name, symbol.lib_id)
    return [
        (str(pin.number.value), (symbol.at.x + pin.at.x, symbol.at.y - pin.at.y))
        for unit in drawn.units
        for pin in unit.pins
    ]


def _groups(ends: Sequence[Sequence[Point]]) -> list[int]:
    """Number of the connected group of each item, by the positions where it can be connected."""
    joined = [any(_near(a, b) for a in these for b in those) for these in ends for those in ends]
    square = csr_matrix(np.array(joined, bool).reshape(len(ends), len(ends)))
    return [int(group) for group in connected_components(square, directed=False)[1]]


def _near(a: Point, b: Point) -> bool:
    return abs(a[0] - b[0]) < NEAR_MM and abs(a[1] - b[1]) < NEAR_MM
