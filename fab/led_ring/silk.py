"""Legend of the LED ring: names of the parts, polarity, plug pins, clear of every solderable area. Millimetres."""

from __future__ import annotations

import math

import numpy as np
from shapely import LineString, Polygon, unary_union
from shapely.affinity import rotate, scale, translate
from shapely.geometry.base import BaseGeometry

from cad.led_ring.placement import along_mm, azimuth_deg, unrolled
from fab.led_ring.copper import Copper

TEXT_MM = 0.9  # height of a capital
LINE_MM = 0.15
PAD_GAP_MM = 0.15  # between ink and solder
# text, s, t (unrolled), side
WORDS = (
    ("U1", -0.1, -2.7, "top"),
    ("L1", -3.2, 2.8, "top"),
    ("D1", -7.6, -2.8, "top"),
    ("C2", -7.9, 2.95, "top"),
    ("C1", 3.2, 2.95, "top"),
    ("C3", 5.0, -1.75, "top"),
    ("R1", 7.4, 1.3, "top"),
    ("J1", 10.0, -0.6, "bottom"),
    ("5V", 7.0, 2.9, "bottom"),
    ("GND", 4.3, 2.9, "bottom"),
)


def silk_shape(copper: Copper, side: str) -> BaseGeometry:
    """Area of the ink on one side: words, a bar at each cathode, a dot at pin 1.

    Args:
        copper: of the board.
        side: ``top`` or ``bottom``.
    """
    shapes = [word(text, s, t, side) for text, s, t, where in WORDS if where == side]
    for pad in copper.pads:
        if pad.side != side:
            continue
        if pad.pin == "K":
            shapes.append(_bar(pad.centre, pad.width, pad.height, pad.turn_deg))
        if pad.reference == "U1" and pad.pin == "1":
            angle = math.radians(pad.turn_deg)
            at = np.array(pad.centre) + 0.75 * np.array([-math.sin(angle), math.cos(angle)])
            shapes.append(LineString([at, at + 1e-3]).buffer(0.2))
        if pad.reference.startswith("LED") and pad.pin == "A":
            azimuth = math.degrees(math.atan2(pad.centre[1], pad.centre[0]))
            shapes.append(word(pad.reference.replace("LED", ""), along_mm(azimuth) - 1.1, 2.3, side))
    lands = unary_union([pad.shape for pad in copper.pads if pad.side == side])
    holes = unary_union([via.shape for via in copper.vias])
    return unary_union(shapes) - lands.buffer(PAD_GAP_MM) - holes


def word(text: str, s_mm: float, t_mm: float, side: str) -> BaseGeometry:
    """A word's filled letters, readable with the radius up.

    Args:
        text: the word.
        s_mm: unrolled position of its centre along the circle.
        t_mm: unrolled position of its centre along the radius.
        side: ``top`` or ``bottom`` (mirrored).
    """
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    outlines = TextPath((0, 0), text, size=10, prop=FontProperties(family="DejaVu Sans", weight="bold"))
    shape: BaseGeometry = Polygon()
    for ring in map(np.asarray, outlines.to_polygons()):
        if len(ring) > 3:
            shape = shape.symmetric_difference(Polygon(ring).buffer(0))
    factor = TEXT_MM / 7.29  # DejaVu's capitals are 0.729 of the size
    left, low, right, high = shape.bounds
    shape = translate(shape, -(left + right) / 2, -(low + high) / 2)
    shape = scale(shape, -factor if side == "bottom" else factor, factor, origin=(0, 0))
    shape = rotate(shape, azimuth_deg(s_mm) - 90.0, origin=(0, 0))
    return translate(shape, *unrolled(s_mm, t_mm))


def _bar(centre: tuple[float, float], width: float, height: float, turn_deg: float) -> BaseGeometry:
    """A line beside a cathode's far edge."""
    x = -(width / 2 + PAD_GAP_MM + LINE_MM)
    line = LineString([(x, -height / 2), (x, height / 2)]).buffer(LINE_MM / 2)
    return translate(rotate(line, turn_deg, origin=(0, 0)), *centre)
