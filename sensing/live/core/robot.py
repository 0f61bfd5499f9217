"""State of a robot from all its endcaps: which touch, and whether their forces add up to the weight.

Robot frame (``T_robot_endcap`` of each endcap); N, s. The force sum needs no attitude: its norm is that of the weight
while nothing accelerates and nothing but the endcaps touches the ground.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sensing.frames import Array
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.reading import EndcapReading

STANDING = 3  # endcaps that carry the whole robot
TOLERANCE = 0.25  # E: of the weight, by which the force sum may differ before it is reported
OLD_S = 0.5  # an older reading is not used for the present state


@dataclass(frozen=True)
class RobotState:
    """The robot at one moment.

    Attributes:
        touching: names of the endcaps that touch.
        force_n: (3,) sum over the endcaps that touch, robot frame; NaN where their places are not stated.
        weight_n: of the robot; 0 where not given.
        consistent: whether the force sum carries the weight; None unless three or more touch, the contact of all is
            known, and all places are stated.
    """

    touching: tuple[str, ...]
    force_n: Array
    weight_n: float
    consistent: bool | None


def unplaced(endcaps: Sequence[EndcapConfig]) -> tuple[str, ...]:
    """Names of the endcaps whose place in the robot is not stated: they share one, as the unit matrix of setup.

    Args:
        endcaps: of one robot.
    """
    count = Counter(endcap.T_robot_endcap.tobytes() for endcap in endcaps)
    return tuple(endcap.name for endcap in endcaps if count[endcap.T_robot_endcap.tobytes()] > 1)


def robot_state(
    endcaps: Sequence[EndcapConfig], readings: Mapping[str, EndcapReading], weight_n: float, now_s: float
) -> RobotState:
    """State from the newest readings.

    Args:
        endcaps: of the robot.
        readings: newest by endcap.
        weight_n: 0 without the check.
        now_s: on this run's clock.
    """
    touching, are_known, total = [], True, np.zeros(3)
    for endcap in endcaps:
        reading = readings.get(endcap.name)
        if reading is None or now_s - reading.captured_s > OLD_S or not reading.contact.known:
            are_known = False
        elif reading.contact.touching:
            touching.append(endcap.name)
            total += endcap.T_robot_endcap[:3, :3] @ reading.wrench.force_n
    consistent = None
    if not set(touching).isdisjoint(unplaced(endcaps)):
        total = np.full(3, np.nan)
    elif len(touching) >= STANDING and weight_n > 0 and are_known:
        consistent = bool(abs(weight_n - np.linalg.norm(total)) <= TOLERANCE * weight_n)
    return RobotState(tuple(touching), total, weight_n, consistent)
