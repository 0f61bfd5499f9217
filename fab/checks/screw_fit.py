"""Checks that screws clamp: seat, grip, engagement and room for the tip, measured on the meshes along their axes.

Lines parallel to the axis are intersected with the parts: at the middle of the head's bearing ring for the seat, just
inside the thread for the engagement, on the axis for the room before the tip. Coordinates are in mm along the screw's
direction. Screw lengths: ISO 4762, tolerance js15 of ISO 286.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import trimesh

from cad.bought import bought_mm
from cad.errors import GeometryError
from cad.fasteners import ScrewJoint
from fab.checks.check import Check

LENGTHS_MM = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 25.0, 30.0, 35.0, 40.0)  # S
PLASTIC_DIAMETERS = 2.5  # E: engagement in printed plastic, in thread diameters
SEAT_MM = 0.05  # largest unevenness of a seat on which a head bears all round
TIP_MM = 0.1  # least room under the tip of the longest screw
# Room under TPU, which deforms: the 2.2 mm under a nut yield by F t / (E A) = 200 N x 2.2 mm / (45 MPa x 21 mm2), that
# is 0.46 mm (E: hand-tight M3, modulus of TPU 95A; A: square nut less its hole); at worst the roof sinks by as much.
TPU_TIP_MM = 0.5
INSERT_RING_MM = 4.2  # distance of the lines from the axis, outside the insert's hole (5.6)
INSERT_HOLE_MM = 9.2  # M: depth of the insert's hole
ANGLES = 8  # lines round the axis
INSIDE_MM = 0.01  # distance of the lines inside the thread's radius; also allowance for rounding
FAR_MM = 500.0  # start of the lines, outside all parts

Spans = list[tuple[float, float]]  # start and end of solid material on a line, mm along the screw


@dataclass(frozen=True)
class ScrewFit:
    """Fit of screws of one length in a joint; values are the worst of its places.

    Attributes:
        joint: the joint.
        length_mm: nominal length, mm.
        grip_mm: distance from the head's seat to the start of the thread's engagement, washers included, mm.
        engagement_mm: engaged length of thread of the shortest screw within tolerance, mm.
        needed_mm: required engagement, mm.
        tip_room_mm: free length before the tip of the longest screw within tolerance, mm.
        seat_error_mm: unevenness of the seat under the head, mm.
        seat_mm: coordinate of the bearing surface along the screw's direction (z, or -z if it points down), mm.
    """

    joint: ScrewJoint
    length_mm: float
    grip_mm: float
    engagement_mm: float
    needed_mm: float
    tip_room_mm: float
    seat_error_mm: float
    seat_mm: float = 0.0

    @property
    def checks(self) -> list[Check]:
        """Checks of seat, engagement and room before the tip."""
        name = self.joint.name
        return [
            Check(f"{name}.engagement_mm", self.engagement_mm, low=self.needed_mm),
            Check(f"{name}.tip_room_mm", self.tip_room_mm, low=tip_room_wanted_mm(self.joint)),
            Check(f"{name}.seat_error_mm", self.seat_error_mm, high=SEAT_MM),
        ]


class ScrewLines:
    """Intersections of lines along a joint's screws with its parts, each made once for screws of all lengths.

    Args:
        joint: the joint.
        meshes: closed meshes of its parts, by name, endcap frame, mm.
    """

    def __init__(self, joint: ScrewJoint, meshes: Mapping[str, trimesh.Trimesh]) -> None:
        self._joint, self._meshes = joint, meshes
        self._cut: dict[tuple[str, tuple[float, float], float], list[Spans]] = {}

    def ring(self, part: str, place: tuple[float, float], radius_mm: float) -> list[Spans]:
        """Solid spans of a part on lines round a screw's axis, along the screw's direction.

        Args:
            part: name of the part.
            place: (x, y) of the axis, mm.
            radius_mm: radius of the ring of lines, mm.

        Raises:
            GeometryError: a line misses the part.
        """
        angles = np.linspace(0.0, 2 * math.pi, ANGLES, endpoint=False) + 0.1
        round_axis = radius_mm * np.column_stack([np.cos(angles), np.sin(angles)])
        spans = self._spans(part, place, radius_mm, np.array(place) + round_axis)
        if not all(spans):
            x, y = place
            raise GeometryError(f"{self._joint.name}: {part} is not where the screw at {x:.2f}, {y:.2f} needs it")
        return spans

    def first_hit(self, place: tuple[float, float], seat_mm: float) -> float:
        """Coordinate on the axis at which the tip would hit the anchor or a part beyond it, mm; infinite without a hit.

        Args:
            place: (x, y) of the axis, mm.
            seat_mm: coordinate of the head's seat along the screw, mm.
        """
        axis = np.array(place)[None, :] + 0.03
        ahead = (self._joint.anchor, *self._joint.beyond)
        lines = [self._spans(part, place, 0.0, axis)[0] for part in ahead]
        return min((span[0] for line in lines for span in line if span[0] > seat_mm), default=math.inf)

    def _spans(self, part: str, place: tuple[float, float], radius_mm: float, lines: np.ndarray) -> list[Spans]:
        key = (part, place, radius_mm)
        if key not in self._cut:
            self._cut[key] = upright_spans(self._meshes[part], lines, self._joint.up)
        return self._cut[key]


def fitted(joint: ScrewJoint, meshes: Mapping[str, trimesh.Trimesh]) -> ScrewFit:
    """Fit of the shortest standard screw that holds; if none does, of the longest with room, whose checks then fail."""
    lines = ScrewLines(joint, meshes)
    fits = [screw_fit(joint, meshes, length, lines) for length in LENGTHS_MM]
    sound = [fit for fit in fits if all(check.ok for check in fit.checks)]
    roomy = [fit for fit in fits if fit.tip_room_mm >= tip_room_wanted_mm(joint)]
    return sound[0] if sound else (roomy[-1] if roomy else fits[0])


def tip_room_wanted_mm(joint: ScrewJoint) -> float:
    """Required room before the tip, mm; larger under TPU."""
    return TPU_TIP_MM if joint.holder == "captured nut" else TIP_MM


def screw_fit(
    joint: ScrewJoint, meshes: Mapping[str, trimesh.Trimesh], length_mm: float, lines: ScrewLines | None = None
) -> ScrewFit:
    """Measure one joint with screws of one length.

    Args:
        joint: the joint.
        meshes: closed meshes of its parts, by name, endcap frame, mm.
        length_mm: nominal length of the screws, mm.
        lines: lines of the same joint and meshes, to share between lengths.

    Raises:
        GeometryError: the head has no seat, or the screw misses the anchor.
    """
    lines = lines or ScrewLines(joint, meshes)
    thread = bought_mm(joint.thread, "thread")
    hole = bought_mm(joint.thread, "clearance_hole")
    ring = (bought_mm(*_head(joint)) + hole) / 4
    washers = joint.washers * bought_mm(_head(joint)[0], "thickness") if joint.washers else 0.0
    slack = length_tolerance_mm(length_mm)
    first = math.inf
    worst = {"grip": -math.inf, "held": math.inf, "room": math.inf, "uneven": 0.0}
    for place in joint.places:
        seats = [spans[0][0] for spans in lines.ring(joint.seat, place, ring)]
        first, seat = min(first, *seats), min(seats) - washers
        if joint.holder == "plastic":
            spans = lines.ring(joint.anchor, place, thread / 2 - INSIDE_MM)
            ahead = [[span for span in line if span[1] > seat] for line in spans]
            held = min(_overlap(line, seat, seat + length_mm - slack) for line in ahead)
            start, end = max(line[0][0] for line in ahead), lines.first_hit(place, seat)
        elif joint.holder == "insert":
            mouths = [spans[0][0] for spans in lines.ring(joint.anchor, place, INSERT_RING_MM)]
            start = max(mouths)
            end = start + INSERT_HOLE_MM
            held = _overlap([(start, start + bought_mm("insert_m4", "length"))], seat, seat + length_mm - slack)
        elif joint.holder == "captured nut":
            floors = [spans[0][1] for spans in lines.ring(joint.anchor, place, ring)]
            start, end = max(floors), lines.first_hit(place, seat)
            held = _overlap([(start, start + bought_mm("nut_m3", "thickness"))], seat, seat + length_mm - slack)
        else:
            faces = [spans[-1][1] for spans in lines.ring(joint.anchor, place, ring)]
            start, end = max(faces) + washers, math.inf
            nut = bought_mm("nut_m4", "thickness") + bought_mm(joint.thread, "pitch")
            held = min(nut, max(0.0, seat + length_mm - slack - start))
        worst["grip"] = max(worst["grip"], start - seat)
        worst["held"] = min(worst["held"], held)
        worst["room"] = min(worst["room"], end - (seat + length_mm + slack), FAR_MM)
        worst["uneven"] = max(worst["uneven"], max(seats) - min(seats))
    return ScrewFit(
        joint, length_mm, worst["grip"], worst["held"], _needed(joint, thread), worst["room"], worst["uneven"], first
    )


def screw_seat_mm(joint: ScrewJoint, meshes: Mapping[str, trimesh.Trimesh]) -> float:
    """Height z (endcap frame) of the surface under the heads or washers of a joint, mm."""
    hole = bought_mm(joint.thread, "clearance_hole")
    ring = (bought_mm(*_head(joint)) + hole) / 4
    seat = min(spans[0][0] for spans in ScrewLines(joint, meshes).ring(joint.seat, joint.places[0], ring))
    return seat if joint.up else -seat


def length_tolerance_mm(length_mm: float) -> float:
    """Deviation allowed to a length by js15 (ISO 286), mm: a screw may be longer or shorter by it."""
    steps = ((3.0, 0.20), (6.0, 0.24), (10.0, 0.29), (18.0, 0.35), (30.0, 0.42), (50.0, 0.50))
    return next(slack for limit, slack in steps if length_mm <= limit)


def _needed(joint: ScrewJoint, thread: float) -> float:
    """Required engagement, mm: a whole captured nut, a loose nut plus one pitch, or 2.5 diameters of plastic."""
    if joint.holder == "captured nut":
        return bought_mm("nut_m3", "thickness") - INSIDE_MM
    if joint.holder == "insert":
        return thread  # S: one diameter in brass
    if joint.holder == "loose nut":
        return bought_mm("nut_m4", "thickness") + bought_mm(joint.thread, "pitch") - INSIDE_MM
    return PLASTIC_DIAMETERS * thread


def _head(joint: ScrewJoint) -> tuple[str, str]:
    return (joint.thread.replace("screw", "washer"), "outer") if joint.washers else (joint.thread, "head")


def upright_spans(mesh: trimesh.Trimesh, lines: np.ndarray, up: bool) -> list[Spans]:
    """Solid spans along lines parallel to z, as coordinates along a screw, mm.

    Args:
        mesh: closed mesh, endcap frame, mm.
        lines: (n, 2) x, y of the lines, mm.
        up: whether the screw points to +z; if not, the coordinates are -z.
    """
    sign = 1.0 if up else -1.0
    origins = np.column_stack([lines, np.full(len(lines), -sign * FAR_MM)])
    directions = np.tile([0.0, 0.0, sign], (len(lines), 1))
    places, rays, _ = mesh.ray.intersects_location(origins, directions, multiple_hits=True)
    found = []
    for ray in range(len(lines)):
        hits = np.sort(sign * places[rays == ray][:, 2])
        hits = hits[np.concatenate([[True], np.diff(hits) > 1e-4])] if len(hits) else hits
        found.append([(float(a), float(b)) for a, b in zip(hits[::2], hits[1::2], strict=False)])
    return found


def _overlap(spans: Spans, low: float, high: float) -> float:
    return sum(max(0.0, min(high, end) - max(low, start)) for start, end in spans)
