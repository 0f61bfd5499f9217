"""``static`` protocol: the motion of the authors' robot arm (N, mm, s, degrees).

Facts.md, "protocol": tilts 10 to 50 degrees in steps of 10, a sequence of normal-force set-points up to 5..35 N, then a
circle drawn on the plane, with the approach, the light touch and the unloading of each trial. The paper states only
that low to moderate forces dominate; how many states each phase gets is ours (E).
"""

from __future__ import annotations

import math

import numpy as np

from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import LoadPath, Waypoint, timed

TILTS_DEG = (10.0, 20.0, 30.0, 40.0, 50.0)  # P, NET20
FORCES_N = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)  # P, NET22: from 5 to 35 N; E: steps of 5
FRICTION_RANGE = (0.3, 1.0)  # E: Coulomb coefficient, dusty to clean silicone on plastic
CIRCLE_RADIUS_MM = (0.5, 4.0)  # E: travel of the circle
CIRCLE_STATES = 12  # states on the circle
PATHS_PER_TILT = 3  # neighbours share their tilt, so that level 2 can share its tangents
APPROACH_MM = (6.0, 2.0)  # distances to first touch, before contact


def static_path(seed: int, number: int, azimuths: int) -> LoadPath:
    """One trial of the static protocol.

    Args:
        seed: seed of the data set.
        number: number of the path.
        azimuths: number of azimuths (any, uniform) that are labelled.
    """
    rng = np.random.default_rng([seed, number])
    tilt = TILTS_DEG[number // PATHS_PER_TILT % len(TILTS_DEG)]
    top = float(rng.choice(FORCES_N))
    points = [Waypoint("approach", None, apart) for apart in APPROACH_MM]
    points += [Waypoint("touch", Target(normal_n=float(force))) for force in np.sort(rng.uniform(0.3, 4.5, 4))]
    points += [Waypoint("load", Target(normal_n=force)) for force in FORCES_N if force <= top]
    circled = float(rng.choice([force for force in (0.4 * top, 0.7 * top, top) if force >= 2]))
    if circled < top:
        points.append(Waypoint("unload", Target(normal_n=circled)))
    points += circle(rng, circled)
    last = points[-1].target
    assert last is not None
    points += [Waypoint("unload", Target(normal_n=s * circled, shift_mm=last.shift_mm)) for s in (0.6, 0.35, 0.2, 0.07)]
    points.append(Waypoint("clear", None, APPROACH_MM[-1]))
    turns = tuple(float(a) for a in rng.uniform(0, 360, azimuths))
    return LoadPath(number, tilt, float(rng.uniform(*FRICTION_RANGE)), turns, timed(points))


def circle(rng: np.random.Generator, force_n: float) -> list[Waypoint]:
    """A circle on the plane through the first point of contact, any heading and sense."""
    radius = float(rng.uniform(*CIRCLE_RADIUS_MM))
    heading, sense = float(rng.uniform(0, 2 * math.pi)), float(rng.choice([-1.0, 1.0]))
    points = []
    for count in range(1, CIRCLE_STATES + 1):
        angle = heading + sense * 2 * math.pi * count / CIRCLE_STATES
        shift = (radius * (math.sin(angle) - math.sin(heading)), radius * (math.cos(heading) - math.cos(angle)))
        points.append(Waypoint("circle", Target(normal_n=force_n, shift_mm=shift)))
    return points
