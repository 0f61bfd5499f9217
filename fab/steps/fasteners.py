"""Can every screw, nut and insert get to its place? What it sweeps on its way in, as an exact boolean volume.

A fastener moves along its own axis (a nut along the radius), so what it sweeps is a body of cylinders or a box: the
whole way, not places along it. It is intersected with every part that is in place at that step (manifold3d, exact on
the triangles of the files). Heads come from :data:`ACCESS_MM` away, so the way of the hex key is swept too. What is
meant to give way is left out: the thread that a screw cuts (its root is swept through the part it holds in), the rib
that a nut snaps past (``nut.squeeze_mm`` gates it), the knurl of an insert that melts in. Endcap frame, mm, mm3.
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

ACCESS_MM = 60.0  # from which a head comes, and a hex key after it
CONTACT_MM = 0.01  # by which a head stays off its seat, an insert off its hole's side: facets touch
ROOT_PITCHES = 1.2269  # S: ISO 68-1, the root's diameter is the thread's less this many pitches
NUT_CORNERS = 2 / math.sqrt(3)  # of a hexagon: across corners over across flats
NUT_M4_FLATS_MM = 7.0  # S: ISO 4032
SEGMENTS = 48

Bodies = Mapping[str, manifold3d.Manifold]


def fastener_checks(
    params: EndcapParams,
    steps: Iterable[Step],
    bodies: Bodies,
    fits: Sequence[ScrewFit],
    robot: str = DEFAULT_ROBOT,
) -> list[Check]:
    """One check for every step in which something is driven or pushed in.

    Args:
        params: the design.
        steps: what is done; screws that are loosened go the way they came.
        bodies: of the parts in place (:func:`fab.steps.sweep.step_bodies`).
        fits: how the screws of every joint sit.
        robot: what the arm adapter fits.
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
    """Volume that the screws of a joint share, on their way in, with all parts in place.

    Args:
        fit: the joint with its screws.
        step: in which they are driven.
        bodies: of the parts in place.
    """
    moving = [name for move in step.moves for name in (*move.parts, *move.past)]
    near = {*moving, *step.in_place, *fit.joint.through, fit.joint.anchor} - {"shell"}  # silicone gives way
    return sum(_shared_mm3(screws_on_their_way(fit, name), bodies[name]) for name in sorted(near & set(bodies)))


def screws_on_their_way(fit: ScrewFit, part: str) -> manifold3d.Manifold:
    """What the screws of a joint sweep, as a part feels it: heads and washers, shanks, nuts that come from beyond.

    Args:
        fit: the joint with its screws.
        part: in the anchor's own plastic only the thread's root counts.
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
    """What the ten square nuts sweep from the bore to their seats, less the height by which they snap past the rib."""
    half = bought_mm("nut_m3", "across_flats") / 2
    start, end = params.bore_radius_mm - 4 * half, params.screw_circle_radius_mm + half
    box = manifold3d.Manifold.cube([end - start, 2 * half, POCKET_HEIGHT_MM - RIB_HEIGHT_MM - 2 * CONTACT_MM])
    box = box.translate([start, -half, POCKET_FLOOR_MM + RIB_HEIGHT_MM + CONTACT_MM])
    nuts = [box.rotate([0.0, 0.0, azimuth]) for azimuth in params.screw_azimuths_deg]
    return manifold3d.Manifold.batch_boolean(nuts, manifold3d.OpType.Add)


def inserts_on_their_way(params: EndcapParams) -> manifold3d.Manifold:
    """What the five inserts, less their knurl, sweep from below to where they lie flush."""
    bottom = -params.base_thickness_mm
    depth, radius = bought_mm("insert_m4", "length"), ARM_INSERT_RADIUS_MM - 2 * CONTACT_MM
    inserts = [_cylinder(place, radius, bottom - ACCESS_MM, bottom + depth, True) for place in arm_places_mm(params)]
    return manifold3d.Manifold.batch_boolean(inserts, manifold3d.OpType.Add)


def robot_fixings_on_their_way(params: EndcapParams, robot: str) -> manifold3d.Manifold | None:
    """What the robot's screws and pin sweep in the adapter, before the base is on it; ``None``: a blank side.

    They come from above. A head goes down to its pocket's floor; the pin, which is pressed, is swept with the contact's
    play.
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
    """Upright cylinder between two coordinates along the screw (z, or -z if it points down)."""
    low = start if up else -end
    body = manifold3d.Manifold.cylinder(end - start, radius, circular_segments=SEGMENTS)
    return body.translate([*place, low])


def _shared_mm3(swept: manifold3d.Manifold, part: manifold3d.Manifold) -> float:
    return float((swept ^ part).volume())
