"""The LED ring board as a bought body: annular circuit board, LEDs on top, plug underneath.

Endcap frame, millimetres; keeps its size at every diameter. The paper gives the parts (boost driver, JB3030AWT LEDs
of about 2.8 V in one string at a nominal 25 V, hence nine of them; facts.md), not the outline: the outline is sized to
fit spacer and bore (E). Everything lies below the camera's 180 degree plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cad import ring_spacer
from cad.part import Part

if TYPE_CHECKING:
    from cad.params import EndcapParams

LED_COUNT = 9  # P: 25 V / 2.8 V
LED_WIDTH_MM = 3.0  # S: package 3030
LED_HEIGHT_MM = 0.55  # S
LED_CIRCLE_RADIUS_MM = 35.0  # E: middle of the board
BOARD_OUTER_RADIUS_MM = 38.6  # E: inside the spacer's edge
BOARD_INNER_RADIUS_MM = ring_spacer.LIP_RADIUS_MM + 0.15  # E
BOARD_THICKNESS_MM = 1.6  # S: usual circuit board
PLUG_MM = (4.5, 7.5, 4.2)  # E: radial, tangential, height; two-pin plug hanging in the spacer's notch
PLUG_RADIUS_MM = 34.2  # E


def led_ring_part(params: EndcapParams) -> Part:
    """Build the LED ring's envelope (the same at every size)."""
    from build123d import Box, Cylinder, Pos, Rot

    from cad.solids import one_solid

    seat, top = ring_spacer.SEAT_Z_MM, ring_spacer.SEAT_Z_MM + BOARD_THICKNESS_MM
    disc, hole = (Cylinder(radius, BOARD_THICKNESS_MM) for radius in (BOARD_OUTER_RADIUS_MM, BOARD_INNER_RADIUS_MM))
    board = Pos(0, 0, (seat + top) / 2) * (disc - hole)
    led = Pos(LED_CIRCLE_RADIUS_MM, 0, top + LED_HEIGHT_MM / 2) * Box(LED_WIDTH_MM, LED_WIDTH_MM, LED_HEIGHT_MM)
    leds = [Rot(0, 0, 360.0 / LED_COUNT * k) * led for k in range(LED_COUNT)]
    plug = Rot(0, 0, ring_spacer.NOTCH_AZIMUTH_DEG) * Pos(PLUG_RADIUS_MM, 0, seat - PLUG_MM[2] / 2) * Box(*PLUG_MM)
    solid = one_solid(board.fuse(*leds, plug), "led_ring")
    return Part("led_ring", "bought", "circuit board", solid, (0.05, 0.42, 0.24))
