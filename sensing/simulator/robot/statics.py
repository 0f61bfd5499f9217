"""Statics of the three-bar robot: which endcaps stand on the ground and what each carries (N, mm; world z up).

Three bars form a twisted prism: bar i runs from endcap 2i on the lower ring to endcap 2i + 1 on the upper one. The
robot weighs 12 kg (P); its size is ours (E). It stands on three endcaps, or ropes hold it at endcaps that do not touch:
then two, one or none touch, as in the paper's four configurations. Endcaps count as rigid spheres: a loaded
endcap on a base of half a metre sinks by some millimetres, which changes the loads by under 2 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.records import TABLE_G_M_S2
from sensing.simulator.solid.element import Array

MASS_KG = 12.0  # P, NET27
WEIGHT_N = MASS_KG * TABLE_G_M_S2
RING_RADIUS_MM = 320.0  # E
BAR_MM = 900.0  # E: between the centres of its two endcaps
TWIST_DEG = 150.0  # of the upper ring against the lower one: pi/2 + pi/n, the n-strut prism's only prestressed state
PAYLOAD_MM = 60.0  # E: the centre of mass lies at random within this distance of the middle
TIP_RANGE_DEG = (2.0, 10.0)  # tilt of the robot when ropes lift a side
PULL_SHARE = 0.5  # part of the friction limit that cables may pull between two endcaps


@dataclass(frozen=True)
class Stand:
    """The robot on the ground.

    Attributes:
        rotation: (6, 3, 3) rotation from endcap to world axes.
        centre_mm: (6, 3) centres of the endcaps' spheres, mm, the lowest at height 0.
        mass_centre_mm: (3,) centre of mass, mm.
        touching: (6,) whether the endcap carries load.
        force_n: (6, 3) force of the ground on each endcap, N.
        rope_n: (6,) upward force of the rope at each endcap, N.
    """

    rotation: Array
    centre_mm: Array
    mass_centre_mm: Array
    touching: NDArray[np.bool_]
    force_n: Array
    rope_n: Array


def prism_mm() -> Array:
    """Centres (6, 3) of the endcaps' spheres, standing upright, lower ring at height 0."""
    azimuth = np.radians([0.0, 120.0, 240.0])
    twist = math.radians(TWIST_DEG)
    height = math.sqrt(BAR_MM**2 - (2 * RING_RADIUS_MM * math.sin(twist / 2)) ** 2)
    endcaps = np.zeros((6, 3))
    endcaps[0::2, 0], endcaps[0::2, 1] = RING_RADIUS_MM * np.cos(azimuth), RING_RADIUS_MM * np.sin(azimuth)
    endcaps[1::2, 0], endcaps[1::2, 1] = (
        RING_RADIUS_MM * np.cos(azimuth + twist),
        RING_RADIUS_MM * np.sin(azimuth + twist),
    )
    endcaps[1::2, 2] = height
    return endcaps


def random_stand(rng: np.random.Generator, contacts: int, friction: float) -> Stand:
    """A stand on 0 to 3 endcaps of the lower ring, the robot turned at random about the vertical.

    Args:
        rng: source of the random numbers.
        contacts: number of endcaps that stand, 0 to 3.
        friction: Coulomb's mu; it limits the cables' horizontal forces.
    """
    endcaps = prism_mm() @ _rotation([0, 0, 1], float(rng.uniform(0, 2 * math.pi))).T
    middle = endcaps.mean(axis=0) + PAYLOAD_MM * rng.uniform(-1, 1, 3) / math.sqrt(3)
    lower = rng.permutation([0, 2, 4])
    standing, hung = lower[:contacts], lower[contacts:]
    if 0 < contacts < 3:
        pivot, axis = endcaps[standing].mean(axis=0), _edge(endcaps, standing, hung)
        tip = _rotation(axis, math.radians(float(rng.uniform(*TIP_RANGE_DEG))))
        endcaps, middle = (endcaps - pivot) @ tip.T + pivot, (middle - pivot) @ tip.T + pivot
    lift = endcaps[:, 2].min() if contacts else endcaps[:, 2].min() - 100.0
    endcaps, middle = endcaps - [0, 0, lift], middle - [0, 0, lift]
    carried = supports(endcaps[lower, :2], middle[:2])
    force, rope = np.zeros((6, 3)), np.zeros(6)
    force[standing, 2], rope[hung] = carried[:contacts], carried[contacts:]
    force += _cables(rng, endcaps, standing, force[:, 2], friction)
    touching = np.zeros(6, dtype=bool)
    touching[standing] = True
    return Stand(endcap_axes(rng, endcaps), endcaps, middle, touching, force, rope)


def supports(places_mm: Array, mass_centre_mm: Array) -> Array:
    """Vertical forces (3,) at three places (3, 2) that hold the weight over (2,): forces and both moments balance."""
    matrix = np.vstack([np.ones(3), places_mm.T])
    return np.asarray(np.linalg.solve(matrix, WEIGHT_N * np.concatenate([[1.0], mass_centre_mm])))


def _cables(
    rng: np.random.Generator, endcaps: Array, standing: NDArray[np.int64], normal_n: Array, friction: float
) -> Array:
    """Horizontal forces (6, 3), N, of tensioned cables between standing endcaps, along their lines; the sum is zero."""
    force = np.zeros((6, 3))
    for first in range(len(standing)):
        for second in range(first):
            i, j = standing[first], standing[second]
            line = endcaps[j] - endcaps[i]
            line[2] = 0.0
            most = PULL_SHARE * friction * min(normal_n[i], normal_n[j]) / 2  # an endcap has two such neighbours
            pull = float(rng.uniform(-most, most)) * line / np.linalg.norm(line)
            force[i] += pull
            force[j] -= pull
    return force


def endcap_axes(rng: np.random.Generator, endcaps: Array) -> Array:
    """Endcap axes in the world (6, 3, 3): z outward along the bar, with a random turn about it.

    Args:
        rng: source of the random numbers.
        endcaps: (6, 3) centres of the endcaps.
    """
    axes = []
    for endcap in range(6):
        outward = endcaps[endcap] - endcaps[endcap ^ 1]
        outward = outward / np.linalg.norm(outward)
        side = np.cross(outward, [0.0, 0.0, 1.0])
        side = side / np.linalg.norm(side)
        roll = float(rng.uniform(0, 2 * math.pi))
        first = math.cos(roll) * side + math.sin(roll) * np.cross(outward, side)
        axes.append(np.stack([first, np.cross(outward, first), outward], axis=1))
    return np.array(axes)


def _edge(endcaps: Array, standing: NDArray[np.int64], hung: NDArray[np.int64]) -> Array:
    """Horizontal axis through the standing endcaps, about which the lifted side rises."""
    away = endcaps[hung].mean(axis=0) - endcaps[standing].mean(axis=0)
    line = endcaps[standing[1]] - endcaps[standing[0]] if len(standing) == 2 else np.cross([0.0, 0.0, 1.0], away)
    line = line / np.linalg.norm(line)
    return np.asarray(line if np.cross(line, away)[2] > 0 else -line)


def _rotation(axis: Array | list[float], angle: float) -> Array:
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)
