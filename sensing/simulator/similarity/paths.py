"""The loading paths of the library, for D=130 T=8 in Smooth-Sil 950 (N, mm).

Eight tilts between 3 and 54 degrees, three paths each: touches, set-points, then a circle, a drag to slip, or travel
while the force swings, then unloading. No protocol has these seeds and numbers.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import numpy as np

from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import LoadPath, Waypoint, timed
from sensing.simulator.protocols.scaled import scaled
from sensing.simulator.protocols.static import FRICTION_RANGE
from sensing.simulator.robot.scene import ScenePlan, plan_scene
from sensing.simulator.similarity.ratios import RELEASED_LOAD_N, LoadScale

TILTS_DEG = (3.0, 11.0, 18.0, 25.0, 32.0, 39.0, 46.0, 54.0)  # tilts of the plane
PATHS_PER_TILT = 3  # they share the tangents of level 2
SEED = 20_261  # seed of the library's paths
TOP = (0.35, 1.15)  # range of the top load, in units of the released 35 N
RADIUS_MM = (0.5, 4.0)  # travel of circles and drags, as in the static protocol
TRAVEL_STATES = 10  # states of the travel
APART_MM = 2.0  # distance to first touch before and after contact
DECIMALS = 8  # decimals of N, mm, s and degrees in the digest of the paths; processors differ by 1e-13
FIRST_STAND = 1000  # number of the first path of the simulated robot


def library_path(number: int, azimuths: int = 4) -> LoadPath:
    """One path of the library; ``number % 3`` determines its kind of travel, the shard its tilt.

    Args:
        number: identity of the path.
        azimuths: number of azimuths (any, uniform) that are labelled.
    """
    rng = np.random.default_rng([SEED, number])
    tilt = TILTS_DEG[number // PATHS_PER_TILT % len(TILTS_DEG)]
    top = RELEASED_LOAD_N * float(rng.uniform(*TOP))
    points = [Waypoint("approach", None, APART_MM)]
    points += [Waypoint("touch", Target(normal_n=float(f))) for f in np.sort(np.exp(rng.uniform(-1, 1.6, 3)))]
    rise = np.linspace(5.0, top, max(3, round(top / 7)))
    points += [Waypoint("load", Target(normal_n=float(force))) for force in rise]
    held = float(rng.uniform(0.3, 1.0)) * top
    points += [Waypoint("unload", Target(normal_n=held))]
    points += (_circle, _drag, _swing)[number % 3](rng, held)
    last = points[-1].target
    assert last is not None and last.normal_n is not None
    points += [Waypoint("unload", replace(last, normal_n=s * last.normal_n)) for s in (0.5, 0.2, 0.06)]
    points.append(Waypoint("clear", None, APART_MM))
    turns = tuple(float(a) for a in rng.uniform(0, 360, azimuths))
    return LoadPath(number, tilt, float(rng.uniform(*FRICTION_RANGE)), turns, timed(points))


def library_paths() -> list[LoadPath]:
    """All paths of the library; those of one tilt are neighbours."""
    return [library_path(number) for number in range(PATHS_PER_TILT * len(TILTS_DEG))]


@lru_cache(maxsize=1)
def plan() -> ScenePlan:
    """The stands of the released robot."""
    return plan_scene()


def load_share() -> float:
    """Part of the 12 kg robot's load at which the stands are solved, so that the largest load is the released 35 N."""
    loads = [point.target.normal_n for path in _released_paths() for point in path.waypoints if point.target]
    return RELEASED_LOAD_N / max(load for load in loads if load is not None)


def stand_paths() -> list[LoadPath]:
    """One path for each loaded endcap of each stand, for D=130 T=8 in Smooth-Sil 950."""
    share = LoadScale(load_share(), 1.0, 1.0)
    return [replace(scaled(path, share), number=FIRST_STAND + k) for k, path in enumerate(_released_paths())]


def path_digest() -> str:
    """SHA-256 of the library's loading paths as JSON: states belong to the paths along which they were solved.

    Numbers are rounded to :data:`DECIMALS`: processors differ in the last bits of sums, sines and linear systems.
    """
    paths = [_rounded(asdict(path)) for path in [*library_paths(), *stand_paths()]]
    return hashlib.sha256(json.dumps(paths, sort_keys=True).encode()).hexdigest()


def touching_steps(path: LoadPath) -> list[int]:
    """Numbers of the waypoints of a path with contact."""
    return [step for step, point in enumerate(path.waypoints) if point.target is not None]


def _released_paths() -> list[LoadPath]:
    return [plan().path(*place)[0] for place in plan().places()]


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(part) for part in value]
    return round(value, DECIMALS) + 0.0 if isinstance(value, float) else value  # + 0.0 turns -0.0 into 0.0


def _circle(rng: np.random.Generator, force_n: float) -> list[Waypoint]:
    radius, heading = float(rng.uniform(*RADIUS_MM)), float(rng.uniform(0, 2 * math.pi))
    sense = float(rng.choice([-1.0, 1.0]))
    return [
        Waypoint("circle", Target(normal_n=force_n, shift_mm=_on_circle(radius, heading, sense, k / TRAVEL_STATES)))
        for k in range(1, TRAVEL_STATES + 1)
    ]


def _drag(rng: np.random.Generator, force_n: float) -> list[Waypoint]:
    """Travel along a line until slip, and half of the way back."""
    reach, heading = float(rng.uniform(2, 8)), float(rng.uniform(0, 2 * math.pi))
    way = [*np.linspace(0, 1, 8)[1:], 0.85, 0.65, 0.4]
    return [
        Waypoint(
            "drag",
            Target(normal_n=force_n, shift_mm=(s * reach * math.cos(heading), s * reach * math.sin(heading))),
        )
        for s in map(float, way)
    ]


def _swing(rng: np.random.Generator, force_n: float) -> list[Waypoint]:
    """Travel along a circle while the force swings, as on a moving robot."""
    radius, heading = float(rng.uniform(*RADIUS_MM)), float(rng.uniform(0, 2 * math.pi))
    swing, beat, sense = float(rng.uniform(0.1, 0.4)), float(rng.uniform(1, 2.5)), float(rng.choice([-1.0, 1.0]))
    points = []
    for k in range(1, TRAVEL_STATES + 1):
        turn = 1.3 * k / TRAVEL_STATES
        force = force_n * (1 + swing * math.sin(2 * math.pi * beat * turn))
        points.append(Waypoint("circle", Target(normal_n=force, shift_mm=_on_circle(radius, heading, sense, turn))))
    return points


def _on_circle(radius_mm: float, heading: float, sense: float, turn: float) -> tuple[float, float]:
    angle = heading + sense * 2 * math.pi * turn
    return radius_mm * (math.sin(angle) - math.sin(heading)), radius_mm * (math.cos(heading) - math.cos(angle))
