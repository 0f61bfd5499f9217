"""Envelope of the bought LED ring: an annular circuit board with the envelopes of its parts, the plug on the bottom.

Endcap frame, millimetres; its size is the same at every diameter. The paper gives the parts (boost driver, JB3030AWT
LEDs of about 2.8 V in one string at a nominal 25 V, hence nine of them; P, LED05, LED06), but not the outline, which we
sized to fit spacer and bore (E). The whole ring lies below the camera's 180 degree plane. Placements come from
:mod:`cad.led_ring.placement`, sizes from led_parts.csv; ``python -m fab.led_ring`` makes copper and drill files.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cad import ring_spacer
from cad.led_ring.placement import LED_COUNT, Placement, placements
from cad.part import Part

if TYPE_CHECKING:
    from build123d import Solid

    from cad.params import EndcapParams

BOARD_OUTER_RADIUS_MM = 38.6  # E: inside the spacer's edge
BOARD_INNER_RADIUS_MM = ring_spacer.LIP_RADIUS_MM + 0.15  # E: play round the spacer's lip
BOARD_THICKNESS_MM = 1.6  # S: usual circuit board
COLOR = (0.05, 0.42, 0.24)  # RGB, 0..1


def led_ring_part(params: EndcapParams) -> Part:
    """Build the LED ring's envelope (the same at every size)."""
    from build123d import Cylinder, Pos

    from cad.solids import one_solid

    seat, top = ring_spacer.SEAT_Z_MM, ring_spacer.SEAT_Z_MM + BOARD_THICKNESS_MM
    disc, hole = (Cylinder(radius, BOARD_THICKNESS_MM) for radius in (BOARD_OUTER_RADIUS_MM, BOARD_INNER_RADIUS_MM))
    board = Pos(0, 0, (seat + top) / 2) * (disc - hole)
    bodies = [_body(place) for place in placements(LED_COUNT)]
    solid = one_solid(board.fuse(*bodies), "led_ring")
    return Part("led_ring", "bought", "circuit board", solid, COLOR)


def _body(place: Placement) -> Solid:
    """Envelope of one part on its side of the board."""
    from build123d import Pos, Rot, Solid

    part, (x, y) = place.part, place.centre_mm
    seat = ring_spacer.SEAT_Z_MM
    bottom = seat + BOARD_THICKNESS_MM if place.side == "top" else seat - part.height_mm
    box = Solid.make_box(part.length_mm, part.width_mm, part.height_mm)
    box = Pos(-part.length_mm / 2, -part.width_mm / 2, 0) * box
    return Pos(x, y, bottom) * (Rot(0, 0, place.rotation_deg) * box)
