"""Envelope of the bought camera ELP-USBFHD01M: a 32 mm board with an M12 lens of 180 degrees (P, CAM01).

Endcap frame, millimetres; its size is the same at every diameter. The board's pocket and screw pitch are measured (M,
GEO15, GEO16); the heights of holder and lens are our estimate (E). The board's back lies on the base's corner posts
(``CAMERA_SEAT_Z_MM``), and the entrance pupil lies ``stack_mm`` above it (cad/cameras.csv). Only the front glass rises
above the 180 degree plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cad import base, scaling
from cad.part import Part

if TYPE_CHECKING:
    from build123d import Shape

    from cad.params import EndcapParams

BOARD_WIDTH_MM = 32.0  # E: nominal; lies on the corner posts of the 31.95 mm pocket
BOARD_THICKNESS_MM = 1.6  # S: usual circuit board
BOARD_HOLE_RADIUS_MM = 1.1  # E: M2 passes
BACK_MM = (17.0, 17.0, 3.0)  # E: x, y, z of the components soldered to the back
PLUG_MM = (9.0, 5.0, 4.5)  # E: x, y, z of the USB plug over a cable hole
HOLDER_WIDTH_MM = 16.0  # E: lens holder
HOLDER_HEIGHT_MM = 9.0  # E: above the board
BARREL_RADIUS_MM = 6.0  # S: M12
HEAD_RADIUS_MM = 8.5  # E: lens head
HEAD_HEIGHT_MM = 8.0  # E: below its rim
PUPIL_TO_HEAD_MM = 0.5  # E: pupil above the rim of the lens head, so that the head stays out of the view
GLASS_RADIUS_MM = 7.5  # E: front glass, at the rim of the lens head
GLASS_HEIGHT_MM = 2.0  # E: of its dome above that rim


def camera_part(params: EndcapParams) -> Part:
    """Build the camera's envelope (the same at every size)."""
    from build123d import Box, Cylinder, Pos

    from cad.solids import one_solid

    seat = scaling.CAMERA_SEAT_Z_MM
    front = seat + BOARD_THICKNESS_MM
    rim = params.camera_height_mm - PUPIL_TO_HEAD_MM
    offset = base.CAMERA_HOLE_OFFSET_MM
    board = Pos(0, 0, (seat + front) / 2) * Box(BOARD_WIDTH_MM, BOARD_WIDTH_MM, BOARD_THICKNESS_MM)
    hole = Cylinder(BOARD_HOLE_RADIUS_MM, BOARD_THICKNESS_MM)
    board -= [Pos(sx * offset, sy * offset, (seat + front) / 2) * hole for sx in (-1, 1) for sy in (-1, 1)]
    bodies = [
        Pos(0, 0, seat - BACK_MM[2] / 2) * Box(*BACK_MM),
        Pos(0, base.CABLE_OFFSET_MM, seat - PLUG_MM[2] / 2) * Box(*PLUG_MM),
        Pos(0, 0, front + HOLDER_HEIGHT_MM / 2) * Box(HOLDER_WIDTH_MM, HOLDER_WIDTH_MM, HOLDER_HEIGHT_MM),
        Pos(0, 0, (front + rim) / 2) * Cylinder(BARREL_RADIUS_MM, rim - front),
        Pos(0, 0, rim - HEAD_HEIGHT_MM / 2) * Cylinder(HEAD_RADIUS_MM, HEAD_HEIGHT_MM),
        _glass(rim),
    ]
    return Part("camera", "bought", "camera module", one_solid(board + bodies, "camera"), (0.10, 0.32, 0.60))


def _glass(rim_z: float) -> Shape:
    """Spherical cap of the front glass on the lens head, whose rim lies at ``rim_z``."""
    from build123d import Box, Pos, Sphere

    radius = (GLASS_RADIUS_MM**2 + GLASS_HEIGHT_MM**2) / (2 * GLASS_HEIGHT_MM)
    ball = Pos(0, 0, rim_z + GLASS_HEIGHT_MM - radius) * Sphere(radius)
    return ball & Pos(0, 0, rim_z + radius) * Box(2 * radius, 2 * radius, 2 * radius)
