"""Ground of the simulated robot: flat, rough, slope, stairs, slippery; with a drop or a push (m, N, s).

    ground(Terrain.ROUGH, seed=3).xml, .heights, .friction

The robot starts over the origin; the ground is level there except on the slope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from sensing.tensegrity.description import Array

FRICTION = 0.7  # E: Coulomb's mu of silicone on concrete or wood
SLIPPERY = 0.3  # Coulomb's mu of the slippery ground
SPIN_LEVER_M = 0.01  # friction torque about the normal over its friction force: 2/3 of a contact of 15 mm radius
ROUGH_M = 0.04  # height between the lowest and the highest places; higher ones are cut off
ROUGH_LENGTH_M = 0.15  # standard deviation of the window that smooths the heights
HALF_M, CELL_M = 12.0, 0.05  # of the rough ground: half its side, distance of its grid points
SLOPE_DEG = 6.0  # inclination of the slope
STEP_M, TREAD_M, STEPS = 0.03, 0.6, 20  # stairs that lead up along the heading: height, depth and number
FIRST_STEP_M = 0.8  # distance of the first step from the origin
DROP_M, LANDS_S = 0.3, 6.0  # height of the drop; time until a dropped robot is at rest
HARD = 'solref="0.002 1" solimp="0.9 0.95 0.001"'  # solver parameters of every contact: a hard one
PUSH_N, PUSH_FROM_S, PUSH_FOR_S = 60.0, 12.0, 0.25  # horizontal force of the push, its beginning and duration


class Terrain(Enum):
    """Terrains that the robot walks on."""

    FLAT = "flat"
    ROUGH = "rough"
    SLOPE = "slope"
    STAIRS = "stairs"
    LOW_FRICTION = "low_friction"
    DROP = "drop"
    PUSH = "push"


@dataclass(frozen=True)
class Ground:
    """The ground in MJCF.

    Attributes:
        xml: geoms of the ground.
        assets: assets of these geoms.
        heights: (N, N) m, heights of a height field; empty without one.
        friction: Coulomb's mu.
        up: (3,) normal of the ground.
        drop_m: height of the drop, m.
        push_n: force of the push, N.
        half_m: distance from the origin to its edge along x and y, m.
    """

    xml: str
    friction: float = FRICTION
    assets: str = ""
    heights: Array = field(default_factory=lambda: np.zeros((0, 0)))
    up: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    drop_m: float = 0.0
    push_n: float = 0.0
    half_m: float = math.inf


def ground(terrain: Terrain, seed: int = 0, heading_deg: float = 0.0) -> Ground:
    """The ground of a terrain.

    Args:
        terrain: kind of terrain.
        seed: seed of the rough ground's heights and of the slope's direction.
        heading_deg: direction in which the stairs lead up, from world x, degrees.
    """
    plane = '<geom name="ground" type="plane" size="0 0 1" {} {}/>'
    rng = np.random.default_rng([seed, 17])
    if terrain is Terrain.ROUGH:
        heights = rough_heights(rng)
        assets = (
            f'<hfield name="rough" nrow="{len(heights)}" ncol="{len(heights)}" size="{HALF_M} {HALF_M} {ROUGH_M} 1"/>'
        )
        xml = f'<geom name="ground" type="hfield" hfield="rough" {_friction(FRICTION)}/>'
        return Ground(xml, assets=assets, heights=heights, half_m=HALF_M)
    if terrain is Terrain.SLOPE:
        angle, azimuth = math.radians(SLOPE_DEG), rng.uniform(0, 2 * math.pi)
        axis = f"{math.cos(azimuth):.9f} {math.sin(azimuth):.9f} 0"
        up = np.array([math.sin(azimuth) * math.sin(angle), -math.cos(azimuth) * math.sin(angle), math.cos(angle)])
        return Ground(plane.format(f'axisangle="{axis} {angle:.9f}"', _friction(FRICTION)), up=up)
    if terrain is Terrain.STAIRS:
        return Ground(plane.format("", _friction(FRICTION)) + "".join(_stair(k, heading_deg) for k in range(STEPS)))
    friction = SLIPPERY if terrain is Terrain.LOW_FRICTION else FRICTION
    drop = DROP_M if terrain is Terrain.DROP else 0.0
    push = PUSH_N if terrain is Terrain.PUSH else 0.0
    return Ground(plane.format("", _friction(friction)), friction, drop_m=drop, push_n=push)


def rough_heights(rng: np.random.Generator) -> Array:
    """(N, N) m, smooth random heights from 0 to :data:`ROUGH_M`."""
    count = round(2 * HALF_M / CELL_M) + 1
    wave = np.fft.fftfreq(count, CELL_M) * 2 * math.pi
    window = np.exp(-((ROUGH_LENGTH_M * wave) ** 2) / 2)
    noise = np.fft.ifft2(np.fft.fft2(rng.normal(size=(count, count))) * np.outer(window, window)).real
    low, high = np.quantile(noise, [0.02, 0.98])
    return np.asarray(ROUGH_M * np.clip((noise - low) / (high - low), 0, 1))


def _friction(value: float) -> str:
    """Coulomb's mu and the lever of the friction about the normal; MuJoCo takes the larger of two geoms' values."""
    return f'friction="{value:g} {SPIN_LEVER_M:g} 0" condim="4" {HARD}'


def _stair(number: int, heading_deg: float) -> str:
    height, heading = (number + 1) * STEP_M, math.radians(heading_deg)
    middle = FIRST_STEP_M + (number + 0.5) * TREAD_M
    return (
        f'<geom type="box" pos="{middle * math.cos(heading):.9g} {middle * math.sin(heading):.9g} {height / 2:g}" '
        f'axisangle="0 0 1 {heading:.9g}" size="{TREAD_M / 2:g} {HALF_M:g} {height / 2:g}" {_friction(FRICTION)}/>'
    )
