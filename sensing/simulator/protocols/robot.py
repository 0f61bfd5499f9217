"""``robot`` protocol: six endcaps of a three-bar robot that is lowered onto 0, 1, 2 or 3 of them (N, mm, s).

A scene is six paths, one for each endcap, with common frames: at every frame the forces on all endcaps and the ropes
balance the weight. ``azimuths`` does not apply: the attitude of the robot determines that of every endcap.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import LoadPath, Waypoint, timed
from sensing.simulator.protocols.static import FRICTION_RANGE
from sensing.simulator.robot.statics import Stand, random_stand
from sensing.simulator.solid.surface import turn_about_axis

ENDCAPS = 6  # of the robot
SHARES = (0.2, 0.45, 0.7, 1.0, 1.0)  # of the load that an endcap carries, while the ropes are slackened
LOWERED_MM = (20.0, 5.0)  # heights above the ground while the robot is lowered


def robot_path(seed: int, number: int, azimuths: int) -> LoadPath:
    """One endcap of a scene; the number of contacts is 0, 1, 2, 3 in turn.

    Args:
        seed: seed of the data set.
        number: number of the path: six times the scene plus the endcap.
        azimuths: not used; the attitude of the robot determines that of every endcap.
    """
    scene, endcap = divmod(number, ENDCAPS)
    stand, friction = scene_stand(seed, scene)
    rotation = stand.rotation[endcap]
    outward = -rotation[2]  # straight down, in the endcap frame
    tilt, azimuth = (
        math.degrees(math.acos(np.clip(outward[2], -1, 1))),
        math.degrees(math.atan2(outward[1], outward[0])),
    )
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, stand.centre_mm[endcap]
    points = [Waypoint("airborne", None, apart + float(stand.centre_mm[endcap, 2])) for apart in LOWERED_MM]
    if stand.touching[endcap]:
        _, meridian, lateral = (turn_about_axis(azimuth) @ Indenter(tilt).frame()).T
        force = rotation.T @ stand.force_n[endcap]
        normal, pull = float(stand.force_n[endcap, 2]), (float(force @ meridian), float(force @ lateral))
        points += [
            Waypoint("stand", Target(normal_n=s * normal, tangential_n=(s * pull[0], s * pull[1]))) for s in SHARES
        ]
    else:
        points += [Waypoint("airborne", None, float(stand.centre_mm[endcap, 2]))] * len(SHARES)
        tilt = min(tilt, 90.0)  # has no meaning in the air
    flat = tuple(float(value) for value in pose.ravel())
    return LoadPath(number, tilt, friction, (azimuth,), timed(points), scene=scene, endcap=endcap, T_world_sphere=flat)


@lru_cache(maxsize=4)
def scene_stand(seed: int, scene: int) -> tuple[Stand, float]:
    """Stand and friction of a scene."""
    rng = np.random.default_rng([seed, scene, 2])
    friction = float(rng.uniform(*FRICTION_RANGE))
    return random_stand(rng, scene % 4, friction), friction
