"""Tips: changes of the cables that move a robot's mass over an edge of the face on which it stands.

    tips = Tips(load_robot())
    tips.faces                                          # what it can stand on: three endcaps each
    tips.over(tips.faces[0], lifted=0).change_m         # of the rest lengths

Notes:
    Statics without weight: the cables' balanced shape q of rest lengths r has g(q, r) = J' k max(0, l - r) = 0, so its
    derivative is dq/dr = H^+ J' k, with H = dg/dq and l the lengths. The mass is moved toward an edge by the smallest
    change of r, step by step. ``tips.csv`` holds the tips of the robot that ships, found by a similar method before
    this module existed; tips of a robot with another mechanism are computed when they are first needed.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from pathlib import Path

import numpy as np

from cad.errors import ParameterError
from sensing.simulator.walk.mjcf import sphere_centre_m
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.shape import Shape, balanced_shape, cable_lengths, moved

TABLE = Path(__file__).with_name("tips.csv")  # tips of the robot that ships
BEYOND_SHARE = 0.25  # distance by which the mass passes the edge, over the least height of the mass over a face
MOST_SHARE = 0.41  # of a rest length: its largest change
STEP_SHARE, STEPS = 0.06, 30  # largest change in one step, of a rest length; largest number of steps
MARGIN_M = 1e-3  # distance beyond the goal at which a step aims
LEAST_N, TIGHTER_SHARE = 2.0, 0.01  # cables that pull less are shortened by this part of their rest length in a step
NUDGE = 1e-5  # step of finite differences, m and rad
FLAT_M2, LEVEL_M = 1e-6, 1e-4  # limits for three centres in a line, and for other centres in the plane of a face
Face = tuple[int, ...]
_FOUND: dict[bytes, dict[tuple[Face, int], Tip]] = {}  # tips of the robots of this process: minutes for many runs


@dataclass(frozen=True)
class Tip:
    """A tip: the robot leaves a face over one of its edges.

    Attributes:
        face: numbers of the three endcaps on the ground.
        lifted: number of the endcap that leaves the ground.
        change_m: (C,) changes of the rest lengths, m.
    """

    face: Face
    lifted: int
    change_m: Array


@lru_cache(maxsize=1)
def load_tips(path: Path = TABLE) -> tuple[Tip, ...]:
    """The tips of the three-bar robot that ships."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    return tuple(
        Tip(tuple(int(digit) for digit in face), int(lifted), np.array(change, float) / 1000)
        for face, lifted, *change in rows
    )


class Tips:
    """The faces of a robot and its tips from each.

    Args:
        robot: any robot whose endcaps span a body with triangular faces.

    Raises:
        ParameterError: there is no face to stand on, or a bar without stated ends.
    """

    def __init__(self, robot: TensegrityRobot) -> None:
        self.robot = robot
        known = load_tips() if _mechanism(robot) == _mechanism(load_robot()) else ()
        self._found = _FOUND.setdefault(_identity(robot), {(tip.face, tip.lifted): tip for tip in known})
        self._standing = balanced_shape(robot)
        self.faces = sorted({tip.face for tip in known}) or hull_faces(
            endcap_centres(robot, self._standing.T_world_bar)
        )
        if not self.faces:
            raise ParameterError(
                f"{robot.name}: its {len(robot.endcaps)} endcaps span no body with faces to stand on: it cannot walk",
                name="endcap", value=len(robot.endcaps),
            )  # fmt: skip
        self._beyond_m = BEYOND_SHARE * min(_height_m(robot, self._standing.T_world_bar, face) for face in self.faces)

    def over(self, face: Face, lifted: int) -> Tip:
        """The tip that leaves a face; if the cables cannot complete it, the largest part of it.

        Args:
            face: one of ``faces``.
            lifted: endcap of the face that leaves the ground.
        """
        if (face, lifted) not in self._found:
            self._found[face, lifted] = Tip(face, lifted, self._change(face, lifted))
        return self._found[face, lifted]

    def _change(self, face: Face, lifted: int) -> Array:
        rest = np.array([cable.rest_m for cable in self.robot.cables])
        change, robot, shape = np.zeros(len(rest)), self.robot, self._standing
        for _ in range(STEPS):
            left_m = inside_edge_m(robot, shape.T_world_bar, face, lifted) + self._beyond_m
            loose = shape.tension_n < LEAST_N
            if left_m <= 0 and not loose.any():
                break
            slopes = _edge_slopes(robot, shape, face, lifted) * (np.abs(change) < MOST_SHARE * rest)
            step = -max(left_m + MARGIN_M, 0.0) / max(float(slopes @ slopes), 1e-12) * slopes
            step *= min(1.0, STEP_SHARE * float(rest.min()) / max(float(np.abs(step).max()), 1e-12))
            step[loose] = np.minimum(step[loose], -TIGHTER_SHARE * rest[loose])
            change = np.clip(change + step, -MOST_SHARE * rest, MOST_SHARE * rest)
            robot = with_change(self.robot, change)
            shape = balanced_shape(robot, shape.T_world_bar)
        return change


def with_change(robot: TensegrityRobot, change_m: Array) -> TensegrityRobot:
    """The robot with other rest lengths.

    Args:
        robot: description of the robot.
        change_m: (C,) changes of its rest lengths, m.
    """
    cables = zip(robot.cables, change_m.tolist(), strict=True)
    return replace(robot, cables=tuple(replace(cable, rest_m=cable.rest_m + change) for cable, change in cables))


def endcap_centres(robot: TensegrityRobot, poses: Array) -> Array:
    """(E, 3) m, centres of the endcaps' untouched spheres in the world."""
    centres = []
    for endcap in robot.endcaps:
        pose = poses[robot.bar_number(endcap.bar)]
        centres.append(pose[:3, :3] @ sphere_centre_m(endcap) + pose[:3, 3])
    return np.array(centres)


def outward(centres: Array, face: Face) -> Array:
    """(3,) unit normal of a face, away from the robot's middle.

    Args:
        centres: (E, 3) m, centres of the endcaps.
        face: numbers of three endcaps.
    """
    first, second, third = centres[list(face)]
    (ax, ay, az), (bx, by, bz) = second - first, third - first
    normal = np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    normal = normal / np.linalg.norm(normal)
    return np.asarray(normal if normal @ (first - centres.mean(axis=0)) > 0 else -normal)


def hull_faces(centres: Array) -> list[Face]:
    """The triples of endcaps that have all others on one side.

    Args:
        centres: (E, 3) m, centres of the endcaps.
    """
    faces: list[Face] = []
    for face in combinations(range(len(centres)), 3):
        first, second, third = centres[list(face)]
        if np.linalg.norm(np.cross(second - first, third - first)) < FLAT_M2:
            continue
        if len(centres) > 3 and ((centres - first) @ outward(centres, face)).max() < LEVEL_M:
            faces.append(face)
    return faces


def inside_edge_m(robot: TensegrityRobot, poses: Array, face: Face, lifted: int) -> float:
    """Distance, m, of the mass from the edge that stays, along the face; negative beyond the edge.

    Args:
        robot: robot with its masses.
        poses: (B, 4, 4) m, T_world_bar.
        face: numbers of three endcaps.
        lifted: the endcap that is not on the edge.
    """
    centres = endcap_centres(robot, poses)
    first, second = (centres[number] for number in face if number != lifted)
    along = (second - first) / np.linalg.norm(second - first)
    inward = centres[lifted] - first
    inward = inward - (inward @ along) * along
    return float((centre_of_mass_m(robot, poses) - first) @ inward / np.linalg.norm(inward))


def centre_of_mass_m(robot: TensegrityRobot, poses: Array) -> Array:
    """(3,) centre of mass, m, in the world.

    Args:
        robot: robot with its masses.
        poses: (B, 4, 4) m, T_world_bar.
    """
    mass = np.array([bar.mass_kg for bar in robot.bars])
    places = [pose[:3, :3] @ bar.centre_of_mass_m + pose[:3, 3] for pose, bar in zip(poses, robot.bars, strict=True)]
    return np.asarray(mass @ np.array(places) / mass.sum())


def _edge_slopes(robot: TensegrityRobot, shape: Shape, face: Face, lifted: int) -> Array:
    """(C,) derivative of the mass's distance from the edge by the rest lengths."""
    poses, size = shape.T_world_bar, 6 * len(robot.bars)
    stiffness = np.array([cable.stiffness_n_m for cable in robot.cables]) * (shape.tension_n > 0)
    hessian, of_edge = np.empty((size, size)), np.empty(size)
    for column, nudge in enumerate(NUDGE * np.eye(size)):
        ahead, behind = moved(poses, nudge), moved(poses, -nudge)
        hessian[:, column] = (_pull(robot, ahead) - _pull(robot, behind)) / (2 * NUDGE)
        edges = (inside_edge_m(robot, each, face, lifted) for each in (ahead, behind))
        of_edge[column] = (next(edges) - next(edges)) / (2 * NUDGE)
    pulls = cable_lengths(robot, poses)[1].T * stiffness
    # rigid motions of the robot and a bar's rotation about its axis change no cable length: they are left out
    return np.asarray(of_edge @ np.linalg.pinv(hessian, rcond=1e-6) @ pulls)


def _pull(robot: TensegrityRobot, poses: Array) -> Array:
    """(6 B,) gradient of the cables' energy by the bars' poses."""
    length, jacobian = cable_lengths(robot, poses)
    stretch = length - np.array([cable.rest_m for cable in robot.cables])
    return np.asarray((np.array([cable.stiffness_n_m for cable in robot.cables]) * np.maximum(0.0, stretch)) @ jacobian)


def _height_m(robot: TensegrityRobot, poses: Array, face: Face) -> float:
    """Height of the mass over a face, m."""
    centres = endcap_centres(robot, poses)
    return float((centres[face[0]] - centre_of_mass_m(robot, poses)) @ outward(centres, face))


def _identity(robot: TensegrityRobot) -> bytes:
    """All numbers and names on which the tips of a robot depend, to the bit."""
    cables, endcaps = robot.cables, robot.endcaps
    parts = [bar.centre_of_mass_m for bar in robot.bars] + [bar.ends_m.ravel() for bar in robot.bars]
    parts += [cable.points_m.ravel() for cable in cables] + [sphere_centre_m(endcap) for endcap in endcaps]
    numbers = [bar.mass_kg for bar in robot.bars] + [x for one in cables for x in (one.rest_m, one.stiffness_n_m)]
    names = [bar.name for bar in robot.bars], [cable.bars for cable in cables], [endcap.bar for endcap in endcaps]
    return np.concatenate([*parts, numbers]).tobytes() + repr(names).encode()


def _mechanism(robot: TensegrityRobot) -> bytes:
    """Data on which the tips of a robot depend; a common factor on all masses, or all stiffnesses, does not matter."""
    cables, stiffness = robot.cables, np.array([cable.stiffness_n_m for cable in robot.cables])
    mass = np.array([bar.mass_kg for bar in robot.bars])
    parts = [np.append(cable.points_m.ravel(), cable.rest_m) for cable in cables]
    parts += [np.array([robot.bar_number(name) for name in cable.bars], float) for cable in cables]
    parts += [np.append(sphere_centre_m(endcap), robot.bar_number(endcap.bar)) for endcap in robot.endcaps]
    parts += [stiffness / stiffness.sum(), mass / mass.sum(), *(bar.centre_of_mass_m for bar in robot.bars)]
    return np.concatenate(parts).round(9).tobytes()
