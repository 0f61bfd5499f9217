"""``wide`` and ``steep`` protocols: tilts and loads beyond the authors' grid, with travel on the way (N, mm, s).

``wide`` has any tilt from 0 to 60 degrees and loads to 60 N, so that a model can be trained and tested beyond
``static``. Tilts come from six strata of 10 degrees in turn, and every path passes all loads up to its top, so that six
paths fill a table by tilt and load. ``steep`` covers endcaps of a robot that stands on leaning bars: 45 to 78
degrees, loads to 75 N, friction from 0.2 to 1.2.
"""

from __future__ import annotations

import math

import numpy as np

from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import LoadPath, Waypoint, timed
from sensing.simulator.protocols.static import APPROACH_MM, FRICTION_RANGE

STRATA, STRATUM_DEG = 6, 10.0  # of ``wide``: strata of tilt and their width
TOP_N = (36.0, 60.0)  # of ``wide``: range of the top load
# Of ``steep``: least tilt, width of its six strata, range of the top load, range of the Coulomb coefficient.
STEEP_DEG, STEEP_STRATUM_DEG, STEEP_TOP_N, STEEP_FRICTION = 45.0, 5.5, (36.0, 75.0), (0.2, 1.2)
STEP_N = 5.0  # between set-points
TOUCHES, TOUCH_N = 3, (0.3, 4.5)  # number of light touches before the set-points, and range of their load
TRAVEL_STATES = 7  # states of the arc at the top load
RADIUS_MM = (0.5, 4.0)  # E: of the arc, as in the static protocol
DRIFT_MM = 0.25  # E: standard deviation of the travel along each axis from one set-point to the next
UNLOAD = (0.8, 0.55, 0.35, 0.2, 0.07)  # of the top load


def wide_path(seed: int, number: int, azimuths: int) -> LoadPath:
    """One press: set-points up to the top load with some travel, an arc at the top, unloading.

    Args:
        seed: seed of the data set.
        number: number of the path.
        azimuths: number of azimuths (any, uniform) that are labelled.
    """
    rng = np.random.default_rng([seed, number, 3])
    tilt, top = STRATUM_DEG * (number % STRATA + float(rng.uniform())), float(rng.uniform(*TOP_N))
    return _press(rng, number, azimuths, tilt, top, FRICTION_RANGE)


def steep_path(seed: int, number: int, azimuths: int) -> LoadPath:
    """One press as in :func:`wide_path`, at tilts far from the tip.

    Args:
        seed: seed of the data set.
        number: number of the path.
        azimuths: number of azimuths that are labelled.
    """
    rng = np.random.default_rng([seed, number, 4])
    tilt = STEEP_DEG + STEEP_STRATUM_DEG * (number % STRATA + float(rng.uniform()))
    return _press(rng, number, azimuths, tilt, float(rng.uniform(*STEEP_TOP_N)), STEEP_FRICTION)


def _press(
    rng: np.random.Generator, number: int, azimuths: int, tilt: float, top: float, frictions: tuple[float, float]
) -> LoadPath:
    steps = np.arange(STEP_N, top - 0.5 * STEP_N, STEP_N)
    loads = [
        *np.sort(rng.uniform(*TOUCH_N, TOUCHES)),
        *(steps + rng.uniform(-0.5, 0.5, len(steps)) * STEP_N * 0.9),
        top,
    ]
    shifts = np.cumsum(rng.normal(0.0, DRIFT_MM, (len(loads), 2)), axis=0)
    points = [Waypoint("approach", None, apart) for apart in APPROACH_MM]
    for k, (load, shift) in enumerate(zip(loads, shifts, strict=True)):
        points.append(_pressed("touch" if k < TOUCHES else "load", load, shift))
    arc = _arc(rng, shifts[-1])
    points += [_pressed("circle", top, shift) for shift in arc]
    points += [_pressed("unload", part * top, arc[-1]) for part in UNLOAD]
    points.append(Waypoint("clear", None, APPROACH_MM[-1]))
    friction = float(rng.uniform(*frictions))  # before the azimuths, so that their count does not change it
    return LoadPath(number, tilt, friction, tuple(float(a) for a in rng.uniform(0, 360, azimuths)), timed(points))


def _pressed(phase: str, load_n: float, shift_mm: np.ndarray) -> Waypoint:
    return Waypoint(phase, Target(normal_n=float(load_n), shift_mm=(float(shift_mm[0]), float(shift_mm[1]))))


def _arc(rng: np.random.Generator, start_mm: np.ndarray) -> np.ndarray:
    """(TRAVEL_STATES, 2) travel along part of a circle from the start, mm; heading, sense and length are random."""
    radius = float(rng.uniform(*RADIUS_MM))
    heading, sense = float(rng.uniform(0, 2 * math.pi)), float(rng.choice([-1.0, 1.0]))
    angle = (
        heading + sense * float(rng.uniform(0.3, 1.0)) * 2 * math.pi * np.arange(1, TRAVEL_STATES + 1) / TRAVEL_STATES
    )
    along = np.stack([np.sin(angle) - math.sin(heading), math.cos(heading) - np.cos(angle)], axis=1)
    return np.asarray(start_mm + radius * along)
