"""``dynamic`` protocol: circles at speed, stick-slip and impacts, under a camera with exposure and latency (N, mm, s).

The body moves on a time law; a frame ends its exposure every 1/30 s (P) and the picture is smeared over the exposure.
Mechanics are quasi-static: the shell's inertia is left out (its own frequency, some 40 Hz at 0.06 kg and 4 N/mm, is
above all motions here but the shortest impacts, E). Stick-slip is that of the drive, whose slide moves in jerks
(half-period pi sqrt(m / k)); friction between shell and plane has one coefficient.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import FRAME_S, LoadPath, Waypoint
from sensing.simulator.protocols.static import FRICTION_RANGE

TILT_RANGE_DEG = (5.0, 55.0)  # tilt of the plane
FORCE_RANGE_N = (5.0, 30.0)  # normal force
EXPOSURE_RANGE_S = (1 / 250, 1 / 40)  # E: a lit dome at 30 frames a second
LATENCY_RANGE_S = (0.02, 0.07)  # E: USB camera, JPEG, processing; the paper pairs frames and wrenches within 0.05 s
SPEED_RANGE_MM_S = (8.0, 60.0)  # of circles
MAX_TRAVEL_MM = 1.0  # between solved states out of exposures, so that friction follows the curve
FRAMES = 24  # frames of a motion
LANDED_S = 3600.0  # E: the endcap has stood on the plane for so long when a motion starts, and has relaxed
Law = Callable[[float], Target]
Motion = tuple[float, list[Waypoint]]  # when the shell was last untouched and at rest; its frames


def dynamic_path(seed: int, number: int, azimuths: int) -> LoadPath:
    """One motion; circle, stick-slip and impact in turn.

    Args:
        seed: seed of the data set.
        number: number of the path.
        azimuths: number of azimuths (any, uniform) that are labelled.
    """
    rng = np.random.default_rng([seed, number, 1])
    tilt, friction = float(rng.uniform(*TILT_RANGE_DEG)), float(rng.uniform(*FRICTION_RANGE))
    exposure, latency = float(rng.uniform(*EXPOSURE_RANGE_S)), float(rng.uniform(*LATENCY_RANGE_S))
    turns = tuple(float(a) for a in rng.uniform(0, 360, azimuths))
    began, points = (_circle, _stick_slip, _impact)[number % 3](rng, exposure)
    return LoadPath(number, tilt, friction, turns, tuple(points), exposure, latency, began_s=began)


def _circle(rng: np.random.Generator, exposure_s: float) -> Motion:
    radius, speed = float(rng.uniform(1, 5)), float(rng.uniform(*SPEED_RANGE_MM_S))
    force, swing, beat = float(rng.uniform(*FORCE_RANGE_N)), float(rng.uniform(0, 0.3)), float(rng.uniform(0.5, 3))
    heading, sense = float(rng.uniform(0, 2 * math.pi)), float(rng.choice([-1.0, 1.0]))

    def law(time_s: float) -> Target:
        angle = heading + sense * speed * time_s / radius
        shift = (radius * (math.sin(angle) - math.sin(heading)), radius * (math.cos(heading) - math.cos(angle)))
        return Target(normal_n=force * (1 + swing * math.sin(2 * math.pi * beat * time_s)), shift_mm=shift)

    return -LANDED_S, _landing(force) + _moving("circle", law, speed, exposure_s)


def _stick_slip(rng: np.random.Generator, exposure_s: float) -> Motion:
    force, direction = float(rng.uniform(*FORCE_RANGE_N)), float(rng.uniform(0, 2 * math.pi))
    jump, slip_s = float(rng.uniform(0.3, 1.5)), float(rng.uniform(0.008, 0.03))
    period = jump / float(rng.uniform(3, 15))  # drive speed, mm/s

    def law(time_s: float) -> Target:
        count, late = divmod(time_s, max(period, 2 * slip_s))
        share = 0.5 * (1 - math.cos(math.pi * min(late / slip_s, 1.0)))
        travel = jump * (count + share)
        return Target(normal_n=force, shift_mm=(travel * math.cos(direction), travel * math.sin(direction)))

    return -LANDED_S, _landing(force) + _moving("drag", law, jump / slip_s, exposure_s)


def _impact(rng: np.random.Generator, exposure_s: float) -> Motion:
    depth, length, gap = float(rng.uniform(1, 6)), float(rng.uniform(0.04, 0.15)), float(rng.uniform(0.03, 0.12))
    bounce, slide = float(rng.uniform(0.5, 0.9)), float(rng.uniform(-20, 20))
    start = float(rng.uniform(0, FRAME_S))

    def law(time_s: float) -> Target:
        count, late = divmod(time_s + start, length + gap)
        height = depth * bounce**count
        here = height * math.sin(math.pi * late / length) if late < length else -1.0
        travel = slide * min(late, length)  # along the meridian, as long as the slide moves
        return Target(depth_mm=here, shift_mm=(travel, 0.0))

    return -start, _moving("impact", law, 0.0, exposure_s)


def _landing(force_n: float) -> list[Waypoint]:
    """Waypoint at rest on the plane before the motion starts; times count from its end."""
    return [Waypoint("approach", None, 2.0), Waypoint("load", Target(normal_n=force_n, time_s=0.0))]


def _moving(phase: str, law: Law, speed_mm_s: float, exposure_s: float) -> list[Waypoint]:
    """Frames of a motion, with enough solved states between them."""

    def at(time_s: float) -> Target:
        return replace(law(time_s), time_s=time_s)

    points, last = [], 0.0
    for count in range(1, FRAMES + 1):
        end = count * FRAME_S
        begin = end - exposure_s
        between = math.ceil(speed_mm_s * (begin - last) / MAX_TRAVEL_MM) - 1
        via = tuple(at(last + (begin - last) * k / (between + 1)) for k in range(1, max(between, 0) + 1))
        targets = (*via, at(begin), at(end))
        if all(target.depth_mm is not None and target.depth_mm <= 0 for target in targets):
            points.append(Waypoint("clear", None, 1.0, end))
        else:
            points.append(Waypoint(phase, at(end), time_s=end, begins=at(begin), via=via))
        last = end
    return points
