"""The rigid base: carries camera, ring and interface, and bolts to the robot arm. Endcap frame, millimetres.

It lies below the mating plane, z -16..0, and follows a sphere 2.5 mm outside the silicone's. Provenance letters
are those of docs/provenance.md (GEO02 to GEO20): M measured, S standard, E our estimate. All sizes depend on the
diameter alone.

Printed with its bottom (z = -16) on the bed: pockets for camera, ring, cable and M4 heads open upward; the lugs
stand on the bed; only the seats under the M3 heads, 1.6 mm wide, and the roofs of the insert holes are bridged. Where
the sphere would overhang by more than 45 degrees (D 109 to 240, up to 55) its tangent cone takes over, at most 1.4 mm
proud (1.1 mm at D=130), so no support is needed.

The M3 screws are M3 x 10: with the seat at z = -5.5 the tip ends 0.5 mm, one pitch, above the nut that lies on
z = 2.2 (nut 1.8 thick), and still holds all of it with the shortest screw the standard allows (10 - 0.29 mm). An
M3 x 12 would need the seat at z = -7.5, where only 0.2 mm would remain between its hole and the sphere near D = 121.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cad.fasteners import ScrewJoint
from cad.part import Part

if TYPE_CHECKING:
    from build123d import Shape

    from cad.params import EndcapParams

SCREW_HOLE_RADIUS_MM = 1.7  # M: M3 through
SCREW_HEAD_RADIUS_MM = 3.25  # M: M3 cap head, 5.5 wide
SCREW_LENGTH_MM = 10.0  # E: see the module's text
SCREW_SEAT_Z_MM = -5.5  # E
RECESS_RADIUS_MM = 39.0  # M: takes the ring's spacer
RECESS_EDGE_DEPTH_MM = 0.28  # M
RECESS_FLOOR_RADIUS_MM = 35.4  # M
RECESS_DEPTH_MM = 1.0  # M
CAMERA_POCKET_WIDTH_MM = 31.95  # M: square
CAMERA_SEAT_Z_MM = -6.0  # E: back of the camera's board, so that its entrance pupil comes to z = 17
CAMERA_RELIEF_WIDTH_MM = 18.0  # E: a cross that leaves four corner pads and clears what is soldered to the back
CAMERA_RELIEF_Z_MM = -10.0  # E
CAMERA_HOLE_RADIUS_MM = 0.975  # M: M2 self-tapping
CAMERA_HOLE_OFFSET_MM = 14.0  # M: square pitch 28
CAMERA_HOLE_DEPTH_MM = 8.0  # E: M2 x 8 through a 1.6 mm board, with 1.6 to spare
CABLE_OFFSET_MM = 12.5  # M
CABLE_POCKET_RADIUS_MM = 7.5  # M
CABLE_POCKET_Z_MM = -12.0  # E: 4 mm of floor
CABLE_HOLE_RADIUS_MM = 4.1  # M
M4_POSITION_MM = (28.53, 7.5)  # M: all four signs
M4_HOLE_RADIUS_MM = 2.25  # M: the arm part's through hole
M4_HEAD_RADIUS_MM = 4.125  # M
M4_SEAT_Z_MM = -5.2  # E: a 4 mm head ends 0.2 below the recess, so the spacer lies flat
ARM_INSERT_RADIUS_MM = 2.8  # M: threaded insert
ARM_INSERT_DEPTH_MM = 9.2  # M
LUG_RADIUS_MM = 7.5  # M
LUG_TOP_Z_MM = -4.8  # E: 2 mm of roof over the insert
MAX_OVERHANG_DEG = 45.0
LAYER_MM = 0.2


def base_part(params: EndcapParams) -> Part:
    """Build the rigid base.

    Raises:
        GeometryError: the kernel did not return one valid solid.
    """
    from cad.solids import one_solid

    solid = one_solid(_body(params) - _cuts(params), "base")
    return Part("base", "printed", "PLA", solid, (0.30, 0.33, 0.38))


def screw_joints(params: EndcapParams) -> tuple[ScrewJoint, ...]:
    """Screws that the base asks for: ten into the interface's nuts, four that hold the camera."""
    azimuths = [math.radians(azimuth) for azimuth in params.screw_azimuths_deg]
    circle = tuple(
        (params.screw_circle_radius_mm * math.cos(a), params.screw_circle_radius_mm * math.sin(a)) for a in azimuths
    )
    offset = CAMERA_HOLE_OFFSET_MM
    corners = tuple((sx * offset, sy * offset) for sx in (-1, 1) for sy in (-1, 1))
    return (
        ScrewJoint(
            "base_to_interface",
            "base",
            "screw_m3",
            "ISO 4762 cap screw, steel",
            "assembly",
            circle,
            True,
            "base",
            ("base",),
            "interface",
            "captured nut",
        ),
        ScrewJoint(
            "camera_to_base",
            "base",
            "screw_m2",
            "pan-head screw for plastic",
            "assembly",
            corners,
            False,
            "camera",
            ("camera",),
            "base",
            "plastic",
        ),
    )


def flank_profile(params: EndcapParams) -> tuple[float, float, float]:
    """How the flank departs from its sphere.

    Returns:
        ``(tangent_z, tangent_radius, bottom_radius)``, mm: at and below ``tangent_z`` a 45 degree cone replaces the
        sphere. Where the sphere never overhangs more, ``tangent_z`` is the bottom plane.
    """
    radius, centre, bottom_z = params.base_sphere_radius_mm, params.centre_height_mm, -params.base_thickness_mm
    tangent_z = centre - radius * math.sin(math.radians(MAX_OVERHANG_DEG))
    if tangent_z < bottom_z + LAYER_MM:  # a cone lower than one printed layer is not worth its sliver of a face
        tangent_z = bottom_z
    tangent_radius = math.sqrt(radius**2 - (tangent_z - centre) ** 2)
    return tangent_z, tangent_radius, tangent_radius - (tangent_z - bottom_z)


def _body(params: EndcapParams) -> Shape:
    """Segment of the sphere with its five lugs."""
    from build123d import Axis, Box, Cylinder, Edge, Face, Pos, Rot, Wire, revolve

    radius, centre, bottom_z = params.base_sphere_radius_mm, params.centre_height_mm, -params.base_thickness_mm
    tangent_z, tangent_radius, bottom_radius = flank_profile(params)
    top_radius = math.sqrt(radius**2 - centre**2)
    middle_z = tangent_z / 2
    middle_radius = math.sqrt(radius**2 - (middle_z - centre) ** 2)
    edges = [
        Edge.make_line((0, 0, bottom_z), (bottom_radius, 0, bottom_z)),
        Edge.make_three_point_arc((tangent_radius, 0, tangent_z), (middle_radius, 0, middle_z), (top_radius, 0, 0)),
        Edge.make_line((top_radius, 0, 0), (0, 0, 0)),
        Edge.make_line((0, 0, 0), (0, 0, bottom_z)),
    ]
    if tangent_z > bottom_z:
        edges.insert(1, Edge.make_line((bottom_radius, 0, bottom_z), (tangent_radius, 0, tangent_z)))
    segment = revolve(Face(Wire(edges)), Axis.Z)

    height = LUG_TOP_Z_MM - bottom_z
    reach = params.arm_circle_radius_mm
    root = bottom_radius - 12.0  # well inside the segment, clear of the camera
    web = Pos((reach + root) / 2, 0, (LUG_TOP_Z_MM + bottom_z) / 2) * Box(reach - root, 2 * LUG_RADIUS_MM, height)
    lug = web + Pos(reach, 0, (LUG_TOP_Z_MM + bottom_z) / 2) * Cylinder(LUG_RADIUS_MM, height)
    return segment + [Rot(0, 0, azimuth) * lug for azimuth in params.arm_azimuths_deg]


def _cuts(params: EndcapParams) -> list[Shape]:
    """Everything that is taken out of the body; tools that touch are joined first, which halves the kernel's work."""
    from build123d import Pos, Rot

    bottom_z = -params.base_thickness_mm
    hole, *pocket = _screw_cuts(params.screw_circle_radius_mm, bottom_z)
    screw = hole.fuse(*pocket)
    arm = Pos(params.arm_circle_radius_mm, 0, 0)
    insert = arm * _bore(ARM_INSERT_RADIUS_MM, bottom_z, bottom_z + ARM_INSERT_DEPTH_MM)
    bolt = _bore(M4_HEAD_RADIUS_MM, M4_SEAT_Z_MM, 0.0).fuse(_bore(M4_HOLE_RADIUS_MM, bottom_z, M4_SEAT_Z_MM))
    x, y = M4_POSITION_MM
    return [
        _recess().fuse(*_camera_cuts(bottom_z)),
        *(Rot(0, 0, azimuth) * screw for azimuth in params.screw_azimuths_deg),
        *(Rot(0, 0, azimuth) * insert for azimuth in params.arm_azimuths_deg),
        *(Pos(sx * x, sy * y, 0) * bolt for sx in (-1, 1) for sy in (-1, 1)),
    ]


def _bore(radius: float, low_z: float, high_z: float) -> Shape:
    """Cylinder about z between two heights."""
    from build123d import Cylinder, Pos

    return Pos(0, 0, (low_z + high_z) / 2) * Cylinder(radius, high_z - low_z)


def _screw_cuts(circle_radius: float, bottom_z: float) -> list[Shape]:
    """Hole and head pocket of the M3 screw at azimuth 0.

    The pocket is open outward: round it, the sloping flank would end in a feather edge.
    """
    from build123d import Box, Pos

    height, middle_z, reach = SCREW_SEAT_Z_MM - bottom_z, (SCREW_SEAT_Z_MM + bottom_z) / 2, 20.0
    return [
        Pos(circle_radius, 0, 0) * _bore(SCREW_HOLE_RADIUS_MM, SCREW_SEAT_Z_MM, 0.0),
        Pos(circle_radius, 0, 0) * _bore(SCREW_HEAD_RADIUS_MM, bottom_z, SCREW_SEAT_Z_MM),
        Pos(circle_radius + reach / 2, 0, middle_z) * Box(reach, 2 * SCREW_HEAD_RADIUS_MM, height),
    ]


def _recess() -> Shape:
    """The ring's recess: a short cylinder, then a cone that centres the spacer."""
    from build123d import Axis, Face, Wire, revolve

    profile = [
        (0, 0, 0),
        (RECESS_RADIUS_MM, 0, 0),
        (RECESS_RADIUS_MM, 0, -RECESS_EDGE_DEPTH_MM),
        (RECESS_FLOOR_RADIUS_MM, 0, -RECESS_DEPTH_MM),
        (0, 0, -RECESS_DEPTH_MM),
    ]
    return revolve(Face(Wire.make_polygon(profile)), Axis.Z)


def _camera_cuts(bottom_z: float) -> list[Shape]:
    """Board pocket on four corner pads, M2 holes, and the two cable ways."""
    from build123d import Box, Pos

    width, relief = CAMERA_POCKET_WIDTH_MM, CAMERA_RELIEF_WIDTH_MM
    relief_height, relief_z = CAMERA_SEAT_Z_MM - CAMERA_RELIEF_Z_MM, (CAMERA_SEAT_Z_MM + CAMERA_RELIEF_Z_MM) / 2
    hole = _bore(CAMERA_HOLE_RADIUS_MM, CAMERA_SEAT_Z_MM - CAMERA_HOLE_DEPTH_MM, CAMERA_SEAT_Z_MM)
    offset = CAMERA_HOLE_OFFSET_MM
    return [
        Pos(0, 0, CAMERA_SEAT_Z_MM / 2) * Box(width, width, -CAMERA_SEAT_Z_MM),
        Pos(0, 0, relief_z) * Box(width, relief, relief_height),
        Pos(0, 0, relief_z) * Box(relief, width, relief_height),
        *(Pos(sx * offset, sy * offset, 0) * hole for sx in (-1, 1) for sy in (-1, 1)),
        *(Pos(0, sy * CABLE_OFFSET_MM, 0) * _bore(CABLE_POCKET_RADIUS_MM, CABLE_POCKET_Z_MM, 0.0) for sy in (-1, 1)),
        *(Pos(0, sy * CABLE_OFFSET_MM, 0) * _bore(CABLE_HOLE_RADIUS_MM, bottom_z, CABLE_POCKET_Z_MM) for sy in (-1, 1)),
    ]
