"""A slow gait: the robot tips from face to face, because its cables move the mass over an edge of the face below it.

    gait = TippingGait(heading_deg=30.0)
    rest_m = gait.rest_lengths(robot, poses, time_s, rest_m, step_s)

For each three endcaps on the ground, and each of their edges, a change of the cables' rest lengths tips the robot over
that edge (:mod:`sensing.simulator.walk.tips`). The gait chooses the edge nearest to its heading, keeps it until
the robot has tipped, and chooses another one if it has not after some time. It uses the true poses; no estimate
depends on it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sensing.simulator.walk.tips import Face, Tip, Tips, endcap_centres, outward
from sensing.tensegrity.description import Array, TensegrityRobot

STAND_S = 2.0  # time at the start, in which the gyroscopes' offsets are found
PATIENCE_S = 5.0  # time after which another edge is chosen


@dataclass
class TippingGait:
    """A gait with its state.

    Attributes:
        heading_deg: direction of travel, from world x, degrees.
        swing_deg, swing_s: amplitude, degrees, and period, s, of the changes of its heading.
        speed_m_s: largest speed of a rest length, m/s.
        reach: part of the table's changes that is made.
        pause_s: (length, period) of stops, s; none where the period is 0.
        tips: tips of the robot; None before the first call.
        tip: the tip in progress; None before the first.
        since_s: time at which that tip began.
    """

    heading_deg: float = 0.0
    swing_deg: float = 0.0
    swing_s: float = 30.0
    speed_m_s: float = 0.12
    reach: float = 0.8
    pause_s: tuple[float, float] = (0.0, 0.0)
    tips: Tips | None = field(default=None, init=False)
    tip: Tip | None = field(default=None, init=False)
    since_s: float = field(default=0.0, init=False)

    def rest_lengths(
        self, robot: TensegrityRobot, poses: Array, time_s: float, before_m: Array, step_s: float
    ) -> Array:
        """(C,) rest lengths at the next time, m.

        Args:
            robot: robot with its cables.
            poses: (B, 4, 4) m, true T_world_bar.
            time_s: time since the start, s.
            before_m: (C,) rest lengths at the last time, m.
            step_s: time between the two, s.
        """
        self.tips = self.tips or Tips(robot)
        length, every = self.pause_s
        if time_s < STAND_S or (every and time_s % every < length):
            return before_m
        centres = endcap_centres(robot, poses)
        face = lowest_face(centres, self.tips.faces)
        late = time_s - self.since_s > PATIENCE_S
        if self.tip is None or self.tip.face != face or late:
            self.tip = self._choose(self.tips, centres, face, time_s, self.tip if late else None)
            self.since_s = time_s
        target = np.array([cable.rest_m for cable in robot.cables]) + self.reach * self.tip.change_m
        most = self.speed_m_s * step_s
        return np.asarray(before_m + np.clip(target - before_m, -most, most))

    def _choose(self, tips: Tips, centres: Array, face: Face, time_s: float, tried: Tip | None) -> Tip:
        """The tip over the edge nearest to the heading, except one that was tried without success."""
        angle = math.radians(self.heading_deg + self.swing_deg * math.sin(2 * math.pi * time_s / self.swing_s))
        heading = np.array([math.cos(angle), math.sin(angle)])
        middle = centres[list(face), :2].mean(axis=0)
        vain = tried.lifted if tried and tried.face == face else -1
        left = [endcap for endcap in face if endcap != vain]
        return tips.over(face, max(left, key=lambda endcap: float(heading @ (middle - centres[endcap, :2]))))


def lowest_face(centres: Array, faces: list[Face]) -> Face:
    """The face whose normal is nearest to straight down.

    Args:
        centres: (E, 3) m, centres of the endcaps.
        faces: faces of the robot.
    """
    return min(faces, key=lambda face: outward(centres, face)[2])


def tuning_gait(seed: int) -> TippingGait:
    """Gait of the runs on which settings are chosen: straight, without stops."""
    return TippingGait(heading_deg=30.0 * seed)


def held_out_gait(seed: int) -> TippingGait:
    """Gait of the runs from which numbers are published: faster, in curves, with stops."""
    return TippingGait(heading_deg=137.5 * seed, swing_deg=50.0, swing_s=17.0, speed_m_s=0.16, pause_s=(1.0, 7.0))
