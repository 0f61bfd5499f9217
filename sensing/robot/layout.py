"""The robot's description as arrays: reference points, levers and places in the error state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.frames import MM_PER_M
from sensing.tensegrity.description import Array, InertialSensor, TensegrityRobot


@dataclass(frozen=True)
class Layout:
    """Indices and geometry of a robot that the filter needs.

    A bar's reference point, whose place and velocity are estimated, is its accelerometer, else its centre of mass.

    Attributes:
        robot: the description.
        leader: bar whose accelerometer all others follow.
        reference_m: (B, 3) reference points, bar frame.
        sensor_of_bar: names, None for a bar without.
        sensor_turn: (B, 3, 3) sensor axes to bar axes.
        has_force: (B,) whether it has an accelerometer.
        cable_bars: (C, 2) of the measured cables.
        cable_levers: (C, 2, 3) from the reference points.
        endcap_bar: (E,).
        endcap_lever: (E, 3) sphere's centre from the reference point, bar axes.
        endcap_turn: (E, 3, 3) endcap axes to bar axes.
        radius_m, centre_height_m: (E,).
        mass_lever: (B, 3) centre of mass from the reference point.
        mass_kg: (B,).
    """

    robot: TensegrityRobot
    leader: int
    reference_m: Array
    sensor_of_bar: tuple[str | None, ...]
    sensor_turn: Array
    has_force: np.ndarray
    cable_bars: np.ndarray
    cable_levers: Array
    endcap_bar: np.ndarray
    endcap_lever: Array
    endcap_turn: Array
    radius_m: Array
    centre_height_m: Array
    mass_lever: Array
    mass_kg: Array

    @property
    def bars(self) -> int:
        """How many bars."""
        return len(self.reference_m)

    @property
    def endcaps(self) -> int:
        """How many endcaps."""
        return len(self.endcap_bar)

    @property
    def size(self) -> int:
        """Numbers in the error state."""
        return 15 * self.bars + 3 * self.endcaps + 2

    def turn(self, bar: int) -> slice:
        """Of a bar's turn in the error state."""
        return slice(3 * bar, 3 * bar + 3)

    def place(self, bar: int) -> slice:
        """Of the place of a bar's reference point."""
        return self.turn(self.bars + bar)

    def velocity(self, bar: int) -> slice:
        """Of its velocity."""
        return self.turn(2 * self.bars + bar)

    def rate_bias(self, bar: int) -> slice:
        """Of its gyroscope's bias."""
        return self.turn(3 * self.bars + bar)

    def force_bias(self, bar: int) -> slice:
        """Of its accelerometer's bias."""
        return self.turn(4 * self.bars + bar)

    def anchor(self, endcap: int) -> slice:
        """Of an endcap's anchor."""
        return self.turn(5 * self.bars + endcap)

    @property
    def creep(self) -> int:
        """Of the creep of endcaps that turn under load; the last but one."""
        return self.size - 2

    @property
    def softness(self) -> int:
        """Of the softness of all domes; the last one."""
        return self.size - 1


def layout_of(robot: TensegrityRobot) -> Layout:
    """The arrays of a robot.

    Raises:
        ParameterError: a bar with two inertial sensors.
    """
    sensors: dict[str, InertialSensor] = {}
    for sensor in robot.sensors:
        if sensor.bar in sensors:
            raise ParameterError(
                f"bar {sensor.bar}: two inertial sensors, {sensors[sensor.bar].name} and {sensor.name}: give one a bar",
                name="sensor", value=sensor.name,
            )  # fmt: skip
        sensors[sensor.bar] = sensor
    reference, turns = np.zeros((len(robot.bars), 3)), np.tile(np.eye(3), (len(robot.bars), 1, 1))
    has_force = np.zeros(len(robot.bars), np.int64)
    for b, bar in enumerate(robot.bars):
        found = sensors.get(bar.name)
        has_force[b] = bool(found and found.accelerometer)
        reference[b] = found.T_bar_imu[:3, 3] if found and found.accelerometer else bar.centre_of_mass_m
        if found:
            turns[b] = found.T_bar_imu[:3, :3]
    cables = [cable for cable in robot.cables if cable.measured]
    pairs = np.array([[robot.bar_number(name) for name in cable.bars] for cable in cables], np.int64).reshape(-1, 2)
    levers = np.array([cable.points_m for cable in cables], float).reshape(-1, 2, 3) - reference[pairs]
    of = np.array([robot.bar_number(endcap.bar) for endcap in robot.endcaps], np.int64)
    designs = [EndcapParams(endcap.diameter_mm, endcap.wall_mm) for endcap in robot.endcaps]
    heights = np.array([design.centre_height_mm for design in designs]) / MM_PER_M
    poses = np.array([endcap.T_bar_endcap for endcap in robot.endcaps])
    return Layout(
        robot, int(has_force.argmax()), reference,
        tuple(sensors[bar.name].name if bar.name in sensors else None for bar in robot.bars), turns, has_force,
        pairs, levers, of, poses[:, :3, 3] + heights[:, None] * poses[:, :3, 2] - reference[of],
        np.ascontiguousarray(poses[:, :3, :3]), np.array([design.outer_radius_mm for design in designs]) / MM_PER_M,
        heights, np.array([bar.centre_of_mass_m for bar in robot.bars]) - reference,
        np.array([bar.mass_kg for bar in robot.bars]),
    )  # fmt: skip
