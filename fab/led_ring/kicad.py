"""The LED ring as a KiCad project (format of KiCad 7): footprints, nets, tracks, holes, ground plane and legend.

Millimetres. KiCad's y axis points downward, so the endcap's x and y lie at (``ORIGIN_MM`` + x, ``ORIGIN_MM`` - y).
Every footprint is written at its part's centre, rotated as in the placement table, so that KiCad's own position file
agrees with it. In KiCad's format a pad's position is in the rotated frame of its footprint, its rotation in that of the
board. The layers of the board have the same geometry as the Gerber files.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gerbonara.cad.kicad.pcb import Board
from shapely import LineString, Point, Polygon, unary_union
from shapely.geometry.base import BaseGeometry

from cad.errors import FileError
from cad.led_ring.board import BOARD_INNER_RADIUS_MM, BOARD_OUTER_RADIUS_MM, BOARD_THICKNESS_MM
from cad.led_ring.placement import Placement, placements
from cad.mold.layout import rotated
from fab.checks.check import Check
from fab.led_ring.circuit import netlist
from fab.led_ring.copper import CIRCLE_SEGMENTS, PLANE_GAP_MM, VIA_DRILL_MM, VIA_PAD_MM, Copper, Pad, polygons
from fab.led_ring.gerber import MASK_GROWTH_MM, PASTE_SHRINK_MM, SIDES
from fab.led_ring.schematic import SHEET, identity, schematic_text, value_text
from fab.led_ring.silk import silk_shape

VERSION = 20221018  # of the format: KiCad 7, which gerbonara reads
ORIGIN_MM = 100.0
AREA_MM2 = 0.01  # by which a layer may differ when read back
LAYERS = (
    (0, "F.Cu", "signal"), (31, "B.Cu", "signal"), (34, "B.Paste", "user"), (35, "F.Paste", "user"),
    (36, "B.SilkS", "user"), (37, "F.SilkS", "user"), (38, "B.Mask", "user"), (39, "F.Mask", "user"),
    (44, "Edge.Cuts", "user"), (48, "B.Fab", "user"), (49, "F.Fab", "user"),
)  # fmt: skip


def write_project(copper: Copper, led_count: int, folder: Path) -> None:
    """Write ``led_ring.kicad_pcb``, ``led_ring.kicad_sch`` and ``led_ring.kicad_pro``.

    Args:
        copper: everything on the board.
        led_count: LEDs in the string.
        folder: receives them.
    """
    (folder / "led_ring.kicad_sch").write_text(schematic_text(led_count), encoding="utf-8")
    (folder / "led_ring.kicad_pcb").write_text(board_text(copper, led_count), encoding="utf-8")
    rules = {"min_clearance": 0.2, "min_copper_edge_clearance": 0.3, "min_track_width": 0.3,
             "min_through_hole_diameter": VIA_DRILL_MM, "min_via_annular_width": 0.15}  # fmt: skip
    embedded = "ignore"  # symbols and footprints are embedded in the files
    content = {
        "board": {"design_settings": {"rules": rules, "rule_severities": {"lib_footprint_issues": embedded}}},
        "erc": {"rule_severities": {"lib_symbol_issues": embedded, "footprint_link_issues": embedded}},
        "meta": {"filename": "led_ring.kicad_pro", "version": 1},
        "net_settings": {"classes": [{"name": "Default", "clearance": 0.2, "track_width": 0.4}]},
        "sheets": [[str(SHEET), ""]],
    }
    (folder / "led_ring.kicad_pro").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def board_text(copper: Copper, led_count: int) -> str:
    """The board as KiCad's S-expressions.

    Args:
        copper: everything on the board.
        led_count: LEDs in the string.
    """
    nets = {name: number for number, name in enumerate(netlist(led_count), 1)}
    layers = "\n".join(f'  ({number} "{name}" {kind})' for number, name, kind in LAYERS)
    lines = [
        f"(kicad_pcb (version {VERSION}) (generator endcap_toolkit)",
        f" (general (thickness {BOARD_THICKNESS_MM:g}))",
        ' (paper "A4")',
        f" (layers\n{layers}\n )",
        f" (setup (pad_to_mask_clearance {MASK_GROWTH_MM:g}))",
        ' (net 0 "")',
        *(f' (net {number} "{name}")' for name, number in nets.items()),
        *(_footprint(place, copper, nets) for place in placements(led_count)),
        *(_circle(radius) for radius in (BOARD_OUTER_RADIUS_MM, BOARD_INNER_RADIUS_MM)),
    ]
    for track in copper.tracks:
        for start, end in zip(track.points, track.points[1:], strict=False):
            lines.append(
                f" (segment (start {_at(start)}) (end {_at(end)}) (width {track.width:g}) "
                f'(layer "{SIDES[track.side]}.Cu") (net {nets[track.net]}))'
            )
    lines += [
        f" (via (at {_at(via.centre)}) (size {VIA_PAD_MM:g}) (drill {VIA_DRILL_MM:g}) "
        f'(layers "F.Cu" "B.Cu") (net {nets[via.net]}))'
        for via in copper.vias
    ]
    lines += [
        f' (gr_poly {_points(keyholed(piece))} (stroke (width 0) (type solid)) (fill solid) (layer "{letter}.SilkS"))'
        for side, letter in SIDES.items()
        for piece in polygons(silk_shape(copper, side))
    ]
    return "\n".join([*lines, _plane(copper.plane, nets["GND"]), ")\n"])


def _at(point: tuple[float, ...]) -> str:
    return f"{ORIGIN_MM + point[0]:.6f} {ORIGIN_MM - point[1]:.6f}"


def _circle(radius_mm: float) -> str:
    middle, edge = _at((0.0, 0.0)), _at((radius_mm, 0.0))
    return f' (gr_circle (center {middle}) (end {edge}) (stroke (width 0.1) (type solid)) (layer "Edge.Cuts"))'


def _footprint(place: Placement, copper: Copper, nets: dict[str, int]) -> str:
    """One part with its pads."""
    letter = SIDES[place.side]
    at = f"{_at(place.centre_mm)} {place.rotation_deg:.6f}"
    text = "(effects (font (size 0.8 0.8) (thickness 0.12)) hide)"
    pads = [_pad(pad, place, nets) for pad in copper.pads if pad.reference == place.reference]
    return "\n".join(
        [
            f' (footprint "endcap:{place.part.package}" (layer "{letter}.Cu") (at {at})',
            f'  (descr "{place.part.description}, {place.part.maker} {place.part.part_number}")',
            f'  (path "/{identity(place.reference)}") (solder_paste_margin {-PASTE_SHRINK_MM:g}) (attr smd)',
            f'  (fp_text reference "{place.reference}" (at 0 0) (layer "{letter}.SilkS") {text})',
            f'  (fp_text value "{value_text(place.part)}" (at 0 0) (layer "{letter}.Fab") {text})',
            *pads,
            " )",
        ]
    )


def _pad(pad: Pad, place: Placement, nets: dict[str, int]) -> str:
    letter, centre = SIDES[pad.side], place.centre_mm
    # KiCad's y points down, so a turn to the left on the screen has a negative angle in its frame
    x, y = rotated((pad.centre[0] - centre[0], centre[1] - pad.centre[1]), place.rotation_deg)
    return (
        f'  (pad "{pad.pin}" smd rect (at {x:.6f} {y:.6f} {pad.turn_deg % 360.0:.6f}) '
        f'(size {pad.width:g} {pad.height:g}) (layers "{letter}.Cu" "{letter}.Paste" "{letter}.Mask") '
        f'(net {nets[pad.net]} "{pad.net}"))'
    )


def _plane(plane: BaseGeometry, net: int) -> str:
    """The ground plane as a zone; each filled piece is one outline, as KiCad separates pieces that only touch."""
    turn = [math.radians(a) for a in range(0, 360, 2)]
    edge = [(BOARD_OUTER_RADIUS_MM * math.cos(a), BOARD_OUTER_RADIUS_MM * math.sin(a)) for a in turn]
    fills = "\n".join(f'  (filled_polygon (layer "B.Cu") {_points(keyholed(piece))})' for piece in polygons(plane))
    return (
        f' (zone (net {net}) (net_name "GND") (layer "B.Cu") (hatch edge 0.5)\n'
        f"  (connect_pads (clearance {PLANE_GAP_MM:g})) (min_thickness 0.2) (filled_areas_thickness no)\n"
        f"  (fill yes (thermal_gap {PLANE_GAP_MM:g}) (thermal_bridge_width 0.5))\n"
        f"  (polygon {_points(edge)})\n{fills}\n )"
    )


def keyholed(polygon: Polygon) -> list[tuple[float, float]]:
    """One outline round a polygon and its holes, each joined to the outline by a slit of zero width.

    The holes are processed from the right; a slit runs from a hole's rightmost corner along +x to the nearest edge.
    """
    ring = [(float(x), float(y)) for x, y in polygon.exterior.coords[:-1]]
    holes = [[(float(x), float(y)) for x, y in hole.coords[:-1]] for hole in polygon.interiors]
    for hole in sorted(holes, key=max, reverse=True):
        first = hole.index(max(hole))
        x, y = hole[first]
        hits = []
        for number, ((x0, y0), (x1, y1)) in enumerate(zip(ring, [*ring[1:], ring[0]], strict=True)):
            if (y0 <= y) != (y1 <= y):  # an edge belongs to its lower end, so no corner counts twice
                hits.append((x0 + (y - y0) * (x1 - x0) / (y1 - y0), number))
        foot, number = min(hit for hit in hits if hit[0] >= x)
        turn = [*hole[first:], *hole[: first + 1]]
        ring[number + 1 : number + 1] = [(foot, y), *turn, (foot, y)]
    return ring


def _points(points: Iterable[tuple[float, ...]]) -> str:
    corners = list(points)
    if corners[0] == corners[-1]:
        corners.pop()
    return f"(pts {' '.join(f'(xy {_at(point)})' for point in corners)})"


def read_board(path: Path) -> tuple[dict[str, BaseGeometry], dict[tuple[str, str], str]]:
    """Read a board by gerbonara.

    Args:
        path: of the ``.kicad_pcb``.

    Returns:
        Copper area by layer, and the net of each pin, as in the file.

    Raises:
        FileError: the file cannot be read.
    """
    with readable(path, "board"):
        return _areas_and_pins(Board.open(path))


@contextmanager
def readable(path: Path, what: str) -> Iterator[None]:
    """Turn any error of the reader of KiCad's files, which damaged files cause, into a FileError of one line.

    Args:
        path: of the file.
        what: kind of file, for example ``board``.

    Raises:
        FileError: the file cannot be read.
    """
    try:
        yield
    except Exception as error:
        words = f"{type(error).__name__} {error}".strip()
        raise FileError(f"{path.name}: cannot be read as a KiCad {what} ({words}): make the ring again") from error


def _areas_and_pins(board: Board) -> tuple[dict[str, BaseGeometry], dict[tuple[str, str], str]]:
    """Copper area by layer, and the net of every pin, of a board."""
    shapes: dict[str, list[BaseGeometry]] = {"F.Cu": [], "B.Cu": []}
    pins = {}
    for footprint in board.footprints:
        reference = next(text.text for text in footprint.texts if text.type == "reference")
        for pad in footprint.pads:
            layer = next(name for name in shapes if name in pad.layers)
            x, y = rotated((pad.at.x, pad.at.y), -(footprint.at.rotation or 0.0))
            place = (footprint.at.x + x - ORIGIN_MM, ORIGIN_MM - footprint.at.y - y)
            turn = pad.at.rotation or 0.0
            land = Pad(reference, pad.number, pad.net.name, "", place, pad.size.x, pad.size.y, turn)
            shapes[layer].append(land.shape)
            pins[reference, pad.number] = pad.net.name
    for track in board.track_segments:
        line = [(p.x - ORIGIN_MM, ORIGIN_MM - p.y) for p in (track.start, track.end)]
        shapes[track.layer].append(LineString(line).buffer(track.width / 2, quad_segs=CIRCLE_SEGMENTS))
    for via in board.vias:
        disc = Point(via.at.x - ORIGIN_MM, ORIGIN_MM - via.at.y).buffer(via.size / 2, quad_segs=CIRCLE_SEGMENTS)
        for through in shapes.values():
            through.append(disc)
    for zone in board.zones:
        for piece in zone.fill_polygons:
            ring = Polygon([(p.x - ORIGIN_MM, ORIGIN_MM - p.y) for p in piece.pts])
            shapes[piece.layer].append(ring.buffer(zone.min_thickness / 2 if zone.filled_areas_thickness else 0.0))
    return {name: unary_union(found) for name, found in shapes.items()}, pins


def kicad_checks(path: Path, layers: dict[str, BaseGeometry], led_count: int) -> list[Check]:
    """Check that the board as read equals that of the Gerber files, and that its pins are in the nets of the circuit.

    Args:
        path: of the ``.kicad_pcb``.
        layers: areas of the Gerber files, as read.
        led_count: LEDs in the string.
    """
    areas, pins = read_board(path)
    wanted = {pin: name for name, all_pins in netlist(led_count).items() for pin in all_pins}
    wrong = sum(pins.get(pin) != name for pin, name in wanted.items()) + len(set(pins) - set(wanted))
    found = [
        Check(
            f"ring.kicad_{name[0].lower()}_copper_difference_mm2",
            float(area.symmetric_difference(layers[name.replace(".", "_")]).area),
            high=AREA_MM2,
        )
        for name, area in areas.items()
    ]
    return [*found, Check("ring.kicad_wrong_pins", float(wrong), high=0)]
