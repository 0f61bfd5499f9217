"""Where the LED ring's parts sit on its board (standard library only).

Board plane = endcap x, y in millimetres, seen from the dome (+z), where the LEDs are. A place is given *unrolled*:
``s`` along the middle circle from the driver's azimuth, positive clockwise, and ``t`` outward from that circle; so the
driver can be drawn as on a straight board, radius up. A part is rigid and turned to its own azimuth.

The driver takes the gap between two LEDs; the string starts on its counter-clockwise side, runs once round the board
and ends on the other side, so no track crosses another. Beside the notch of the spacer the plug hangs underneath.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cad.errors import ParameterError
from cad.led_parts import LedPart, led_part

MIDDLE_RADIUS_MM = 35.0  # E: middle of the board
DRIVER_AZIMUTH_DEG = 100.0  # beside the plug; between the LEDs at 80 and 120 degrees
PLUG_AZIMUTH_DEG = 90.0  # of the spacer's notch
PLUG_RADIUS_MM = 34.375  # its pads lie inside the spacer's notch and 0.3 mm inside the board's edge
LED_COUNT = 9  # P, LED05, LED06: 25 V / 2.8 V
# More leave no gap for the driver. Fewer were not designed: with five the current in the boost inductor is on the edge
# of stopping at the nominal values (fab.led_ring.driver), with four it stops.
LED_RANGE = (6, 9)

Point = tuple[float, float]


@dataclass(frozen=True)
class Placement:
    """One part on the board.

    Attributes:
        reference: for example ``LED3``.
        kind: row of led_parts.csv.
        s_mm, t_mm: unrolled place of its centre.
        turn_deg: counter-clockwise turn of the part in the unrolled drawing, seen from the dome.
        side: ``top`` (LEDs) or ``bottom``; a part on the bottom is mirrored in its own x first.
    """

    reference: str
    kind: str
    s_mm: float
    t_mm: float
    turn_deg: float = 0.0
    side: str = "top"

    @property
    def part(self) -> LedPart:
        """Its row of the table."""
        return led_part(self.kind)

    @property
    def centre_mm(self) -> Point:
        """Centre (x, y)."""
        return unrolled(self.s_mm, self.t_mm)

    @property
    def rotation_deg(self) -> float:
        """Turn on the board, counter-clockwise seen from the dome, 0..360."""
        return (self.turn_deg + azimuth_deg(self.s_mm) - 90.0) % 360.0

    def on_board(self, x_mm: float, y_mm: float) -> Point:
        """A point of the part's own drawing, on the board."""
        if self.side == "bottom":
            x_mm = -x_mm
        angle = math.radians(self.rotation_deg)
        cx, cy = self.centre_mm
        return (
            cx + x_mm * math.cos(angle) - y_mm * math.sin(angle),
            cy + x_mm * math.sin(angle) + y_mm * math.cos(angle),
        )


def azimuth_deg(s_mm: float) -> float:
    """Azimuth of an unrolled place."""
    return DRIVER_AZIMUTH_DEG - math.degrees(s_mm / MIDDLE_RADIUS_MM)


def along_mm(azimuth: float) -> float:
    """Unrolled place of an azimuth in degrees."""
    return math.radians(DRIVER_AZIMUTH_DEG - azimuth) * MIDDLE_RADIUS_MM


def unrolled(s_mm: float, t_mm: float) -> Point:
    """Board point (x, y) of an unrolled place."""
    angle, radius = math.radians(azimuth_deg(s_mm)), MIDDLE_RADIUS_MM + t_mm
    return (radius * math.cos(angle), radius * math.sin(angle))


def led_azimuths_deg(led_count: float = LED_COUNT) -> tuple[float, ...]:
    """Azimuths of the LEDs in the order of the string.

    Raises:
        ParameterError: more than fit beside the driver, or too few.
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
    """Every part of the board.

    Raises:
        ParameterError: LED count, see :func:`led_azimuths_deg`.
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
