"""Placement of the LED ring's parts on its board (standard library only).

Board plane = endcap x, y in millimetres, seen from the dome (+z), where the LEDs are. Placements are given in
*unrolled* coordinates: ``s`` along the middle circle from the driver's azimuth, positive clockwise, and ``t`` outward
from that circle. The driver can thus be drawn as on a straight board, with the radius pointing up. A part is rigid and
turned to the azimuth of its centre.

The driver occupies the gap between two LEDs; the string starts on its counter-clockwise side, runs once round the board
and ends on the other side, so that no tracks cross. The plug is on the bottom, in the notch of the spacer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cad.errors import ParameterError
from cad.led_ring.parts import LedPart, led_part

MIDDLE_RADIUS_MM = 35.0  # E: middle of the board
DRIVER_AZIMUTH_DEG = 100.0  # next to the plug; between the LEDs at 80 and 120 degrees
PLUG_AZIMUTH_DEG = 90.0  # of the spacer's notch
PLUG_RADIUS_MM = 34.375  # its pads lie inside the spacer's notch and 0.3 mm inside the board's edge
LED_COUNT = 9  # P, LED05, LED06: 25 V / 2.8 V
# More LEDs leave no gap for the driver. Fewer were not designed: with five, the boost inductor's current is on the edge
# of discontinuous conduction at the nominal values (fab.led_ring.driver); with four it is discontinuous.
LED_RANGE = (6, 9)

Point = tuple[float, float]


@dataclass(frozen=True)
class Placement:
    """One part on the board.

    Attributes:
        reference: reference designator, for example ``LED3``.
        kind: row of led_parts.csv.
        s_mm: unrolled coordinate s of its centre, mm.
        t_mm: unrolled coordinate t of its centre, mm.
        turn_deg: counter-clockwise turn of the part in the unrolled drawing, seen from the dome, degrees.
        side: ``top`` (LEDs) or ``bottom``; a part on the bottom is first mirrored in its own x.
    """

    reference: str
    kind: str
    s_mm: float
    t_mm: float
    turn_deg: float = 0.0
    side: str = "top"

    @property
    def part(self) -> LedPart:
        """The part's row of the table."""
        return led_part(self.kind)

    @property
    def centre_mm(self) -> Point:
        """Centre (x, y), mm in the endcap frame."""
        return unrolled(self.s_mm, self.t_mm)

    @property
    def rotation_deg(self) -> float:
        """Turn on the board, counter-clockwise seen from the dome, degrees in 0..360."""
        return (self.turn_deg + azimuth_deg(self.s_mm) - 90.0) % 360.0

    def on_board(self, x_mm: float, y_mm: float) -> Point:
        """Board point (x, y), mm, of a point of the part's own drawing."""
        if self.side == "bottom":
            x_mm = -x_mm
        angle = math.radians(self.rotation_deg)
        cx, cy = self.centre_mm
        return (
            cx + x_mm * math.cos(angle) - y_mm * math.sin(angle),
            cy + x_mm * math.sin(angle) + y_mm * math.cos(angle),
        )


def azimuth_deg(s_mm: float) -> float:
    """Azimuth of an unrolled coordinate s, degrees."""
    return DRIVER_AZIMUTH_DEG - math.degrees(s_mm / MIDDLE_RADIUS_MM)


def along_mm(azimuth: float) -> float:
    """Unrolled coordinate s, mm, of an azimuth in degrees."""
    return math.radians(DRIVER_AZIMUTH_DEG - azimuth) * MIDDLE_RADIUS_MM


def unrolled(s_mm: float, t_mm: float) -> Point:
    """Board point (x, y), mm, of unrolled coordinates (s, t)."""
    angle, radius = math.radians(azimuth_deg(s_mm)), MIDDLE_RADIUS_MM + t_mm
    return (radius * math.cos(angle), radius * math.sin(angle))


def led_azimuths_deg(led_count: float = LED_COUNT) -> tuple[float, ...]:
    """Azimuths of the LEDs in the order of the string.

    Raises:
        ParameterError: the count lies outside :data:`LED_RANGE`.
    """
    low, high = LED_RANGE
    if not low <= led_count <= high or led_count != int(led_count):
        raise ParameterError(
            f"leds={led_count:g} outside {low}..{high}: with more the driver has no gap between two LEDs, for fewer "
            "board and driver are not designed",
            name="leds",
            value=led_count,
        )
    step = 360.0 / led_count
    return tuple((DRIVER_AZIMUTH_DEG + (k + 0.5) * step) % 360.0 for k in range(int(led_count)))


def placements(led_count: float = LED_COUNT) -> tuple[Placement, ...]:
    """Placements of all parts of the board.

    Raises:
        ParameterError: the LED count is refused (:func:`led_azimuths_deg`).
    """
    leds = [Placement(f"LED{k + 1}", "led", along_mm(a), 0.0) for k, a in enumerate(led_azimuths_deg(led_count))]
    return (
        Placement("U1", "driver", 0.9, -0.5),
        Placement("L1", "inductor", -3.2, 0.0, turn_deg=90.0),
        Placement("D1", "diode", -7.6, -1.5),
        Placement("C2", "c_out", -7.6, 1.5),
        Placement("C1", "c_in", 0.9, 2.2),
        Placement("C3", "c_comp", 5.0, -0.5),
        Placement("R1", "r_set", 5.0, 1.25),
        Placement("J1", "plug", along_mm(PLUG_AZIMUTH_DEG), PLUG_RADIUS_MM - MIDDLE_RADIUS_MM, side="bottom"),
        *leds,
    )
