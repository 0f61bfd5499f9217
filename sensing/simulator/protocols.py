"""Loading paths: what is pressed where, how hard and in which order (N, mm, degrees).

``static`` follows the paper's protocol (facts.md, "protocol"): tilts 10 to 50 degrees in steps of 10, normal force
set-points 5 to 35 N, then a circle drawn on the plane; with the approach, the light touch and the unloading that a
robot passes through. How many states each phase gets is ours (E): the paper does not publish it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cad.errors import ParameterError
from sensing.simulator.press import Target

PHASES = ("approach", "touch", "load", "circle", "unload")
TILTS_DEG = (10.0, 20.0, 30.0, 40.0, 50.0)  # P
FORCES_N = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0)  # P
FRICTION_RANGE = (0.3, 1.0)  # E: dusty to clean silicone on plastic
CIRCLE_RADIUS_MM = (0.5, 4.0)  # E
CIRCLE_STATES = 16


@dataclass(frozen=True)
class Waypoint:
    """One state of a path: its phase (:data:`PHASES`) and its target."""

    phase: str
    target: Target


@dataclass(frozen=True)
class LoadPath:
    """One loading path from the untouched shell, reproducible from ``(seed, number)``.

    Attributes:
        number: identity; training and test sets must never share it.
        tilt_deg, friction: of the plane.
        azimuths_deg: azimuths for which the solved states are labelled (rotations of one solution).
        waypoints: states in order.
    """

    number: int
    tilt_deg: float
    friction: float
    azimuths_deg: tuple[float, ...]
    waypoints: tuple[Waypoint, ...]

    @property
    def frames(self) -> int:
        """Number of labelled frames."""
        return len(self.waypoints) * len(self.azimuths_deg)


def static_path(seed: int, number: int, azimuths: int) -> LoadPath:
    """One path of the static protocol.

    Args:
        seed: of the data set. number: of the path.
        azimuths: how many azimuths (any, uniform) are labelled from it.
    """
    rng = np.random.default_rng([seed, number])
    tilt = TILTS_DEG[number % len(TILTS_DEG)]
    force = FORCES_N[(number // len(TILTS_DEG)) % len(FORCES_N)]
    friction = float(rng.uniform(*FRICTION_RANGE))
    radius = float(rng.uniform(*CIRCLE_RADIUS_MM))
    heading, sense = float(rng.uniform(0, 2 * math.pi)), float(rng.choice([-1.0, 1.0]))
    turns = tuple(float(a) for a in rng.uniform(0, 360, azimuths))
    touch = float(rng.uniform(0.3, 0.5) * min(force, 6.0))
    points = [Waypoint("approach", Target(normal_n=0.0)), Waypoint("touch", Target(normal_n=touch))]
    points += [Waypoint("load", Target(normal_n=share * force)) for share in (0.6, 1.0) if share * force > touch]
    shift = (0.0, 0.0)
    for count in range(1, CIRCLE_STATES + 1):
        angle = sense * 2 * math.pi * count / CIRCLE_STATES
        shift = (  # the circle passes through the first point of contact
            radius * (math.sin(heading + angle) - math.sin(heading)),
            radius * (math.cos(heading) - math.cos(heading + angle)),
        )
        points.append(Waypoint("circle", Target(normal_n=force, shift_mm=shift)))
    points += [Waypoint("unload", Target(normal_n=share * force, shift_mm=shift)) for share in (0.5, 0.15, 0.0)]
    return LoadPath(number, tilt, friction, turns, tuple(points))


PROTOCOLS: dict[str, Callable[[int, int, int], LoadPath]] = {"static": static_path}


def load_path(protocol: str, seed: int, number: int, azimuths: int) -> LoadPath:
    """Path of a protocol by its name.

    Raises:
        ParameterError: unknown protocol; the message lists the known ones.
    """
    if protocol not in PROTOCOLS:
        raise ParameterError(
            f"protocol={protocol!r} is unknown: choose one of {', '.join(PROTOCOLS)}", name="protocol", value=protocol
        )
    return PROTOCOLS[protocol](seed, number, azimuths)
