"""The ring spacer: a printed ring in the base's recess that raises the LED ring above the TPU flange.

Endcap frame, millimetres; its size is the same at every diameter. It stands on the recess's floor and is fixed with two
drops of glue. It is printed in this pose: only the 11 degree cone on its underside, 0.7 mm high, overhangs. All sizes
are our estimate (E) except the recess's (M, GEO17, GEO18).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cad import base
from cad.part import Part

if TYPE_CHECKING:
    from cad.params import EndcapParams

CLEARANCE_MM = 0.15  # E: on each side of the printed joint
OUTER_RADIUS_MM = base.RECESS_RADIUS_MM - CLEARANCE_MM
INNER_RADIUS_MM = 30.0  # clears the camera's board (corners at 22.5) and its view
SEAT_Z_MM = 5.4  # back of the LED ring's board: its LEDs lie above the 6 mm TPU flange
LIP_RADIUS_MM = 31.4  # the lip centres the board
LIP_HEIGHT_MM = 1.4  # less than the board's 1.6, so that the lip casts no shadow
NOTCH_WIDTH_MM = 9.0  # for the plug under the board, at azimuth 90 degrees; also keeps the board from turning
NOTCH_OUTER_RADIUS_MM = 37.0  # outer end of the notch
NOTCH_FLOOR_Z_MM = 0.8  # floor of the notch
NOTCH_AZIMUTH_DEG = 90.0  # on the side of a cable hole
COLOR = (0.96, 0.84, 0.36)  # RGB, 0..1


def ring_spacer_part(params: EndcapParams) -> Part:
    """Build the ring spacer (the same at every size)."""
    from build123d import Axis, Box, Face, Pos, Rot, Wire, revolve

    from cad.solids import one_solid

    profile = [
        (INNER_RADIUS_MM, 0, -base.RECESS_DEPTH_MM),
        (base.RECESS_FLOOR_RADIUS_MM - CLEARANCE_MM, 0, -base.RECESS_DEPTH_MM),
        (OUTER_RADIUS_MM, 0, -base.RECESS_EDGE_DEPTH_MM),
        (OUTER_RADIUS_MM, 0, SEAT_Z_MM),
        (LIP_RADIUS_MM, 0, SEAT_Z_MM),
        (LIP_RADIUS_MM, 0, SEAT_Z_MM + LIP_HEIGHT_MM),
        (INNER_RADIUS_MM, 0, SEAT_Z_MM + LIP_HEIGHT_MM),
    ]
    ring = revolve(Face(Wire.make_polygon(profile)), Axis.Z)
    low_x, top_z = INNER_RADIUS_MM - 5.0, SEAT_Z_MM + LIP_HEIGHT_MM + 1.0
    notch = Rot(0, 0, NOTCH_AZIMUTH_DEG) * (
        Pos((low_x + NOTCH_OUTER_RADIUS_MM) / 2, 0, (NOTCH_FLOOR_Z_MM + top_z) / 2)
        * Box(NOTCH_OUTER_RADIUS_MM - low_x, NOTCH_WIDTH_MM, top_z - NOTCH_FLOOR_Z_MM)
    )
    return Part("ring_spacer", "printed", "PETG", one_solid(ring - notch, "ring_spacer"), COLOR)
