"""The rigid base, which carries camera, ring and interface and bolts to the robot arm. Endcap frame, millimetres.

It lies below the mating plane, z -16..0, and follows a sphere 2.5 mm outside that of the silicone. At D=130 it is the
released base: seats, pockets, holes and lugs (M, GEO02 to GEO21 of docs/provenance.md) are those of its STEP file;
docs/base.md lists the differences with reasons and volumes, and tests check them. All sizes depend on D alone.
Provenance letters: M measured, S standard, E our estimate.

The base is printed with its bottom (z = -16) on the bed: pockets for camera, ring, cable and M4 heads open upward; the
lugs stand on the bed; only the seats under the M3 heads, 1.6 mm wide, and the floors of the blind holes are bridged.
Where the sphere would overhang by more than 45 degrees (D 109 to 240, up to 55), its tangent cone replaces it, at most
1.4 mm outside the sphere (1.1 mm at D=130), so that no support is needed.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

from cad import scaling
from cad.fasteners import ScrewJoint
from cad.part import Part

if TYPE_CHECKING:
    from build123d import Face, Shape

    from cad.params import EndcapParams

COLOR = (0.30, 0.33, 0.38)  # RGB, 0..1
SCREW_HOLE_RADIUS_MM = 1.7  # M: M3 through
SCREW_HEAD_RADIUS_MM = 3.25  # M: M3 cap head, 5.5 wide
SCREW_SEAT_Z_MM = -3.1  # M: M3 x 8 over a small washer holds all of the nut and stays 0.6 mm under the TPU roof
RECESS_RADIUS_MM = 39.0  # M: takes the ring's spacer
RECESS_EDGE_DEPTH_MM = 0.28  # M: height of the cylinder above the cone
RECESS_FLOOR_RADIUS_MM = 35.0  # M: the cone's own end; the released edge is rounded from 35.4 to 34.6, 0.04 mm deep
RECESS_DEPTH_MM = 1.0  # M: of the floor below the mating plane
CAMERA_POCKET_WIDTH_MM = 31.95  # M: square, under the board
CAMERA_POCKET_Z_MM = -10.0  # M: floor; room for the components on the board's back
CAMERA_POST_MM = 3.95  # M: side of the corner posts on which the board lies
CAMERA_HOLE_RADIUS_MM = 0.975  # M: M2 self-tapping, through
CAMERA_HOLE_OFFSET_MM = 14.0  # M: square pitch 28
CABLE_OFFSET_MM = 12.5  # M: of the cable holes from the axis, along y
CABLE_POCKET_RADIUS_MM = 7.5  # M: at the level of the camera pocket
CABLE_HOLE_RADIUS_MM = 4.1  # M: through
SLOT_OFFSET_MM = 22.576  # M: of the slots from the axis, along x
SLOT_RADIUS_MM = 5.5  # M: through, for a cable that leaves along x
CHANNEL_HALF_WIDTH_MM = 4.0  # M: between camera pocket and slot
CHANNEL_ROUND_MM = 4.0  # M: edge over which the cable bends into the slot
M4_POSITION_MM = (28.531, 7.5)  # M: all four signs
M4_HOLE_RADIUS_MM = 2.25  # M: through
M4_HEAD_RADIUS_MM = 4.125  # M: pocket for the head
M4_SEAT_Z_MM = -5.0  # M: a 4 mm head ends flush with the recess, so the spacer lies flat
POCKET_ROUND_MM = 2.0  # M: upright edges of the pockets
POST_ROUND_MM = 1.94  # M: 1.975, reduced so that it stays clear of the pocket's own rounding
CHAMFER_MM = 0.75  # M: edge of all pockets at the recess's floor
BLIND_HOLE_RADIUS_MM = 2.0  # M: six from below
BLIND_CIRCLE_RADIUS_MM = 30.0  # M: circle of their axes
BLIND_AZIMUTHS_DEG = (30.0, 90.0, 150.0, 210.0, 270.0, 330.0)  # M
BLIND_DEPTH_MM = 6.0  # M: of the cylinder; a 45 degree point follows
ARM_INSERT_RADIUS_MM = 2.8  # M: threaded insert
ARM_INSERT_DEPTH_MM = 9.2  # M: of the cylinder; a 45 degree point follows
LUG_RADIUS_MM = 7.5  # M: of the round end; half the lug's width
LUG_FILLET_MM = 20.0  # M: between a lug's side and the bottom circle
LEAST_FILLET_MM = 2.0  # E: a smaller one adds no stiffness
MAX_OVERHANG_DEG = 45.0  # from the vertical: printed without support
LAYER_MM = 0.2  # height of a printed layer


def base_part(params: EndcapParams) -> Part:
    """Build the rigid base.

    Raises:
        GeometryError: the kernel did not return one valid solid.
    """
    from cad.solids import one_solid

    solid = one_solid(_body(params) - _cuts(params), "base")
    return Part("base", "printed", "PLA", solid, COLOR)


def screw_joints(params: EndcapParams) -> tuple[ScrewJoint, ...]:
    """Screw joints of the base: ten screws into the interface's nuts, and four that hold the camera."""
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
            1,
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
    """Profile of the flank where it departs from its sphere.

    Returns:
        ``(tangent_z, tangent_radius, bottom_radius)``, mm: at and below ``tangent_z`` a 45 degree cone replaces the
        sphere. Where the sphere never overhangs more, ``tangent_z`` is the bottom plane.
    """
    radius, centre, bottom_z = params.base_sphere_radius_mm, params.centre_height_mm, -params.base_thickness_mm
    tangent_z = centre - radius * math.sin(math.radians(MAX_OVERHANG_DEG))
    if tangent_z < bottom_z + LAYER_MM:  # a cone lower than a printed layer is only a sliver of a face
        tangent_z = bottom_z
    tangent_radius = math.sqrt(radius**2 - (tangent_z - centre) ** 2)
    return tangent_z, tangent_radius, tangent_radius - (tangent_z - bottom_z)


def lug_fillet_mm(params: EndcapParams) -> float:
    """Radius of the fillet between lug and flank in plan, mm: 20 as released where the lug is long enough, 0 for none.

    A circle of radius r that touches the lug's side and, from outside, the bottom circle of radius b begins at x with
    x^2 = (b + r)^2 - (7.5 + r)^2 on the lug's side; it must not lie beyond the lug's axis.
    """
    bottom = flank_profile(params)[2]
    longest = (params.arm_circle_radius_mm**2 - bottom**2 + LUG_RADIUS_MM**2) / (2 * (bottom - LUG_RADIUS_MM))
    return min(LUG_FILLET_MM, longest) if longest > LEAST_FILLET_MM else 0.0


def _body(params: EndcapParams) -> Shape:
    """Segment of the sphere with the five lugs, which reach up to the mating plane."""
    from build123d import Axis, Edge, Face, Rot, Wire, revolve

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
    lug = _prism(_lug_outline(params), bottom_z, 0.0)
    return segment + [Rot(0, 0, azimuth) * lug for azimuth in params.arm_azimuths_deg]


def _lug_outline(params: EndcapParams) -> Face:
    """Outline of a lug in plan, at azimuth 0: a strip with a round end, and its fillets."""
    from cad.outlines import disc, polygon, rectangle

    bottom, reach, half = flank_profile(params)[2], params.arm_circle_radius_mm, LUG_RADIUS_MM
    root = bottom - 12.0  # well inside the segment, clear of the camera
    outline = rectangle(root, reach, -half, half) + disc((reach, 0.0), half)
    if radius := lug_fillet_mm(params):
        start = math.sqrt((bottom + radius) ** 2 - (half + radius) ** 2)
        touch = bottom / (bottom + radius)
        for side in (-1, 1):
            centre = (start, side * (half + radius))
            corners = [(root, 0.0), (start, 0.0), (start, side * half), centre, (touch * start, touch * centre[1])]
            outline = outline + (polygon(corners[::side]) - disc(centre, radius))  # the normals of all faces point up
    return outline


def _cuts(params: EndcapParams) -> list[Shape]:
    """Tools that are subtracted from the body; those that touch are joined first, which halves the kernel's time."""
    from build123d import Pos, Rot

    bottom_z = -params.base_thickness_mm
    circle = Pos(params.screw_circle_radius_mm, 0, 0)
    screw = _bore(SCREW_HOLE_RADIUS_MM, SCREW_SEAT_Z_MM, 0.0)
    screw = circle * screw.fuse(_bore(SCREW_HEAD_RADIUS_MM, bottom_z, SCREW_SEAT_Z_MM))
    insert = Pos(params.arm_circle_radius_mm, 0, 0) * _blind(ARM_INSERT_RADIUS_MM, bottom_z, ARM_INSERT_DEPTH_MM)
    blind = Pos(BLIND_CIRCLE_RADIUS_MM, 0, 0) * _blind(BLIND_HOLE_RADIUS_MM, bottom_z, BLIND_DEPTH_MM)
    return [
        hardware_cut(bottom_z),
        *(Rot(0, 0, azimuth) * screw for azimuth in params.screw_azimuths_deg),
        *(Rot(0, 0, azimuth) * insert for azimuth in params.arm_azimuths_deg),
        *(Rot(0, 0, azimuth) * blind for azimuth in BLIND_AZIMUTHS_DEG),
    ]


@cache
def hardware_cut(bottom_z: float) -> Shape:
    """Tool that makes room for camera, ring, cables and M4 screws; it is the same at every size and made once."""
    from build123d import Cone, Pos, Solid, Vector

    seat, edge_z = scaling.CAMERA_SEAT_Z_MM, scaling.CAMERA_SEAT_Z_MM - CHAMFER_MM
    pocket = _pocket_outline()
    tools = [
        Solid.extrude_taper(Pos(0, 0, edge_z) * pocket, Vector(0, 0, CHAMFER_MM), -45.0),
        _prism(pocket, CAMERA_POCKET_Z_MM, edge_z),
    ]
    x, y = M4_POSITION_MM
    head_edge = Pos(0, 0, (edge_z + seat) / 2) * Cone(M4_HEAD_RADIUS_MM, M4_HEAD_RADIUS_MM + CHAMFER_MM, CHAMFER_MM)
    head = _bore(M4_HEAD_RADIUS_MM, M4_SEAT_Z_MM, edge_z).fuse(head_edge)
    for side in (-1, 1):
        tools.append(Pos(side * SLOT_OFFSET_MM, 0, 0) * _bore(SLOT_RADIUS_MM, bottom_z, CAMERA_POCKET_Z_MM))
        tools.append(_bend(side))
        tools.append(Pos(0, side * CABLE_OFFSET_MM, 0) * _bore(CABLE_HOLE_RADIUS_MM, bottom_z, CAMERA_POCKET_Z_MM))
        for other in (-1, 1):
            corner = Pos(side * CAMERA_HOLE_OFFSET_MM, other * CAMERA_HOLE_OFFSET_MM, 0)
            tools.append(corner * _bore(CAMERA_HOLE_RADIUS_MM, bottom_z, seat))
            tools.append(Pos(side * x, other * y, 0) * head)
            tools.append(Pos(side * x, other * y, 0) * _bore(M4_HOLE_RADIUS_MM, bottom_z, M4_SEAT_Z_MM))
    return _recess().fuse(*tools)


def _pocket_outline() -> Face:
    """Outline in plan of the camera pocket with its cable discs, channels and slots."""
    from cad.outlines import disc, rectangle

    wide, narrow = CAMERA_POCKET_WIDTH_MM / 2, CAMERA_POCKET_WIDTH_MM / 2 - CAMERA_POST_MM
    reach, half = SLOT_OFFSET_MM, CHANNEL_HALF_WIDTH_MM
    face = rectangle(-wide, wide, -narrow, narrow) + rectangle(-narrow, narrow, -wide, wide)
    face = face + rectangle(-reach, reach, -half, half)
    for side in (-1, 1):
        face = face + disc((side * reach, 0.0), SLOT_RADIUS_MM)
        face = face + disc((0.0, side * CABLE_OFFSET_MM), CABLE_POCKET_RADIUS_MM)
    posts = [vertex for vertex in face.vertices() if abs(abs(vertex.X) - abs(vertex.Y)) < 1e-6]
    face = face.fillet_2d(POST_ROUND_MM, posts)
    sharp = [vertex for vertex in face.vertices() if _is_pocket_corner(vertex.X, vertex.Y)]
    return face.fillet_2d(POCKET_ROUND_MM, sharp)


def _is_pocket_corner(x: float, y: float) -> bool:
    """Whether a corner (x, y) of the outline is sharp; the other corners are ends of the posts' fillets."""
    wide, narrow = CAMERA_POCKET_WIDTH_MM / 2, CAMERA_POCKET_WIDTH_MM / 2 - CAMERA_POST_MM
    on_wall = max(abs(x), abs(y)) > wide - 1e-6
    return (on_wall and min(abs(x), abs(y)) < narrow + 1e-6) or abs(x) > wide


def _bend(side: int) -> Shape:
    """Tool for the rounded edge between pocket and slot, over which the cable bends."""
    from build123d import Axis, Pos, Rot, revolve

    from cad.outlines import disc, rectangle, upright

    top, radius = CAMERA_POCKET_Z_MM, CHANNEL_ROUND_MM
    outer = SLOT_RADIUS_MM + radius
    section = rectangle(SLOT_RADIUS_MM, outer, top - radius, top) - disc((outer, top - radius), radius)
    ring = revolve(upright(section), Axis.Z, 40.0)  # as wide as the channel
    return Pos(side * SLOT_OFFSET_MM, 0, 0) * Rot(0, 0, (180.0 if side > 0 else 0.0) - 20.0) * ring


def _prism(face: Face, low_z: float, high_z: float) -> Shape:
    """A plane face extruded between two heights."""
    from build123d import Pos, Solid, Vector

    return Solid.extrude(Pos(0, 0, low_z) * face, Vector(0, 0, high_z - low_z))


def _bore(radius: float, low_z: float, high_z: float) -> Shape:
    """Cylinder about z between two heights."""
    from build123d import Cylinder, Pos

    return Pos(0, 0, (low_z + high_z) / 2) * Cylinder(radius, high_z - low_z)


def _blind(radius: float, bottom_z: float, depth: float) -> Shape:
    """Hole from below with a 45 degree point, which needs no bridge."""
    from build123d import Cone, Pos

    point = Pos(0, 0, bottom_z + depth + radius / 2) * Cone(radius, 0.0, radius)
    return _bore(radius, bottom_z, bottom_z + depth).fuse(point)


def _recess() -> Shape:
    """Tool for the ring's recess: a short cylinder, then a cone that centres the spacer."""
    from build123d import Axis, Face, Wire, revolve

    profile = [
        (0, 0, 0),
        (RECESS_RADIUS_MM, 0, 0),
        (RECESS_RADIUS_MM, 0, -RECESS_EDGE_DEPTH_MM),
        (RECESS_FLOOR_RADIUS_MM, 0, -RECESS_DEPTH_MM),
        (0, 0, -RECESS_DEPTH_MM),
    ]
    return revolve(Face(Wire.make_polygon(profile)), Axis.Z)
