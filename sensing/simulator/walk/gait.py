"""A slow gait: the robot tips from face to face because its cables move the mass over an edge of what it stands on.

    gait = TippingGait(heading_deg=30.0)
    rest_m = gait.rest_lengths(robot, poses, time_s, rest_m, step_s)

``tips.csv`` states for each three endcaps on the ground, and each of their edges, the change of the nine rest lengths
that tips the three-bar robot over that edge. The gait takes the edge nearest to its heading, stays with it until
the robot has tipped, and takes another one where it has not after some time. It reads the true poses: it is no part
of what is estimated.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from sensing.simulator.walk.mjcf import sphere_centre_m
from sensing.tensegrity.description import Array, TensegrityRobot

STAND_S = 2.0  # at the start, for the gyroscopes' zero
PATIENCE_S = 5.0  # then the next edge
TIPS = Path(__file__).with_name("tips.csv")
Edge = tuple[int, int]


@dataclass(frozen=True)
class Tip:
    """How the robot leaves a face over one of its edges.

    Attributes:
        face: numbers of the three endcaps on the ground. lifted: the one that leaves it.
        change_m: (C,) of rest lengths.
    """

    face: tuple[int, ...]
    lifted: int
    change_m: Array


@lru_cache(maxsize=1)
def load_tips(path: Path = TIPS) -> tuple[Tip, ...]:
    """The tips of the three-bar robot that ships."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    return tuple(
        Tip(tuple(int(digit) for digit in face), int(lifted), np.array(change, float) / 1000)
        for face, lifted, *change in rows
    )


@dataclass
class TippingGait:
    """A gait and its state.

    Attributes:
        heading_deg: direction of travel, from world x. swing_deg, swing_s: amplitude and period of its turns.
        speed_m_s: fastest change of a rest length. reach: of the changes in the table that are made.
        pause_s: (length, every) of stops; none where every is 0.
    """

    heading_deg: float = 0.0
    swing_deg: float = 0.0
    swing_s: float = 30.0
    speed_m_s: float = 0.12
    reach: float = 0.8
    pause_s: tuple[float, float] = (0.0, 0.0)
    tip: Tip | None = field(default=None, init=False)
    since_s: float = field(default=0.0, init=False)

    def rest_lengths(
        self, robot: TensegrityRobot, poses: Array, time_s: float, before_m: Array, step_s: float
    ) -> Array:
        """(C,) m of the next moment.

        Args:
            robot: its cables. poses: (B, 4, 4) m, true. time_s: since the start. before_m: (C,) of the moment before.
            step_s: time between the two.
        """
        length, every = self.pause_s
        if time_s < STAND_S or (every and time_s % every < length):
            return before_m
        centres = endcap_centres(robot, poses)
        face = lowest_face(centres)
        late = time_s - self.since_s > PATIENCE_S
        if self.tip is None or self.tip.face != face or late:
            self.tip = self._choose(centres, face, time_s, self.tip if late else None)
            self.since_s = time_s
        target = np.array([cable.rest_m for cable in robot.cables]) + self.reach * self.tip.change_m
        most = self.speed_m_s * step_s
        return np.asarray(before_m + np.clip(target - before_m, -most, most))

    def _choose(self, centres: Array, face: tuple[int, ...], time_s: float, tried: Tip | None) -> Tip:
        """The tip over the edge that looks most along the heading, but for one that was tried in vain."""
        angle = math.radians(self.heading_deg + self.swing_deg * math.sin(2 * math.pi * time_s / self.swing_s))
        heading = np.array([math.cos(angle), math.sin(angle)])
        middle = centres[list(face), :2].mean(axis=0)
        found = [tip for tip in load_tips() if tip.face == face and tip is not tried]
        return max(found, key=lambda tip: float(heading @ (middle - centres[tip.lifted, :2])))


def endcap_centres(robot: TensegrityRobot, poses: Array) -> Array:
    """(E, 3) m, centres of the endcaps' untouched spheres in the world."""
    centres = []
    for endcap in robot.endcaps:
        pose = poses[robot.bar_number(endcap.bar)]
        centres.append(pose[:3, :3] @ sphere_centre_m(endcap) + pose[:3, 3])
    return np.array(centres)


def lowest_face(centres: Array) -> tuple[int, ...]:
    """The three endcaps whose face looks most nearly straight down."""
    return min(_faces(), key=lambda face: _outward(centres, face)[2])


@lru_cache(maxsize=1)
def _faces() -> list[tuple[int, ...]]:
    return sorted({tip.face for tip in load_tips()})


def _outward(centres: Array, face: tuple[int, ...]) -> Array:
    first, second, third = centres[list(face)]
    (ax, ay, az), (bx, by, bz) = second - first, third - first
    normal = np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    normal = normal / np.linalg.norm(normal)
    return np.asarray(normal if normal @ (first - centres.mean(axis=0)) > 0 else -normal)


def tuning_gait(seed: int) -> TippingGait:
    """The gait of runs on which numbers are chosen: straight, without stops."""
    return TippingGait(heading_deg=30.0 * seed)


def held_out_gait(seed: int) -> TippingGait:
    """The gait of runs from which numbers are published: faster, in curves, with stops."""
    return TippingGait(heading_deg=137.5 * seed, swing_deg=50.0, swing_s=17.0, speed_m_s=0.16, pause_s=(1.0, 7.0))
