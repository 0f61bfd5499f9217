"""Copper of the LED ring: pads, tracks, vias and the ground plane, as polygons in the board plane.

Millimetres, endcap x and y seen from the dome. Two layers: parts and tracks on top; the bottom is a ground plane that
leaves out the plug's supply. Tracks are drawn in unrolled coordinates (:mod:`cad.led_ring.placement`), radius up, and
mapped onto the board.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from shapely import LineString, Point, Polygon, unary_union
from shapely.geometry.base import BaseGeometry

from cad.led_ring.board import BOARD_INNER_RADIUS_MM, BOARD_OUTER_RADIUS_MM
from cad.led_ring.parts import led_part
from cad.led_ring.placement import LED_COUNT, MIDDLE_RADIUS_MM, Placement, placements, unrolled
from fab.led_ring.circuit import netlist
from fab.led_ring.lands import lands_of

VIA_PAD_MM = 0.7
VIA_DRILL_MM = 0.3
PLANE_GAP_MM = 0.3  # plane to other copper
PLANE_EDGE_MM = 0.4  # plane to the board's edge
SPOKE_MM = 0.5  # thermal relief of ground pads in the plane
STEP_DEG = 0.5  # chord of a bent track: 0.3 um off its circle
CIRCLE_SEGMENTS = 16  # of a quarter
_CHIPS = ("C1", "C2", "C3", "R1")  # packages of which the table may choose


@dataclass(frozen=True)
class Pad:
    """A land: centre, size and turn on the board (degrees counter-clockwise, seen from the dome)."""

    reference: str
    pin: str
    net: str
    side: str
    centre: tuple[float, float]
    width: float
    height: float
    turn_deg: float

    @property
    def shape(self) -> Polygon:
        """Area of the land."""
        angle = math.radians(self.turn_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        half = [(sx * self.width / 2, sy * self.height / 2) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return Polygon([(self.centre[0] + x * cos - y * sin, self.centre[1] + x * sin + y * cos) for x, y in half])


@dataclass(frozen=True)
class Track:
    """A track with round ends along board points."""

    net: str
    side: str
    points: tuple[tuple[float, float], ...]
    width: float

    @property
    def shape(self) -> BaseGeometry:
        """Area of the track."""
        return LineString(self.points).buffer(self.width / 2, quad_segs=CIRCLE_SEGMENTS)


@dataclass(frozen=True)
class Via:
    """A plated hole with a round pad on both sides."""

    net: str
    centre: tuple[float, float]

    @property
    def shape(self) -> BaseGeometry:
        """Area of the pad."""
        return Point(self.centre).buffer(VIA_PAD_MM / 2, quad_segs=CIRCLE_SEGMENTS)


@dataclass(frozen=True)
class Copper:
    """All copper of the board.

    Attributes:
        pads: lands of the parts.
        tracks: of the top.
        vias: plated holes.
        plane: ground plane on the bottom.
    """

    pads: tuple[Pad, ...]
    tracks: tuple[Track, ...]
    vias: tuple[Via, ...]
    plane: BaseGeometry


def build_copper(led_count: int = LED_COUNT) -> Copper:
    """All copper of a ring.

    Args:
        led_count: LEDs in the string.

    Raises:
        ParameterError: LED count outside the range of the board, or a part in a package without a land.
    """
    nets = {pin: name for name, pins in netlist(led_count).items() for pin in pins}
    pads = tuple(pad for place in placements(led_count) for pad in _pads(place, nets))
    tracks, vias = driver_tracks(led_count) + string_tracks(led_count), driver_vias()
    plane = _plane(pads, tracks, vias)
    grounds = [pad for pad in pads if pad.side == "bottom" and pad.net == "GND"]
    spokes = tuple(spoke for pad in grounds for spoke in _spokes(pad, plane))
    return Copper(pads, tracks + spokes, vias, plane)


def polygons(shape: BaseGeometry) -> list[Polygon]:
    """The polygons of a shape that are not empty, without lines and points.

    Args:
        shape: any geometry.
    """
    return [part for part in getattr(shape, "geoms", [shape]) if isinstance(part, Polygon) and not part.is_empty]


def _pads(place: Placement, nets: dict[tuple[str, str], str]) -> list[Pad]:
    made = []
    for pin, (x, y, width, height) in lands_of(place.part).items():
        net = nets[(place.reference, pin)]
        at = place.on_board(x, y)
        made.append(Pad(place.reference, pin, net, place.side, at, width, height, place.rotation_deg))
    return made


def _chip_lands() -> dict[str, tuple[float, float]]:
    """Unrolled centre of each land of the chips, by reference and pin (``C1.2``), where tracks end in any package."""
    chips = [place for place in placements() if place.reference in _CHIPS]  # none of them turned
    return {
        f"{place.reference}.{pin}": (place.s_mm + x, place.t_mm + y)
        for place in chips
        for pin, (x, y, *_) in lands_of(place.part).items()
    }


def driver_tracks(led_count: int) -> tuple[Track, ...]:
    """Tracks of the boost converter and to both ends of the string, in unrolled coordinates (s clockwise, t outward).

    Args:
        led_count: LEDs in the string.
    """
    leds = [place.s_mm for place in placements(led_count) if place.kind == "led"]
    led = lands_of(led_part("led"))
    turn = 2 * math.pi * MIDDLE_RADIUS_MM
    first, last = leds[0] + led["A"][0], leds[-1] % turn + led["K"][0]
    at = _chip_lands()
    sense, ground = at["R1.1"][0], at["C2.2"][0]
    top = [
        ("VIN", 1.0, [(-3.2, 1.5), (-0.95, 1.9), at["C1.1"]]),
        ("VIN", 0.6, [(-1.4, 1.5), (-0.24, 0.45), (-0.24, -0.5)]),
        ("SW", 1.0, [(-5.95, -1.5), (-3.2, -1.5)]),
        ("SW", 0.6, [(-3.2, -1.5), (-0.24, -1.45)]),
        ("VOUT", 1.0, [(-9.25, -1.5), (-9.25, 0.0), at["C2.1"]]),
        ("VOUT", 0.6, [(-9.25, 0.0), (first, 0.0)]),
        ("COMP", 0.3, [(2.04, -0.5), at["C3.1"]]),
        ("FB", 0.3, [(2.04, 0.45), (3.2, 0.45), (3.8, 1.25), at["R1.1"]]),
        ("FB", 0.4, [at["R1.1"], (sense, 2.3), (9.6, 2.3), (10.6, 0.9), (11.0, 0.0), (last, 0.0)]),
        ("GND", 0.6, [at["C2.2"], (ground, 2.75)]),
        ("GND", 0.6, [at["C2.2"], (ground, 0.1)]),
        ("GND", 0.5, [(2.04, -1.45), (2.04, -2.5)]),
        ("GND", 0.5, [(2.04, -2.5), (1.0, -2.6)]),
        ("GND", 0.5, [at["C1.2"], (3.1, 1.75)]),
        ("GND", 0.4, [at["C3.2"], at["R1.2"]]),
        ("GND", 0.4, [at["C3.2"], (7.7, 0.4)]),
    ]
    # past contact 2 of the plug to contact 1
    bottom = [("VIN", 0.5, [(-1.0, 2.55), (0.0, 2.75), (5.9, 2.75), (6.6, 1.9), (6.6, 1.3)])]
    return tuple(
        Track(net, side, _bent(points), width)
        for side, tracks in (("top", top), ("bottom", bottom))
        for net, width, points in tracks
    )


def driver_vias() -> tuple[Via, ...]:
    """Vias of the boost converter; the output capacitor and the switch have two to the ground plane."""
    ground = _chip_lands()["C2.2"][0]
    places = [
        ("VIN", (-1.0, 2.55)),
        ("GND", (ground, 2.75)),
        ("GND", (ground, 0.1)),
        ("GND", (2.04, -2.5)),
        ("GND", (1.0, -2.6)),
        ("GND", (3.1, 1.75)),
        ("GND", (7.7, 0.4)),
    ]
    return tuple(Via(net, unrolled(*place)) for net, place in places)


def string_tracks(led_count: int) -> tuple[Track, ...]:
    """Tracks from each LED's cathode to the anode of the next, along the middle circle.

    Args:
        led_count: LEDs in the string.
    """
    leds = [place for place in placements(led_count) if place.kind == "led"]
    led, tracks = lands_of(led_part("led")), []
    for k, (here, there) in enumerate(pairwise(leds)):
        start, end = here.s_mm + led["K"][0], there.s_mm + led["A"][0]
        turn = 2 * math.pi * MIDDLE_RADIUS_MM
        end -= turn * math.ceil((end - start) / turn)  # onward, counter-clockwise
        tracks.append(Track(f"N{k + 1}", "top", _bent([(start, 0.0), (end, 0.0)]), 1.0))
    return tuple(tracks)


def _bent(points: list[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Board points of an unrolled line, in steps that follow the circle."""
    bent = [unrolled(*points[0])]
    for (s0, t0), (s1, t1) in pairwise(points):
        count = max(1, math.ceil(abs(math.degrees((s1 - s0) / MIDDLE_RADIUS_MM)) / STEP_DEG))
        bent += [unrolled(s0 + (s1 - s0) * i / count, t0 + (t1 - t0) * i / count) for i in range(1, count + 1)]
    return tuple(bent)


def _spokes(pad: Pad, plane: BaseGeometry) -> list[Track]:
    """Thermal relief of a ground pad: bridges to the plane on the sides where there is plane.

    With it the pad can be soldered by hand.
    """
    spokes = []
    for quarter in range(4):
        angle = math.radians(pad.turn_deg + 90.0 * quarter)
        reach = (pad.height if quarter % 2 else pad.width) / 2 + PLANE_GAP_MM + SPOKE_MM / 2
        end = (pad.centre[0] + reach * math.cos(angle), pad.centre[1] + reach * math.sin(angle))
        if plane.contains(Point(end).buffer(SPOKE_MM / 2)):
            spokes.append(Track(pad.net, pad.side, (pad.centre, end), SPOKE_MM))
    return spokes


def _plane(pads: tuple[Pad, ...], tracks: tuple[Track, ...], vias: tuple[Via, ...]) -> BaseGeometry:
    """Ground plane: the bottom less its edge and less the surroundings of other nets and of soldered pads."""
    face = _ring(BOARD_INNER_RADIUS_MM + PLANE_EDGE_MM, BOARD_OUTER_RADIUS_MM - PLANE_EDGE_MM)
    others = [p.shape for p in pads if p.side == "bottom"]
    others += [t.shape for t in tracks if t.side == "bottom" and t.net != "GND"]
    others += [v.shape for v in vias if v.net != "GND"]
    plane = face - unary_union(others).buffer(PLANE_GAP_MM, quad_segs=CIRCLE_SEGMENTS)
    return plane.buffer(-0.1).buffer(0.1)  # no necks under 0.2 mm


def _ring(inner: float, outer: float) -> Polygon:
    """Annulus; its circles are polygons of 720 corners (1 um)."""
    turn = [math.radians(a / 2) for a in range(720)]
    rings = [[(r * math.cos(a), r * math.sin(a)) for a in turn] for r in (outer, inner)]
    return Polygon(rings[0], [rings[1]])
