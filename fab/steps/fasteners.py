"""Checks that screws, nuts and inserts can be inserted: their swept bodies are intersected with the parts in place.

A fastener moves along its own axis (a nut along the radius), so that its swept body consists of cylinders or is a box
and covers the whole path without sampling. The intersection with every part in place at that step is an exact boolean
on the triangles of the files (manifold3d). Heads start at a distance of :data:`ACCESS_MM`, which includes the path of
the hex key. Material that is meant to yield is excluded: the thread that a screw cuts (only its root is swept in the
part that holds it), the rib past which a nut snaps (``nut.squeeze_mm`` limits it), and the knurl of an insert, which
melts in. Endcap frame, mm, mm3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import manifold3d

from cad.arm_adapter import THICKNESS_MM, arm_places_mm
from cad.base import ARM_INSERT_RADIUS_MM
from cad.bought import bought_mm
from cad.interface import POCKET_FLOOR_MM, POCKET_HEIGHT_MM, RIB_HEIGHT_MM
from cad.params import EndcapParams
from cad.robot_sides import DEFAULT_ROBOT, robot_side
from fab.checks.check import Check
from fab.checks.meshes import OVERLAP_MM3
from fab.checks.screw_fit import ScrewFit
from fab.steps.record import Step

ACCESS_MM = 60.0  # length of the path of a head, which a hex key follows
CONTACT_MM = 0.01  # gap of a head to its seat, of an insert to its hole's side, because facets touch
ROOT_PITCHES = 1.2269  # S: ISO 68-1, the root's diameter is the thread's less this many pitches
NUT_CORNERS = 2 / math.sqrt(3)  # of a hexagon: across corners over across flats
NUT_M4_FLATS_MM = 7.0  # S: ISO 4032
SEGMENTS = 48  # facets of a cylinder

Bodies = Mapping[str, manifold3d.Manifold]  # name of a part -> its body


def fastener_checks(
    params: EndcapParams,
    steps: Iterable[Step],
    bodies: Bodies,
    fits: Sequence[ScrewFit],
    robot: str = DEFAULT_ROBOT,
) -> list[Check]:
    """Checks of the shared volume, one for every step with screws, nuts, inserts or pins.

    Args:
        params: design of the endcap.
        steps: steps of the work; screws are removed along the path of their insertion and not checked again.
        bodies: bodies of the parts in place, by name (:func:`fab.steps.sweep.step_bodies`).
        fits: fit of the screws of every joint.
        robot: row of ``robot_sides.csv`` that the arm adapter fits.
    """
    checks = []
    for step in steps:
        if "nuts" in step.extras:
            shared = _shared_mm3(nuts_on_their_way(params), bodies["interface"])
            checks.append(Check(f"step_{step.key}.nuts_overlap_mm3", shared, high=OVERLAP_MM3))
        if "inserts" in step.extras:
            shared = _shared_mm3(inserts_on_their_way(params), bodies["base"])
            checks.append(Check(f"step_{step.key}.inserts_overlap_mm3", shared, high=OVERLAP_MM3))
        if "adapter_to_base" in step.screws and (swept := robot_fixings_on_their_way(params, robot)) is not None:
            shared = _shared_mm3(swept, bodies["arm_adapter"])
            checks.append(Check(f"step_{step.key}.robot_overlap_mm3", shared, high=OVERLAP_MM3))
        if step.screws and step.enters:
            driven = [fit for fit in fits if fit.joint.name.startswith(step.screws)]
            shared = max(screw_overlap_mm3(fit, step, bodies) for fit in driven)
            checks.append(Check(f"step_{step.key}.screws_overlap_mm3", shared, high=OVERLAP_MM3))
    return checks


def screw_overlap_mm3(fit: ScrewFit, step: Step, bodies: Bodies) -> float:
    """Volume that the swept screws of a joint share with all parts in place, mm3.

    Args:
        fit: fit of the joint's screws.
        step: step in which they are driven.
        bodies: bodies of the parts in place, by name.
    """
    moving = [name for move in step.moves for name in (*move.parts, *move.past)]
    near = {*moving, *step.in_place, *fit.joint.through, fit.joint.anchor} - {"shell"}  # silicone yields
    return sum(_shared_mm3(screws_on_their_way(fit, name), bodies[name]) for name in sorted(near & set(bodies)))


def screws_on_their_way(fit: ScrewFit, part: str) -> manifold3d.Manifold:
    """Swept body of a joint's screws against one part: heads and washers, shanks, and loose nuts from the other side.

    Args:
        fit: fit of the joint's screws.
        part: name of the part; in an anchor of plastic only the thread's root is swept.
    """
    joint = fit.joint
    cuts = joint.holder == "plastic" and part == joint.anchor
    thread = bought_mm(joint.thread, "thread")
    shank = (thread - ROOT_PITCHES * bought_mm(joint.thread, "pitch") if cuts else thread) / 2
    washer = joint.thread.replace("screw", "washer")
    washers = joint.washers * bought_mm(washer, "thickness") if joint.washers else 0.0
    head = max(bought_mm(joint.thread, "head"), bought_mm(washer, "outer") if joint.washers else 0.0) / 2
    seat, under_head = fit.seat_mm, fit.seat_mm - washers  # along the screw's direction
    swept = []
    for x, y in joint.places:
        swept.append(_cylinder((x, y), head, seat - CONTACT_MM - ACCESS_MM, seat - CONTACT_MM, joint.up))
        swept.append(_cylinder((x, y), shank, under_head, under_head + fit.length_mm, joint.up))
        if joint.holder == "loose nut":
            face = under_head + fit.grip_mm - washers + CONTACT_MM
            nut = max(NUT_CORNERS * NUT_M4_FLATS_MM, bought_mm(washer, "outer")) / 2
            swept.append(_cylinder((x, y), nut, face, face + ACCESS_MM, joint.up))
    return manifold3d.Manifold.batch_boolean(swept, manifold3d.OpType.Add)


def nuts_on_their_way(params: EndcapParams) -> manifold3d.Manifold:
    """Swept body of the ten square nuts from bore to seat, less the height by which they snap past the rib."""
    half = bought_mm("nut_m3", "across_flats") / 2
    start, end = params.bore_radius_mm - 4 * half, params.screw_circle_radius_mm + half
    box = manifold3d.Manifold.cube([end - start, 2 * half, POCKET_HEIGHT_MM - RIB_HEIGHT_MM - 2 * CONTACT_MM])
    box = box.translate([start, -half, POCKET_FLOOR_MM + RIB_HEIGHT_MM + CONTACT_MM])
    nuts = [box.rotate([0.0, 0.0, azimuth]) for azimuth in params.screw_azimuths_deg]
    return manifold3d.Manifold.batch_boolean(nuts, manifold3d.OpType.Add)


def inserts_on_their_way(params: EndcapParams) -> manifold3d.Manifold:
    """Swept body of the five inserts without knurl, from below to their flush position."""
    bottom = -params.base_thickness_mm
    depth, radius = bought_mm("insert_m4", "length"), ARM_INSERT_RADIUS_MM - 2 * CONTACT_MM
    inserts = [_cylinder(place, radius, bottom - ACCESS_MM, bottom + depth, True) for place in arm_places_mm(params)]
    return manifold3d.Manifold.batch_boolean(inserts, manifold3d.OpType.Add)


def robot_fixings_on_their_way(params: EndcapParams, robot: str) -> manifold3d.Manifold | None:
    """Swept body of the robot's screws and pin in the adapter, without the base on it; ``None`` for a blank side.

    They are inserted from above. A head is swept down to its pocket's floor; the pin, which is pressed in, is reduced
    by :data:`CONTACT_MM`.
    """
    high = -params.base_thickness_mm
    low, swept = high - THICKNESS_MM, []
    for holes in robot_side(robot):
        shank = holes.body_mm / 2 - (CONTACT_MM if holes.element == "pin" else 0.0)
        for place in holes.places_mm:
            swept.append(_cylinder(place, shank, low - CONTACT_MM, high + ACCESS_MM, True))
            if holes.head_mm:
                floor = high - holes.head_depth_mm + CONTACT_MM
                swept.append(_cylinder(place, holes.head_mm / 2, floor, high + ACCESS_MM, True))
    return manifold3d.Manifold.batch_boolean(swept, manifold3d.OpType.Add) if swept else None


def _cylinder(place: tuple[float, float], radius: float, start: float, end: float, up: bool) -> manifold3d.Manifold:
    """Cylinder along z between two coordinates along the screw (z, or -z if it points down), mm."""
    low = start if up else -end
    body = manifold3d.Manifold.cylinder(end - start, radius, circular_segments=SEGMENTS)
    return body.translate([*place, low])


def _shared_mm3(swept: manifold3d.Manifold, part: manifold3d.Manifold) -> float:
    return float((swept ^ part).volume())
