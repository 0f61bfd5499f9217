"""The LED ring's schematic in KiCad's format 7: symbols on one A4 sheet, wires, and a label on every net.

Millimetres on KiCad's grid of 1.27, y downward on the sheet and upward inside a symbol. No symbol is rotated, so a pin
lies at (x of its symbol + x, y of its symbol - y). Every net has a global label, so its name is that of the circuit and
of the board; symbols and the board's footprints share reference, value, footprint and :func:`identity`.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from cad.led_ring.parts import LedPart
from cad.led_ring.placement import Placement, placements

VERSION = 20230121  # of the format: KiCad 7
SHEET = uuid.uuid5(uuid.NAMESPACE_URL, "endcap-toolkit/led_ring")
STRING_X_MM, STRING_STEP_MM = 156.21, 12.7  # centre of the first LED, and from one to the next
RAIL_Y_MM, TOP_Y_MM, FEEDBACK_Y_MM = 63.5, 53.34, 68.58  # supply; inductor, diode and string; back to the driver
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))
Point = tuple[float, float]
GROUNDS: tuple[Point, ...] = ((60.96, 71.12), (101.6, 78.74), (142.24, 60.96), (116.84, 81.28), (152.4, 76.2))


@dataclass(frozen=True)
class SymbolPin:
    """One pin of a symbol.

    Attributes:
        number, name: of the pin.
        at: end of the pin, where a wire meets it.
        turn_deg: direction from there into the symbol (0 is to the right).
        kind: KiCad's electrical type.
    """

    number: str
    name: str
    at: Point
    turn_deg: int
    kind: str = "passive"


@dataclass(frozen=True)
class Symbol:
    """Symbol of a kind of part.

    Attributes:
        name: in the library ``endcap``.
        lines, pins: of the symbol.
        texts: positions of reference and value.
        justify: alignment of the two.
        shows_pins: whether names and numbers of the pins are drawn, round a filled box.
    """

    name: str
    lines: tuple[tuple[Point, ...], ...]
    pins: tuple[SymbolPin, ...]
    texts: tuple[Point, Point]
    justify: str = ""
    shows_pins: bool = False


def _upright(name: str, *lines: tuple[Point, ...]) -> Symbol:
    pins = SymbolPin("1", "1", (0, 3.81), 270), SymbolPin("2", "2", (0, -3.81), 90)
    return Symbol(name, lines, pins, ((2.54, 1.27), (2.54, -1.27)), "left")


def _flat(name: str, first: str, second: str, *lines: tuple[Point, ...]) -> Symbol:
    pins = SymbolPin(first, first, (-3.81, 0), 0), SymbolPin(second, second, (3.81, 0), 180)
    return Symbol(name, lines, pins, ((0.0, 3.81), (0.0, -3.81)))


def _box(left: float, bottom: float, right: float, top: float) -> tuple[Point, ...]:
    return (left, bottom), (left, top), (right, top), (right, bottom), (left, bottom)


_TRIANGLE = ((-1.27, 1.27), (1.27, 0.0), (-1.27, -1.27), (-1.27, 1.27))
_BAR = ((1.27, 1.27), (1.27, -1.27))
_CAPACITOR = _upright("C", ((-1.9, 0.6), (1.9, 0.6)), ((-1.9, -0.6), (1.9, -0.6)), ((0, 1.27), (0, 0.6)),
                      ((0, -0.6), (0, -1.27)))  # fmt: skip
SYMBOLS = {
    "led": _flat("LED", "A", "K", _TRIANGLE, _BAR, ((0.3, 1.6), (1.5, 2.8)), ((1.3, 1.3), (2.5, 2.5))),
    "diode": _flat("D_Schottky", "A", "K", _TRIANGLE, ((0.76, 1.27), *_BAR, (1.78, -1.27))),
    "inductor": _flat("L", "1", "2", _box(-2.54, -0.76, 2.54, 0.76)),
    "r_set": _upright("R", _box(-1.0, -2.54, 1.0, 2.54)),
    **dict.fromkeys(("c_in", "c_out", "c_comp"), _CAPACITOR),
    "driver": Symbol(
        "TPS61165",
        (_box(-7.62, -7.62, 7.62, 7.62),),
        (
            SymbolPin("1", "VIN", (-10.16, 5.08), 0, "power_in"), SymbolPin("2", "CTRL", (-10.16, 0), 0, "input"),
            SymbolPin("3", "SW", (10.16, 5.08), 180, "output"), SymbolPin("4", "GND", (0, -10.16), 90, "power_in"),
            SymbolPin("5", "COMP", (10.16, -5.08), 180), SymbolPin("6", "FB", (10.16, 0), 180, "input"),
        ),
        ((-2.54, -9.53), (-2.54, -12.07)),
        "right",
        shows_pins=True,
    ),
    "plug": Symbol(
        "Plug",
        (_box(-3.81, -7.62, 5.08, 5.08),),
        (
            SymbolPin("1", "5V", (7.62, 2.54), 180, "power_out"), SymbolPin("2", "GND", (7.62, 0), 180, "power_out"),
            SymbolPin("M1", "M1", (7.62, -2.54), 180), SymbolPin("M2", "M2", (7.62, -5.08), 180),
        ),
        ((-3.81, 9.53), (-3.81, 6.99)),
        "left",
        shows_pins=True,
    ),
}  # fmt: skip


def identity(reference: str) -> str:
    """UUID of a part's symbol, the same in every ring, which links its footprint on the board to it."""
    return str(uuid.uuid5(SHEET, reference))


def value_text(part: LedPart) -> str:
    """Value beside the symbol: the rating of a part that is chosen by its rating, otherwise the part number."""
    if part.unit not in ("F", "H", "ohm"):
        return part.part_number
    scale, prefix = next(row for row in PREFIXES if part.value >= row[0] * (1 - 1e-9))
    return f"{part.value / scale:g} {prefix}{part.unit}"


def schematic_text(led_count: int) -> str:
    """The sheet as KiCad's S-expressions.

    Args:
        led_count: LEDs in the string.

    Raises:
        ParameterError: LED count outside the range of the board.
    """
    places = placements(led_count)
    led = next(place.part.part_number for place in places if place.kind == "led")
    drawn = {place.kind: SYMBOLS[place.kind] for place in places}
    library = {symbol.name: symbol for symbol in drawn.values()}
    wires, junctions, labels = _wires(led_count)
    return "\n".join(
        [
            f"(kicad_sch (version {VERSION}) (generator endcap_toolkit)",
            f' (uuid "{SHEET}") (paper "A4")',
            " (lib_symbols",
            *(_library_symbol(symbol) for symbol in library.values()),
            " )",
            *(_junction(point) for point in junctions),
            f' (text "LED ring: {led_count} LEDs {led} in one string; values: led_ring.json" (at 25.4 30.48 0) '
            f"{_effects('left')} {_uuid('note')})",
            *(_wire(start, end) for start, end in wires),
            *(_label(name, point, turn) for name, point, turn in labels),
            *(_instance(place, _place_of(place.reference)) for place in places),
            ' (sheet_instances (path "/" (page "1")))',
            ")\n",
        ]
    )  # fmt: skip


def _place_of(reference: str) -> Point:
    """Position of a part's symbol on the sheet."""
    if reference.startswith("LED"):
        return STRING_X_MM + STRING_STEP_MM * (int(reference[3:]) - 1), TOP_Y_MM
    return {
        "J1": (38.1, 66.04), "C1": (60.96, 67.31), "L1": (101.6, TOP_Y_MM), "U1": (101.6, FEEDBACK_Y_MM),
        "D1": (128.27, TOP_Y_MM), "C2": (142.24, 57.15), "C3": (116.84, 77.47), "R1": (152.4, 72.39),
    }[reference]  # fmt: skip


def _wires(led_count: int) -> tuple[list[tuple[Point, Point]], list[Point], list[tuple[str, Point, int]]]:
    """(wires, junctions, labels as name, place and turn) of the sheet."""
    top, rail, back = TOP_Y_MM, RAIL_Y_MM, FEEDBACK_Y_MM
    first, last = STRING_X_MM - 3.81, STRING_X_MM + STRING_STEP_MM * (led_count - 1) + 3.81
    up = 5.08  # of a label over its net
    corner = last + 5.08
    lines: list[tuple[Point, ...]] = [
        ((45.72, rail), (91.44, rail)), ((83.82, rail), (83.82, top), (97.79, top)),
        ((83.82, rail), (83.82, back), (91.44, back)), ((71.12, rail), (71.12, rail - up)),  # VIN
        ((105.41, top), (124.46, top)), ((111.76, rail), (116.84, rail), (116.84, top - up)),  # SW
        ((132.08, top), (first, top)), ((142.24, top), (142.24, top - up)),  # VOUT
        ((last, top), (corner, top), (corner, back), (111.76, back)), ((152.4, back), (152.4, back - up)),  # FB
        ((111.76, 73.66), (121.92, 73.66)),  # COMP
        *(((45.72, y), (50.8, y)) for y in (66.04, 68.58, 71.12)), ((50.8, 66.04), (50.8, 76.2)),  # GND of the plug
        *((point, (point[0], point[1] + 1.27)) for point in GROUNDS),
    ]  # fmt: skip
    junctions = [(60.96, rail), (71.12, rail), (83.82, rail), (116.84, top), (142.24, top), (152.4, back)]
    junctions += [(116.84, 73.66), (50.8, 68.58), (50.8, 71.12)]
    labels = [("VIN", (71.12, rail - up), 90), ("SW", (116.84, top - up), 90), ("VOUT", (142.24, top - up), 90)]
    labels += [("FB", (152.4, back - up), 90), ("COMP", (121.92, 73.66), 0), ("GND", (50.8, 76.2), 270)]
    labels += [("GND", (x, y + 1.27), 270) for x, y in GROUNDS]
    for k in range(1, led_count):
        start = STRING_X_MM + STRING_STEP_MM * (k - 1) + 3.81
        middle = start + STRING_STEP_MM / 2 - 3.81
        lines += [((start, top), (start + STRING_STEP_MM - 7.62, top)), ((middle, top), (middle, top - up))]
        junctions.append((middle, top))
        labels.append((f"N{k}", (middle, top - up), 90))
    return [piece for line in lines for pair in pairwise(line) for piece in _split(pair, junctions)], junctions, labels


def _split(wire: tuple[Point, Point], junctions: list[Point]) -> list[tuple[Point, Point]]:
    """A wire cut at the junctions on it: KiCad 9 connects a wire's ends, and one junction within."""
    (x0, y0), (x1, y1) = sorted(wire)
    inside = [at for at in junctions if x0 <= at[0] <= x1 and min(y0, y1) <= at[1] <= max(y0, y1)]
    return list(pairwise(sorted({*wire, *inside})))


def _library_symbol(symbol: Symbol) -> str:
    hidden = "" if symbol.shows_pins else " (pin_numbers hide)"
    names = "(pin_names (offset 0.508))" if symbol.shows_pins else "(pin_names (offset 0) hide)"
    drawn = [
        f"   (polyline (pts {_points(line)}) (stroke (width 0.2) (type default)) "
        f"(fill (type {'background' if symbol.shows_pins else 'none'})))"
        for line in symbol.lines
    ]
    pins = [
        f"   (pin {pin.kind} line (at {_xy(pin.at)} {pin.turn_deg}) (length {_reach(symbol, pin):g}) "
        f'(name "{pin.name}" {_effects()}) (number "{pin.number}" {_effects()}))'
        for pin in symbol.pins
    ]
    fields = [
        f'   (property "{key}" "" (at 0 0 0) {_effects(hide=True)})' for key in ("Reference", "Value", "Footprint")
    ]
    return "\n".join(
        [
            f'  (symbol "endcap:{symbol.name}"{hidden} {names} (in_bom yes) (on_board yes)',
            *fields,
            f'  (symbol "{symbol.name}_0_1"', *drawn, "  )",
            f'  (symbol "{symbol.name}_1_1"', *pins, "  ))",
        ]
    )  # fmt: skip


def _reach(symbol: Symbol, pin: SymbolPin) -> float:
    """Length of a pin up to the drawing: the box, or the lines of a two-pin part, mm."""
    if symbol.shows_pins:
        return 2.54
    along = 0 if pin.turn_deg in (0, 180) else 1
    return abs(pin.at[along]) - max(abs(point[along]) for line in symbol.lines[:2] for point in line)


def _instance(place: Placement, at: Point) -> str:
    symbol, reference = SYMBOLS[place.kind], place.reference
    beside = [(at[0] + x, at[1] - y) for x, y in symbol.texts]
    is_led = place.kind == "led"  # all equal: given in the note
    shown = [
        f'  (property "Reference" "{reference}" (at {_xy(beside[0])} 0) {_effects(symbol.justify)})',
        f'  (property "Value" "{value_text(place.part)}" (at {_xy(beside[1])} 0) {_effects(symbol.justify, is_led)})',
    ]
    fields = {
        "Footprint": f"endcap:{place.part.package}", "Description": place.part.description,
        "Manufacturer": place.part.maker, "MPN": place.part.part_number,
    }  # fmt: skip
    return "\n".join(
        [
            f' (symbol (lib_id "endcap:{symbol.name}") (at {_xy(at)} 0) (unit 1) (in_bom yes) (on_board yes) (dnp no)',
            f'  (uuid "{identity(reference)}")',
            *shown,
            *(f'  (property "{key}" "{text}" (at {_xy(at)} 0) {_effects(hide=True)})' for key, text in fields.items()),
            *(f'  (pin "{pin.number}" {_uuid(reference, pin.number)})' for pin in symbol.pins),
            f'  (instances (project "led_ring" (path "/{SHEET}" (reference "{reference}") (unit 1))))',
            " )",
        ]
    )


def _wire(start: Point, end: Point) -> str:
    return f" (wire (pts {_points((start, end))}) (stroke (width 0) (type default)) {_uuid('wire', start, end)})"


def _junction(at: Point) -> str:
    return f" (junction (at {_xy(at)}) (diameter 0) (color 0 0 0 0) {_uuid('junction', at)})"


def _label(name: str, at: Point, turn_deg: int) -> str:
    justify = "right" if turn_deg == 270 else "left"
    return (
        f' (global_label "{name}" (shape passive) (at {_xy(at)} {turn_deg}) {_effects(justify)} '
        f"{_uuid('label', name, at)})"
    )


def _effects(justify: str = "", hide: bool = False) -> str:
    words = [f"(justify {justify})"] if justify else []
    return " ".join(["(effects (font (size 1.27 1.27))", *words, *(["hide"] if hide else [])]) + ")"


def _uuid(*what: object) -> str:
    return f'(uuid "{uuid.uuid5(SHEET, repr(what))}")'


def _xy(point: Point) -> str:
    return f"{point[0]:.6g} {point[1]:.6g}"


def _points(points: Iterable[Point]) -> str:
    return " ".join(f"(xy {_xy(point)})" for point in points)
