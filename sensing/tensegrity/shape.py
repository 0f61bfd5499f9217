"""The shape in which the cables of a tensegrity robot are in balance, without weight (numpy only).

    shape = balanced_shape(robot)                       # near the ends that the robot's file states
    shape.T_world_bar, shape.length_m, shape.tension_n

Notes:
    The shape is a minimum of the cables' energy, sum of k/2 max(0, l - l0)^2, over the poses of rigid bars (Connelly,
    Back 1998; Tibert and Pellegrino 2003, doi:10.1177/0266351103018002012), found by the Levenberg-Marquardt method
    (Marquardt 1963, doi:10.1137/0111030). If a minimum has no energy, every cable is slack and the robot has no shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad.errors import ParameterError
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.vectors import cross

STEPS = 2000  # largest number of steps
ENERGY_J = 1e-9  # energy below which no cable pulls
STEP = 1e-10  # m and rad; a shorter step ends the search


@dataclass(frozen=True)
class Shape:
    """Poses of the bars and forces of the cables.

    Attributes:
        T_world_bar: (B, 4, 4) poses, m.
        length_m, tension_n: (C,) lengths and tensions of the cables.
    """

    T_world_bar: Array
    length_m: Array
    tension_n: Array


def balanced_shape(robot: TensegrityRobot, T_world_bar: Array | None = None) -> Shape:
    """The balanced shape nearest to a start.

    Args:
        robot: robot with its bars and cables.
        T_world_bar: (B, 4, 4) m, poses at the start; None for the ends that the bars state.

    Raises:
        ParameterError: no start: a bar states no ends.
    """
    poses = standing_poses(robot) if T_world_bar is None else np.array(T_world_bar, float)
    stiffness = np.array([cable.stiffness_n_m for cable in robot.cables])
    rest = np.array([cable.rest_m for cable in robot.cables])
    damping, energy = 1e-3, math.inf
    for _ in range(STEPS):
        length, jacobian = cable_lengths(robot, poses)
        stretch = np.maximum(0.0, length - rest)
        energy = float(stiffness @ stretch**2) / 2
        if energy < ENERGY_J:
            break
        pulled = jacobian * (stretch > 0)[:, None]
        hessian = pulled.T @ (stiffness[:, None] * pulled)
        gradient = pulled.T @ (stiffness * stretch)
        step, damping = _descend(robot, poses, -gradient, hessian, damping, energy)
        if step is None or np.abs(step).max() < STEP:
            break
        poses = moved(poses, step)
    length = cable_lengths(robot, poses)[0]
    return Shape(poses, length, stiffness * np.maximum(0.0, length - rest))


def standing_poses(robot: TensegrityRobot) -> Array:
    """(B, 4, 4) m, poses of the bars between the ends that the robot's file states, without a turn about themselves.

    Raises:
        ParameterError: a bar without stated ends.
    """
    poses = np.tile(np.eye(4), (len(robot.bars), 1, 1))
    for pose, bar in zip(poses, robot.bars, strict=True):
        along = bar.ends_m[1] - bar.ends_m[0]
        size = float(np.linalg.norm(along))
        if not (math.isfinite(size) and size > 0):
            raise ParameterError(
                f"bar {bar.name}: ends_m are missing: state where its two ends are", name="ends_m", value=None
            )
        pose[:3, :3] = turn_z_to(along / size)
        pose[:3, 3] = bar.ends_m.mean(axis=0)
    return poses


def turn_z_to(direction: Array) -> Array:
    """(3, 3) shortest rotation that takes z to a unit vector."""
    axis = cross([0.0, 0.0, 1.0], direction)
    sine, cosine = float(np.linalg.norm(axis)), float(direction[2])
    if sine < 1e-9:
        return np.diag([1.0, math.copysign(1, cosine), math.copysign(1, cosine)])
    return rotation_of(axis / sine * math.atan2(sine, cosine))


def rotation_of(vector: Array) -> Array:
    """(3, 3) rotation matrix of a rotation vector, rad (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], float)
    first = math.sin(angle) / angle if angle > 1e-8 else 1.0
    second = (1 - math.cos(angle)) / angle**2 if angle > 1e-8 else 0.5
    return np.asarray(np.eye(3) + first * cross + second * cross @ cross)


def moved(T_world_bar: Array, step: Array) -> Array:
    """Poses after (6 B,) steps: for each bar three of translation (m) and three of rotation (rad, world axes)."""
    poses = T_world_bar.copy()
    for pose, change in zip(poses, step.reshape(-1, 6), strict=True):
        if not change.any():  # most bars of a finite difference
            continue
        pose[:3, 3] += change[:3]
        pose[:3, :3] = rotation_of(change[3:]) @ pose[:3, :3]
    return poses


def cable_lengths(robot: TensegrityRobot, T_world_bar: Array) -> tuple[Array, Array]:
    """((C,) cable lengths, m, (C, 6 B) derivative by the steps of :func:`moved`).

    Args:
        robot: robot with its bars and cables.
        T_world_bar: (B, 4, 4) poses, m.
    """
    number = {bar.name: place for place, bar in enumerate(robot.bars)}
    places = np.array([[number[name] for name in cable.bars] for cable in robot.cables], int).reshape(-1, 2)
    points = np.array([cable.points_m for cable in robot.cables], float).reshape(-1, 2, 3)
    poses = T_world_bar[places, :3]  # (C, 2, 3, 4)
    levers = (poses[..., :3] @ points[..., None])[..., 0]
    ends = poses[..., 3] + levers
    along = ends[:, 1] - ends[:, 0]
    length = np.sqrt((along**2).sum(axis=1))
    along = along / np.maximum(length, 1e-12)[:, None]
    jacobian, rows = np.zeros((len(places), len(robot.bars), 6)), np.arange(len(places))
    for end, sign in enumerate((-1.0, 1.0)):
        (x, y, z), (a, b, c) = levers[:, end].T, along.T
        turned = np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=1)  # lever times direction
        jacobian[rows, places[:, end]] += sign * np.concatenate([along, turned], axis=1)
    return length, jacobian.reshape(len(places), 6 * len(robot.bars))


def _descend(
    robot: TensegrityRobot, poses: Array, downhill: Array, hessian: Array, damping: float, energy: float
) -> tuple[Array | None, float]:
    """A step that lowers the energy, None where there is none; and the damping for the next."""
    stiffness = np.array([cable.stiffness_n_m for cable in robot.cables])
    rest = np.array([cable.rest_m for cable in robot.cables])
    size = max(float(hessian.trace()) / len(hessian), 1e-12)
    while damping < 1e9:
        step: Array = np.asarray(np.linalg.solve(hessian + damping * size * np.eye(len(hessian)), downhill), float)
        step = step * min(1.0, 0.1 / max(float(np.abs(step).max()), 1e-12))  # at most 0.1 m and 6 degrees at once
        stretch = np.maximum(0.0, cable_lengths(robot, moved(poses, step))[0] - rest)
        if float(stiffness @ stretch**2) / 2 < energy:
            return step, max(damping / 5, 1e-9)
        damping *= 4
    return None, damping
