"""The TPU interface: a flange with ten captured nuts, and the envelope of the gyroid zone in which the silicone locks.

Endcap frame (:mod:`cad.params`), millimetres. The flange lies on the mating plane, z 0..flange_thickness; screws come
from below and pull the nuts down onto the floor of their pockets. The nuts slide in radially from the bore. The gyroid
itself is a mesh (:mod:`fab.meshing.gyroid`); as a B-rep it would have a hundred thousand faces.

The interface is printed with the mating plane down, without support: a pocket's roof is a 5.65 mm bridge. The endcap is
cast dome-down, so that air and overflow leave through the vents at the flange's outer edge.

Sources: nut and screw are from bought.csv; values marked E are our estimate.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cad.bought import bought_mm
from cad.errors import GeometryError
from cad.params import EndcapParams
from cad.part import Part

if TYPE_CHECKING:
    from build123d import Solid

COLLAR_CLEARANCE_MM = 0.2  # E: between flange and the mold's collar, along the sphere's radius
POCKET_WIDTH_MM = 5.65  # E: the 5.5 mm nut slides in by hand and turns by less than 2 degrees
POCKET_HEIGHT_MM = 2.0  # E: the 1.8 mm nut, and 0.2 mm (one layer) for the sag of the roof
POCKET_FLOOR_MM = 2.2  # E: TPU under the nut, which carries the screw's force
POCKET_END_GAP_MM = 0.1  # E: behind the seated nut
RIB_HEIGHT_MM = 0.4  # E: step at the mouth; leaves 1.6 mm for the 1.8 mm nut, which snaps past 0.2 mm of TPU
NUT_PLAY_MM = 0.15  # E: between the seated nut and the rib; a 3 mm screw in a 3.4 mm hole finds the thread
SCREW_HOLE_TOP_MM = 5.35  # E: leaves a roof of 0.65 mm, so that no silicone comes down the thread
VENT_DIAMETER_MM = 3.0  # E: within its pot life, 35,000 cP silicone overflows through it under gravity
BORE_MARGIN_MM = 0.5  # E: where a thick wall reaches inside the bore, the gyroid still stands on the flange
SEAM_AZIMUTH_DEG = 9.0  # keeps the seam of the surfaces of revolution away from pockets and vents
COLOR = (0.90, 0.55, 0.10)  # RGB, 0..1


def vent_azimuths_deg() -> tuple[float, ...]:
    """Azimuths of the ten vents, midway between the nuts."""
    return tuple(36.0 * k for k in range(10))


def zone_radii_mm(params: EndcapParams) -> tuple[float, float]:
    """Radii of the inner and outer sphere of the gyroid zone, mm: the silicone's two surfaces less the skin."""
    return params.inner_radius_mm + params.skin_mm, params.outer_radius_mm - params.skin_mm


def zone_clip_radius_mm(params: EndcapParams) -> float:
    """Radius of the cylinder outside which the zone lies, mm; 0 where the inner sphere alone keeps it on the flange."""
    inner, _ = zone_radii_mm(params)
    limit = params.bore_radius_mm + BORE_MARGIN_MM
    return limit if _sphere_section(params, inner, params.flange_thickness_mm) < limit else 0.0


def vent_reach_mm(params: EndcapParams, height_mm: float) -> float:
    """Cylindrical radius at which the notches of the vents begin, at a height near the flange's top, mm.

    A notch's axis is the chord of the flange's outer surface between bottom and top; it leans by the chord's slope.
    """
    low, slope = _edge(params)
    return low + slope * height_mm - VENT_DIAMETER_MM / 2 * math.hypot(1.0, slope)


def edge_room_mm3(params: EndcapParams) -> float:
    """Volume between flange and collar, mm3: their clearance, and the notches of the vents as half a cylinder each.

    The sphere bulges beyond the notches' axes, so that the result is too small by up to a twentieth.
    """
    outer, top = params.outer_radius_mm, params.flange_thickness_mm
    low, high = (z - params.centre_height_mm for z in (0.0, top))
    clearance = _slab_mm3(outer, low, high) - _slab_mm3(outer - COLLAR_CLEARANCE_MM, low, high)
    notch = math.pi * VENT_DIAMETER_MM**2 / 8 * top * math.hypot(1.0, _edge(params)[1])
    return clearance + len(vent_azimuths_deg()) * notch


def zone_volume_mm3(params: EndcapParams) -> float:
    """Volume of the gyroid zone, mm3: pi times the integral of outer^2 - max(inner, clip)^2 over height z.

    ``outer`` and ``inner`` are the cylindrical radii of the zone's spheres at z, ``clip`` is
    :func:`zone_clip_radius_mm`; the integral is evaluated in closed form.
    """
    inner, outer = zone_radii_mm(params)
    low, high = (z - params.centre_height_mm for z in (params.flange_thickness_mm, params.interlock_top_mm))
    volume = _slab_mm3(outer, low, high) - _slab_mm3(inner, low, high)
    clip = zone_clip_radius_mm(params)
    if clip:
        end = min(high, -math.sqrt(inner**2 - clip**2))  # where the inner sphere crosses the cylinder below the equator
        volume -= math.pi * clip**2 * (end - low) - _slab_mm3(inner, low, end)
    return volume


def build_flange(params: EndcapParams) -> Solid:
    """Build the flange: ring, ten nut pockets, ten blind screw holes, ten vents.

    Raises:
        GeometryError: the kernel did not return exactly one valid solid.
    """
    from build123d import Pos, Rot

    import cad.serial_booleans  # noqa: F401 - before the first boolean

    sphere = params.outer_radius_mm - COLLAR_CLEARANCE_MM
    ring = _revolved(params, params.bore_radius_mm, 0.0, sphere, 0.0, params.flange_thickness_mm)
    hole = _cylinder(bought_mm("screw_m3", "clearance_hole") / 2, SCREW_HOLE_TOP_MM + 1)
    hole = Pos(params.screw_circle_radius_mm, 0, -1) * hole
    pocket, vent = _pocket(params), _vent(params, sphere)
    cuts = [Rot(0, 0, azimuth) * tool for azimuth in params.screw_azimuths_deg for tool in (*pocket, hole)]
    cuts += [Rot(0, 0, azimuth) * vent for azimuth in vent_azimuths_deg()]
    return _single(ring.cut(*cuts), "interface flange")


def build_zone(params: EndcapParams) -> Solid:
    """Build the gyroid's envelope: between the zone's spheres, outside its clip, from flange to the interlock's top."""
    inner, outer = zone_radii_mm(params)
    low, high = params.flange_thickness_mm, params.interlock_top_mm
    return _single(_revolved(params, zone_clip_radius_mm(params), inner, outer, low, high), "gyroid zone")


def build_interface(params: EndcapParams) -> Part:
    """Build the printed part: its solid is the flange; :mod:`fab.meshing.gyroid` makes its mesh, with the gyroid."""
    return Part("interface", "printed", "TPU 95A", build_flange(params), COLOR)


def _edge(params: EndcapParams) -> tuple[float, float]:
    """Radius of the flange's edge at the mating plane, mm, and its mean slope up to the flange's top, mm per mm."""
    sphere, top = params.outer_radius_mm - COLLAR_CLEARANCE_MM, params.flange_thickness_mm
    low, high = (_sphere_section(params, sphere, z) for z in (0.0, top))
    return low, (high - low) / top


def _sphere_section(params: EndcapParams, radius: float, height: float) -> float:
    return math.sqrt(max(0.0, radius**2 - (height - params.centre_height_mm) ** 2))


def _slab_mm3(radius: float, low: float, high: float) -> float:
    """Volume of a sphere between two planes at distances ``low`` and ``high`` from its centre, mm3."""
    return math.pi * (radius**2 * (high - low) - (high**3 - low**3) / 3)


def _revolved(params: EndcapParams, cylinder: float, inner: float, outer: float, low: float, high: float) -> Solid:
    """Ring outside ``cylinder`` and the inner sphere, inside the outer sphere, between two heights."""
    from build123d import Axis, Edge, Face, Rot, Solid, Wire

    def at(radius: float, height: float) -> tuple[float, float, float]:
        return (_sphere_section(params, radius, height), 0.0, height)

    def arc(radius: float, start: float, end: float) -> Edge:
        return Edge.make_three_point_arc(at(radius, start), at(radius, (start + end) / 2), at(radius, end))

    edges = [arc(outer, low, high)]
    foot = head = (cylinder, 0.0, low)
    corner = low  # height above which the inner sphere, not the cylinder, is the inner boundary
    if cylinder > at(inner, low)[0]:
        corner = high if cylinder >= inner else min(high, params.centre_height_mm - math.sqrt(inner**2 - cylinder**2))
        head = (cylinder, 0.0, corner)
        edges.append(Edge.make_line(foot, head))
    else:
        foot = at(inner, low)
    if corner < high:
        edges.append(arc(inner, corner, high))
        head = at(inner, high)
    edges += [Edge.make_line(at(outer, low), foot), Edge.make_line(at(outer, high), head)]
    ring = Solid.revolve(Face(Wire(edges)), 360.0, Axis.Z)
    return Rot(0, 0, SEAM_AZIMUTH_DEG) * ring


def _pocket(params: EndcapParams) -> tuple[Solid, Solid]:
    """Tools at azimuth 0 for a nut's seat, and for the mouth over the retaining rib, which reaches into the bore."""
    half = bought_mm("nut_m3", "across_flats") / 2
    rib = params.screw_circle_radius_mm - half - NUT_PLAY_MM
    end = params.screw_circle_radius_mm + half + POCKET_END_GAP_MM
    top = POCKET_FLOOR_MM + POCKET_HEIGHT_MM
    seat = _box(rib, end, POCKET_WIDTH_MM, POCKET_FLOOR_MM, top)
    return seat, _box(params.bore_radius_mm - 3, rib, POCKET_WIDTH_MM, POCKET_FLOOR_MM + RIB_HEIGHT_MM, top)


def _vent(params: EndcapParams, sphere: float) -> Solid:
    """Cylinder at azimuth 0 along the flange's outer surface, whose axis meets it at bottom and top."""
    from build123d import Location, Plane, Vector

    height = params.flange_thickness_mm
    foot = Vector(_sphere_section(params, sphere, 0.0), 0, 0)
    along = (Vector(_sphere_section(params, sphere, height), 0, height) - foot).normalized()
    plane = Plane(origin=foot - along * height, x_dir=(0, 1, 0), z_dir=along)
    return Location(plane) * _cylinder(VENT_DIAMETER_MM / 2, 3 * height)


def _box(start: float, end: float, width: float, low: float, high: float) -> Solid:
    """Box from ``start`` to ``end`` along x, centred on y, between two heights."""
    from build123d import Pos, Solid

    return Pos(start, -width / 2, low) * Solid.make_box(end - start, width, high - low)


def _cylinder(radius: float, height: float) -> Solid:
    from build123d import Solid

    return Solid.make_cylinder(radius, height)


def _single(shape: object, name: str) -> Solid:
    """The only solid of a boolean's result; raises GeometryError unless it is one valid solid."""
    solids = shape.solids()  # type: ignore[attr-defined]
    if len(solids) != 1 or not solids[0].is_valid:
        raise GeometryError(f"{name}: the kernel returned {len(solids)} solids or an invalid one instead of one solid")
    return solids[0]
