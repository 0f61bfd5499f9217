"""Scaling of the endcap with D: formulas for rim, sphere centre and view (standard library only).

D=130 reproduces the released sensor. Other sizes keep its shape (rim in proportion to D) as long as the LED ring, whose
size is fixed, passes the bore; smaller ones keep that rim and move the sphere's centre nearer to the mating plane.
Provenance letters are those of docs/provenance.md: P paper, M measured, S standard, E our estimate. Lengths in mm.
"""

from __future__ import annotations

import math

from cad.lens import camera_module

RELEASED_OUTER_RADIUS_MM = 65.0  # P, GEO01: half of 130 mm
RELEASED_CENTRE_HEIGHT_MM = 38.37  # M, GEO03: sphere centre above the mating plane
RELEASED_SCREW_CIRCLE_MM = 47.53  # M, GEO07: radius of the ten M3 screws
RELEASED_RIM_RADIUS_MM = math.sqrt(RELEASED_OUTER_RADIUS_MM**2 - RELEASED_CENTRE_HEIGHT_MM**2)  # 52.47
SCREW_INSET_MM = RELEASED_RIM_RADIUS_MM - RELEASED_SCREW_CIRCLE_MM  # 4.94: nut, its pocket wall, the rim

RING_ENVELOPE_RADIUS_MM = 39.0  # M, GEO17: recess that takes ring and spacer
RING_CLEARANCE_MM = 0.3  # E: so that the ring passes the bore without filing
BORE_INSET_MM = 4.5  # E: half a nut (2.8) and 1.7 of TPU ledge inside it, so that the nut cannot tip inward
MIN_RIM_RADIUS_MM = RING_ENVELOPE_RADIUS_MM + RING_CLEARANCE_MM + BORE_INSET_MM + SCREW_INSET_MM  # 48.74

CAMERA_SEAT_Z_MM = -1.0  # M: back of the camera's board, on the base's four corner posts
FLANGE_THICKNESS_MM = 6.0  # E: 2.2 TPU under the nut, 2.0 nut pocket, 1.8 roof
INTERLOCK_DEPTH_MM = 25.0  # P, GEO25: of the gyroid zone in the silicone


def rim_radius_mm(diameter_mm: float) -> float:
    """Radius of the rim of the outer sphere, mm: in proportion to D (as released), at least what the ring needs."""
    return max(RELEASED_RIM_RADIUS_MM / RELEASED_OUTER_RADIUS_MM * diameter_mm / 2, MIN_RIM_RADIUS_MM)


def centre_height_mm(diameter_mm: float) -> float:
    """Height of the sphere's centre above the mating plane, mm; ``nan`` where the sphere is smaller than its rim."""
    square = (diameter_mm / 2) ** 2 - rim_radius_mm(diameter_mm) ** 2
    return math.sqrt(square) if square >= 0 else math.nan


def camera_height_mm() -> float:
    """Height of the entrance pupil above the mating plane, mm: seat plus the module's stack (released: -1 + 18).

    Base, camera part, renderer and calibration all use this function (docs/base.md).
    """
    return CAMERA_SEAT_Z_MM + camera_module().stack_mm


def view_rim_polar_deg(diameter_mm: float, wall_mm: float) -> float:
    """Polar angle at which the inner sphere crosses the camera's 180 degree plane, degrees."""
    cosine = (camera_height_mm() - centre_height_mm(diameter_mm)) / (diameter_mm / 2 - wall_mm)
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
