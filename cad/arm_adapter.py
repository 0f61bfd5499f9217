"""The arm adapter, which joins the base's five lugs, whose circle grows with D, to a robot's flange of fixed size.

A hub with five arms, 20 mm thick (M, the released arm part), below the base. Endcap frame, millimetres. Its robot side
is a pattern of ``robot_sides.csv``: holes for the flange's screws, whose heads sink into the hub's upper face, and a
pin. The heads of the interface's ten M3 screws stay accessible between the arms, so that a dome can be changed while
the base stays on the robot. Cables leave through the hub's bore and a groove to its edge. The part is printed in this
pose; only the floors of the head pockets overhang.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cad import base
from cad.fasteners import ScrewJoint
from cad.part import Part
from cad.robot_sides import (
    BORE_RADIUS_MM,
    DEFAULT_ROBOT,
    GROOVE_AZIMUTH_DEG,
    GROOVE_HALF_WIDTH_MM,
    HUB_RADIUS_MM,
    THICKNESS_MM,
    robot_side,
)

if TYPE_CHECKING:
    from cad.params import EndcapParams

GROOVE_DEPTH_MM = 10.0  # E: of the cable groove, from the hub's upper face
SCREW_RADIUS_MM = 2.25  # M: M4 through
HEAD_RADIUS_MM = 4.125  # M: pocket for an M4 head
HEAD_DEPTH_MM = 6.0  # E: M4 x 20 then holds 6 mm of the insert
COLOR = (0.42, 0.36, 0.50)  # RGB, 0..1


def adapter_part(params: EndcapParams, robot: str = DEFAULT_ROBOT) -> Part:
    """Build the adapter for a diameter and a robot.

    Args:
        params: design of the endcap.
        robot: name of a pattern in ``robot_sides.csv``.

    Raises:
        ParameterError: an unknown robot.
        GeometryError: the kernel did not return one valid solid.
    """
    from build123d import Pos, Rot, Solid, Vector

    from cad.outlines import disc, rectangle
    from cad.solids import cut_holes, drill, one_solid

    high = -params.base_thickness_mm
    low = high - THICKNESS_MM
    outline = disc((0.0, 0.0), HUB_RADIUS_MM)
    reach, half = params.arm_circle_radius_mm, base.LUG_RADIUS_MM
    arm = rectangle(BORE_RADIUS_MM + 5.0, reach, -half, half) + disc((reach, 0.0), half)
    for azimuth in params.arm_azimuths_deg:
        outline = outline + Rot(0, 0, azimuth) * arm
    body = Solid.extrude(Pos(0, 0, low) * outline, Vector(0, 0, THICKNESS_MM))
    tools = [drill((0.0, 0.0), BORE_RADIUS_MM, low - 1, high + 1)]
    groove = rectangle(0.0, HUB_RADIUS_MM + half, -GROOVE_HALF_WIDTH_MM, GROOVE_HALF_WIDTH_MM)
    groove = Solid.extrude(Pos(0, 0, high - GROOVE_DEPTH_MM) * groove, Vector(0, 0, GROOVE_DEPTH_MM + 1))
    tools.append(Rot(0, 0, GROOVE_AZIMUTH_DEG) * groove)
    for place in arm_places_mm(params):
        tools.append(drill(place, SCREW_RADIUS_MM, low - 1, high + 1))
        tools.append(drill(place, HEAD_RADIUS_MM, low - 1, low + HEAD_DEPTH_MM))
    for holes in robot_side(robot):
        for place in holes.places_mm:
            tools.append(drill(place, holes.hole_diameter_mm / 2, low - 1, high + 1))
            if holes.head_depth_mm:
                tools.append(drill(place, holes.head_diameter_mm / 2, high - holes.head_depth_mm, high + 1))
    solid = one_solid(cut_holes(body, tools), "arm_adapter")
    return Part("arm_adapter", "printed", "PLA", solid, COLOR)


def arm_places_mm(params: EndcapParams) -> tuple[tuple[float, float], ...]:
    """Axes (x, y) of the five M4 screws, mm in the endcap frame."""
    angles = [math.radians(azimuth) for azimuth in params.arm_azimuths_deg]
    return tuple((params.arm_circle_radius_mm * math.cos(a), params.arm_circle_radius_mm * math.sin(a)) for a in angles)


def screw_joints(params: EndcapParams) -> tuple[ScrewJoint, ...]:
    """Joint of the five M4 screws that go from below into the inserts of the base's lugs."""
    return (
        ScrewJoint(
            "adapter_to_base",
            "arm_adapter",
            "screw_m4",
            "ISO 4762 cap screw, steel",
            "assembly",
            arm_places_mm(params),
            True,
            "arm_adapter",
            ("arm_adapter",),
            "base",
            "insert",
        ),
    )
