"""The mold core: inner half of the mold in seven pieces, with bumps that leave the dents for the dots.

The pieces are taken out through the bore of the TPU interface in this order: centre (straight out), keys (inward, then
out), wedges (inward, then out). Millimetres, endcap frame, casting position.
"""

from __future__ import annotations

import math
from itertools import pairwise

from build123d import Edge, Face, Plane, Solid, Vector, Wire

from cad.dots import Dot, dot_pattern
from cad.jigsaw import core_prisms
from cad.mold.layout import PILOT_RADIUS_MM, MoldLayout
from cad.params import EndcapParams
from cad.part import Part, Recipe
from cad.pattern import LEAST_BRIDGE_MM, pitch_mm
from cad.solids import cut_holes, drill, fused, intersected, one_solid, revolved

PILOT_DEPTH_MM = 14.0  # of the holes for the hanger's screws, from the mating plane
APART_MM = 0.01  # far above the kernel's tolerance: spheres closer than this count as meeting
COLOR = (0.93, 0.62, 0.22)  # RGB, 0..1
REMOVAL_ORDER = (
    "core_centre",
    *(f"core_key_{k}" for k in (1, 2, 3)),
    *(f"core_wedge_{k}" for k in (1, 2, 3)),
)


def bump_sphere_radius_mm(params: EndcapParams) -> float:
    """Radius of a bump's sphere, which meets the inner sphere in the dot's circle and rises by the dent's depth, mm.

    With r the inner radius, a the dot's radius and e the dent's depth, the bump is a segment of height
    d = r + e - sqrt(r^2 - a^2) over a circle of radius a; its sphere has the radius (a^2 + d^2) / (2 d).
    """
    inner, dot = params.inner_radius_mm, params.dot_radius_mm
    rise = inner + params.dent_depth_mm - math.sqrt(inner**2 - dot**2)
    return (dot**2 + rise**2) / (2 * rise)


def bump_sphere_centre_mm(params: EndcapParams) -> float:
    """Distance of the centre of a bump's sphere from the silicone sphere's centre, along the dot's direction, mm."""
    return params.inner_radius_mm + params.dent_depth_mm - bump_sphere_radius_mm(params)


def bump_base_deg(params: EndcapParams) -> float:
    """Latitude at which the solid of a bump ends, degrees: -90, a whole sphere, unless neighbours meet in the core.

    OCCT did not finish the fusion of 119 intersecting whole spheres within three minutes. Where they would intersect,
    each is therefore cut off inside the core, at a circle whose radius exceeds the dot's by a quarter of the least
    bridge, so that half a bridge remains between neighbours.
    """
    radius = bump_sphere_radius_mm(params)
    if pitch_mm(bump_sphere_centre_mm(params), params.dot_rings) > 2 * radius + APART_MM:
        return -90.0
    return math.degrees(math.acos((params.dot_radius_mm + LEAST_BRIDGE_MM / 4) / radius))


def bump(params: EndcapParams, dot: Dot) -> Solid:
    """Solid of one bump: its sphere, or the part of it above latitude :func:`bump_base_deg`.

    Notes:
        The sphere's poles lie on the dot's own radius. With the default axis, two bumps that met the core's equator
        gave an invalid solid in OCCT, with 1.49 times the right volume.
    """
    outward = Vector(*dot.direction)
    centre = outward * bump_sphere_centre_mm(params) + Vector(0, 0, params.centre_height_mm)
    plane = Plane(origin=centre, z_dir=outward)
    return Solid.make_sphere(bump_sphere_radius_mm(params), plane, bump_base_deg(params), 90, 360)


def core_profile(layout: MoldLayout) -> Face:
    """Half section of the core (x >= 0, z up): neck in the bore, ramp over the flange, inner sphere."""
    params = layout.params
    neck, flange, centre = layout.neck_radius_mm, params.flange_thickness_mm, params.centre_height_mm
    start = ramp_end(layout)
    tip = Vector(0, 0, centre + params.inner_radius_mm)
    middle_angle = (math.atan2(start[1] - centre, start[0]) + math.pi / 2) / 2
    middle = Vector(
        params.inner_radius_mm * math.cos(middle_angle), 0, centre + params.inner_radius_mm * math.sin(middle_angle)
    )
    corners = [Vector(0, 0, 0), Vector(neck, 0, 0), Vector(neck, 0, flange), Vector(start[0], 0, start[1])]
    edges = [Edge.make_line(a, b) for a, b in pairwise(corners)]
    edges += [Edge.make_three_point_arc(corners[-1], middle, tip), Edge.make_line(tip, corners[0])]
    return Face(Wire(edges))


def ramp_end(layout: MoldLayout) -> tuple[float, float]:
    """Point ``(radius, height)`` at which the ramp meets the inner sphere, mm.

    Where a thick wall reaches over the bore there is no ramp, and the sphere begins on the flange.
    """
    params = layout.params
    slope = math.tan(math.radians(layout.ramp_deg))
    neck, flange, centre = layout.neck_radius_mm, params.flange_thickness_mm, params.centre_height_mm
    if params.inner_radius_at(flange) <= neck:
        return params.inner_radius_at(flange), flange
    # |(neck + s, flange + slope s - centre)| = inner radius, solved for s
    drop = flange - centre
    a, b = 1 + slope**2, neck + slope * drop
    c = neck**2 + drop**2 - params.inner_radius_mm**2
    s = (-b + math.sqrt(b * b - a * c)) / a
    return neck + s, flange + slope * s


def core_body(layout: MoldLayout) -> Solid:
    """Build the whole core with its bumps, before it is cut into pieces."""
    params = layout.params
    return fused(revolved(core_profile(layout)), [bump(params, dot) for dot in dot_pattern(params)])


def core_parts(layout: MoldLayout, body: Solid) -> list[Part]:
    """Cut the core into its seven pieces and drill the pilot holes for the hanger's screws.

    Args:
        layout: mold sizes.
        body: the whole core (:func:`core_body`).
    """
    parts = []
    for name, prism in core_prisms(layout).items():
        places = layout.core_screws_mm[name]
        holes = [drill(place, PILOT_RADIUS_MM, 0.0, PILOT_DEPTH_MM) for place in places]
        piece = cut_holes(intersected(body, prism, name), holes)
        recipe = Recipe(body, (prism,), tuple(holes))
        parts.append(Part(name, "printed", "PLA", one_solid(piece, name), COLOR, recipe=recipe))
    order = {name: i for i, name in enumerate(REMOVAL_ORDER)}
    return sorted(parts, key=lambda part: order[part.name])
