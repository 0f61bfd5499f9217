"""Robot flanges that the arm adapter fits: table ``robot_sides.csv`` (millimetres; standard library only).

Rows of the same ``pattern`` belong together: screws, a pin, or ``none`` for a blank side that the user drills.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import number, positive, read_table
from cad.errors import ParameterError

TABLE = Path(__file__).with_name("robot_sides.csv")
DEFAULT_ROBOT = "iso_9409_1_50_4_m6"  # pattern where none is chosen
ELEMENTS = ("screw", "pin", "none")  # accepted in column ``element``
HUB_RADIUS_MM = 36.0  # E: 5 mm outside the heads of the flange's screws; clear of the M3 heads at the smallest D
BORE_RADIUS_MM = 17.0  # E: takes the USB cable and its plug; 2.4 mm inside the heads of the flange's screws
GROOVE_AZIMUTH_DEG, GROOVE_HALF_WIDTH_MM = 0.0, 6.0  # E: from the bore outward, between two arms, for the cable
THICKNESS_MM = 20.0  # M: of the adapter; less the head's pocket it is the grip of a screw
LEAST_WALL_MM = 3.0  # E: PLA round a head
LEAST_FLOOR_MM = 5.0  # E: PLA under a head
LEAST_BEARING_MM = 1.0  # E: width of a head's bearing ring on its floor
LEAST_PLAY_MM = 0.3  # S: ISO 273, fine series of M4 and M5: hole's diameter less the screw's
LEAST_RIB_MM = 0.8  # E: two lines of a 0.4 mm nozzle between two holes, a hole and the bore, a hole and the groove
SCREW = re.compile(r"ISO 4762 M(\d+(?:\.\d+)?) x (\d+(?:\.\d+)?)\b")  # an order; groups: thread and length, mm
PIN = re.compile(r"ISO 2338 (\d+(?:\.\d+)?) m6\b")  # an order; group: diameter, mm
HEADS_MM = {4.0: 7.0, 5.0: 8.5, 6.0: 10.0, 8.0: 13.0}  # S: ISO 4762, thread -> head; its height equals the thread
KEYS_MM = {4.0: 3.0, 5.0: 4.0, 6.0: 5.0, 8.0: 6.0}  # S: ISO 4762, thread -> hexagon's width across flats


@dataclass(frozen=True)
class RobotHoles:
    """Equal holes on a circle of the robot's flange.

    Attributes:
        element: ``screw`` or ``pin``.
        count: number of holes, equally spaced.
        circle_radius_mm: radius of the circle of their axes, mm.
        first_azimuth_deg: azimuth of the first hole, degrees.
        hole_diameter_mm: diameter of the through hole, mm.
        head_diameter_mm: diameter of the pocket for the head, from above, mm; 0 for none.
        head_depth_mm: depth of that pocket, mm.
        flange_depth_mm: largest depth to which a screw may enter the robot's flange, mm; 0 for a pin.
        order_as: designation of the screw or pin for the order.
    """

    element: str
    count: int
    circle_radius_mm: float
    first_azimuth_deg: float
    hole_diameter_mm: float
    head_diameter_mm: float
    head_depth_mm: float
    flange_depth_mm: float
    order_as: str

    @property
    def places_mm(self) -> tuple[tuple[float, float], ...]:
        """Axes (x, y) of the holes, mm in the endcap frame."""
        angles = [math.radians(self.first_azimuth_deg + 360.0 * k / self.count) for k in range(self.count)]
        return tuple((self.circle_radius_mm * math.cos(a), self.circle_radius_mm * math.sin(a)) for a in angles)

    @property
    def widest_mm(self) -> float:
        """Radius of the hole or of its head's pocket, whichever is larger, mm."""
        return max(self.hole_diameter_mm, self.head_diameter_mm) / 2

    @property
    def body_mm(self) -> float:
        """Diameter of the thread or pin according to ``order_as``, mm."""
        return float(_ordered(self.element, self.order_as)[1])

    @property
    def head_mm(self) -> float:
        """Diameter of a screw's head, mm; 0 for a pin."""
        return HEADS_MM[self.body_mm] if self.element == "screw" else 0.0

    @property
    def key_mm(self) -> float | None:
        """Width across flats of a screw's hexagon, mm; None for a pin."""
        return KEYS_MM[self.body_mm] if self.element == "screw" else None

    @property
    def grip_mm(self) -> float:
        """Thickness of the adapter under a screw's head, mm."""
        return THICKNESS_MM - self.head_depth_mm

    @property
    def enters_mm(self) -> float:
        """Depth to which a screw enters the robot's flange, its length less the grip, mm; 0 for a pin."""
        return float(_ordered(self.element, self.order_as)[2]) - self.grip_mm if self.element == "screw" else 0.0

    @property
    def ream_mm(self) -> float | None:
        """Diameter H7 to which a pin's hole, printed no wider than the pin, is reamed, mm; None for a wider hole."""
        return self.body_mm if self.element == "pin" and self.body_mm >= self.hole_diameter_mm else None


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes:
        pattern: name of the pattern.
        holes: its equal holes; None for a side without holes.
    """

    pattern: str
    holes: RobotHoles | None


@cache
def robot_sides() -> dict[str, tuple[RobotHoles, ...]]:
    """All patterns: name -> holes (empty for the blank side).

    Raises:
        FileError: the table is missing or unreadable; the message names the line.
    """
    sides: dict[str, list[RobotHoles]] = {}

    def add(text: dict[str, str]) -> Row:
        row = _row(text)
        found = sides.setdefault(row.pattern, [])
        if row.holes:
            _require_apart(row.holes, found)
            found.append(row.holes)
        return row

    read_table(TABLE, add, "pattern", "element")
    return {name: tuple(holes) for name, holes in sides.items()}


def robot_side(robot: str) -> tuple[RobotHoles, ...]:
    """Holes of one pattern.

    Raises:
        ParameterError: there is no such pattern; the message lists all.
    """
    if robot not in robot_sides():
        raise ParameterError(
            f"robot={robot} is not in cad/robot_sides.csv: choose one of {', '.join(robot_sides())}, or add rows",
            name="robot",
            value=robot,
        )
    return robot_sides()[robot]


def fixing_words(robot: str) -> str:
    """Screws and pin of one pattern: ``4 x ISO 4762 M6 x 20, 1 x ISO 2338 6 m6 x 16``; empty for the blank side."""
    return ", ".join(f"{holes.count} x {holes.order_as}" for holes in robot_side(robot))


def entry_words(robot: str) -> str:
    """Depth to which the screws enter the robot's flange, as text: ``6 mm``; empty for the blank side."""
    return ", ".join(f"{holes.enters_mm:g} mm" for holes in robot_side(robot) if holes.element == "screw")


def ream_words(robot: str) -> str:
    """Reamed diameter of the pin's hole, as text: ``6 mm H7``; empty where it is printed wider, or there is no pin."""
    return ", ".join(f"{holes.ream_mm:g} mm H7" for holes in robot_side(robot) if holes.ream_mm)


def robot_words(robot: str) -> str:
    """Name of a pattern in words: ``flange ISO 9409-1-50-4-M6``, ``tensegrity arm``."""
    words = robot.split("_")
    return f"flange ISO {'-'.join(words[1:]).upper()}" if words[0] == "iso" else " ".join(words)


def _row(row: dict[str, str]) -> Row:
    if row["element"] not in ELEMENTS:
        raise ValueError(f"element={row['element']!r} is none of {', '.join(ELEMENTS)}")
    if row["element"] == "none":
        return Row(row["pattern"], None)
    count, head, depth, flange = (
        number(row, name) for name in ("count", "head_diameter_mm", "head_depth_mm", "flange_depth_mm")
    )
    circle, hole = positive(row, "circle_radius_mm"), positive(row, "hole_diameter_mm")
    if count < 1 or count != int(count):
        raise ValueError(f"count={row['count']!r} is not a number of holes")
    if circle + max(head, hole) / 2 > HUB_RADIUS_MM - LEAST_WALL_MM:
        raise ValueError(f"circle_radius_mm={circle:g}: holes come nearer than {LEAST_WALL_MM:g} mm to the hub's edge")
    if circle - max(head, hole) / 2 < BORE_RADIUS_MM + LEAST_RIB_MM:
        raise ValueError(f"circle_radius_mm={circle:g}: holes open into the cable's bore of {2 * BORE_RADIUS_MM:g} mm")
    turn = number(row, "first_azimuth_deg")
    holes = RobotHoles(row["element"], int(count), circle, turn, hole, head, depth, flange, row["order_as"])
    _ordered(holes.element, holes.order_as)
    if holes.element == "pin":
        _require_pin(holes)
    else:
        _require_screw(holes)
        _require_entry(holes)
    return Row(row["pattern"], holes)


def _ordered(element: str, order_as: str) -> re.Match[str]:
    """Match of the sizes in the order of a screw or a pin (:data:`SCREW`, :data:`PIN`).

    Raises:
        ValueError: the order does not state them, or the size of the screw is unknown.
    """
    form, example = (PIN, "ISO 2338 6 m6 x 16") if element == "pin" else (SCREW, "ISO 4762 M6 x 20")
    found = form.match(order_as)
    if not found:
        raise ValueError(f"order_as={order_as!r} does not state the size of a {element} as {example!r} does")
    if element == "screw" and float(found[1]) not in HEADS_MM:
        known = ", ".join(f"M{thread:g}" for thread in HEADS_MM)
        raise ValueError(f"order_as={order_as!r}: the adapter takes heads of {known}")
    return found


def _require_pin(holes: RobotHoles) -> None:
    """Refuse a pin with a head, or one that is wider than its hole."""
    if holes.head_diameter_mm or holes.head_depth_mm:
        raise ValueError(
            f"head_diameter_mm={holes.head_diameter_mm:g}, head_depth_mm={holes.head_depth_mm:g}: a pin has no head: "
            "make both 0"
        )
    if holes.hole_diameter_mm < holes.body_mm:
        raise ValueError(
            f"hole_diameter_mm={holes.hole_diameter_mm:g} is under the pin's {holes.body_mm:g}: print it as wide as "
            "the pin, it is reamed then"
        )


def _require_screw(holes: RobotHoles) -> None:
    """Refuse a screw that does not pass its hole, or whose head passes it, protrudes or has too thin a floor."""
    thread, hole, name = holes.body_mm, holes.hole_diameter_mm, f"ISO 4762 M{holes.body_mm:g}"
    least, most = thread + LEAST_PLAY_MM, holes.head_mm - 2 * LEAST_BEARING_MM
    if not least <= hole <= most:
        raise ValueError(
            f"hole_diameter_mm={hole:g} outside {least:g} to {most:g}: {name} must go through, and its head of "
            f"{holes.head_mm:g} must bear"
        )
    if holes.head_diameter_mm < holes.head_mm + LEAST_PLAY_MM:
        raise ValueError(
            f"head_diameter_mm={holes.head_diameter_mm:g} is under {holes.head_mm + LEAST_PLAY_MM:g}: the head of "
            f"{name} is {holes.head_mm:g} wide"
        )
    if not thread <= holes.head_depth_mm <= THICKNESS_MM - LEAST_FLOOR_MM:
        raise ValueError(
            f"head_depth_mm={holes.head_depth_mm:g} outside {thread:g} to {THICKNESS_MM - LEAST_FLOOR_MM:g}: the head "
            f"of {name} is {thread:g} high and must not reach the base, and {LEAST_FLOOR_MM:g} mm of the "
            f"{THICKNESS_MM:g} mm thick adapter stay under it"
        )


def _require_entry(holes: RobotHoles) -> None:
    """Refuse a screw that engages the robot's flange by less than its diameter, or that is too long for it."""
    least = holes.body_mm
    if not least <= holes.enters_mm <= holes.flange_depth_mm:
        raise ValueError(
            f"order_as={holes.order_as!r} enters the robot's flange {holes.enters_mm:g} mm, outside {least:g} (one "
            f"diameter) to flange_depth_mm={holes.flange_depth_mm:g}: it goes through {holes.grip_mm:g} mm of the "
            f"adapter, so order one {holes.grip_mm + least:g} to {holes.grip_mm + holes.flange_depth_mm:g} long"
        )


def _require_apart(holes: RobotHoles, others: Sequence[RobotHoles]) -> None:
    """Refuse holes that open into the cable's groove or into other holes of their pattern.

    Holes of one row need no check against each other: where none opens into the groove, they are over 55 degrees apart.
    """
    groove, places = math.radians(GROOVE_AZIMUTH_DEG), holes.places_mm
    for x, y in places:
        along, across = x * math.cos(groove) + y * math.sin(groove), y * math.cos(groove) - x * math.sin(groove)
        if along > 0 and abs(across) < GROOVE_HALF_WIDTH_MM + holes.widest_mm + LEAST_RIB_MM:
            raise ValueError(
                f"first_azimuth_deg={holes.first_azimuth_deg:g}: a hole opens into the cable's groove at azimuth "
                f"{GROOVE_AZIMUTH_DEG:g}, {2 * GROOVE_HALF_WIDTH_MM:g} mm wide: turn the pattern"
            )
    for other in others:
        least = holes.widest_mm + other.widest_mm + LEAST_RIB_MM
        if any(math.dist(a, b) < least for a in places for b in other.places_mm):
            raise ValueError(
                f"first_azimuth_deg={holes.first_azimuth_deg:g}: a {holes.element} and a {other.element} open into "
                "each other"
            )
