"""The robot's description as arrays: reference points, levers and indices of the error state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.frames import MM_PER_M
from sensing.robot.settings import Settings
from sensing.tensegrity.description import Array, InertialSensor, TensegrityRobot

RELEASED = EndcapParams(130.0, 8.0)  # design of the dome that the settings describe


@dataclass(frozen=True)
class Layout:
    """Indices and geometry of a robot for the filter.

    A bar's reference point, whose position and velocity are estimated, is its accelerometer, else its centre of mass.

    Attributes:
        robot: description of the robot.
        leader: number of the bar whose accelerometer, or gyroscope where none has one, is the reference of all others;
            while an accelerometer is silent, another one leads (:meth:`led_by`).
        reference_m: (B, 3) reference points, bar frame, m.
        sensor_of_bar: names of the inertial sensors, None for a bar without.
        sensor_turn: (B, 3, 3) rotations from sensor to bar axes.
        has_force: (B,) whether the bar has an accelerometer.
        cable_bars: (C, 2) bars of the measured cables.
        cable_levers: (C, 2, 3) attachments from the reference points, bar axes, m.
        endcap_bar: (E,) bar of each endcap.
        endcap_lever: (E, 3) sphere's centre from the reference point, bar axes, m.
        endcap_turn: (E, 3, 3) rotations from endcap to bar axes.
        radius_m, centre_height_m: (E,) radius of the sphere, and height of its centre over the mating plane, m.
        mass_lever: (B, 3) centre of mass from the reference point, bar axes, m.
        mass_kg: (B,) masses of the bars, kg.
        yields: (E,) yield of each dome over that of D=130 T=8 under the same force, by its size.
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
    yields: Array

    @property
    def bars(self) -> int:
        """Number of bars."""
        return len(self.reference_m)

    @property
    def endcaps(self) -> int:
        """Number of endcaps."""
        return len(self.endcap_bar)

    @property
    def vectors(self) -> int:
        """Number of the error state's components that belong to vectors of three; the other ones come after them."""
        return 15 * self.bars + 3 * self.endcaps

    @property
    def size(self) -> int:
        """Size N of the error state."""
        return self.vectors + 3

    def compliance_m_n(self, endcap: int, settings: Settings) -> float:
        """Yield of an endcap's dome under 1 N, m/N: as the description states it, else by its size.

        A shell under a point load sinks by about F R / (mu T^2) (Reissner 1946, doi:10.1002/sapm194625180).

        Args:
            endcap: number of the endcap.
            settings: assumptions of the estimator.
        """
        stated = self.robot.endcaps[endcap].compliance_m_n
        return settings.compliance_m_n * float(self.yields[endcap]) if stated is None else stated

    def yield_delay_s(self, endcap: int, settings: Settings) -> float:
        """Damping of an endcap's dome over its stiffness, s: as the description states it, else by the settings.

        Args:
            endcap: number of the endcap.
            settings: assumptions of the estimator.
        """
        stated = self.robot.endcaps[endcap].yield_delay_s
        return settings.yield_delay_s if stated is None else stated

    @property
    def leaders(self) -> tuple[int, ...]:
        """Numbers of the bars that may lead: those with an accelerometer, else the first one with a gyroscope."""
        return tuple(int(bar) for bar in np.flatnonzero(self.has_force)) or (self.leader,)

    def led_by(self, bar: int) -> Layout:
        """The same robot with another leading bar.

        Args:
            bar: number of the bar.
        """
        return replace(self, leader=bar)

    def turn(self, bar: int) -> slice:
        """Indices of a bar's rotation in the error state."""
        return slice(3 * bar, 3 * bar + 3)

    def place(self, bar: int) -> slice:
        """Indices of the position of a bar's reference point in the error state."""
        return self.turn(self.bars + bar)

    def velocity(self, bar: int) -> slice:
        """Indices of the velocity of a bar's reference point in the error state."""
        return self.turn(2 * self.bars + bar)

    def rate_bias(self, bar: int) -> slice:
        """Indices of a bar's gyroscope bias in the error state."""
        return self.turn(3 * self.bars + bar)

    def force_bias(self, bar: int) -> slice:
        """Indices of a bar's accelerometer bias in the error state."""
        return self.turn(4 * self.bars + bar)

    def anchor(self, endcap: int) -> slice:
        """Indices of an endcap's anchor in the error state."""
        return self.turn(5 * self.bars + endcap)

    @property
    def delay(self) -> int:
        """Index of the delay that all domes have in common in the error state; the last but two."""
        return self.size - 3

    @property
    def creep(self) -> int:
        """Index of the creep of endcaps that turn under load in the error state; the last but one."""
        return self.size - 2

    @property
    def softness(self) -> int:
        """Index of the softness of all domes in the error state; the last one."""
        return self.size - 1


def layout_of(robot: TensegrityRobot) -> Layout:
    """The arrays of a robot.

    Raises:
        ParameterError: a bar with two inertial sensors, or no cable whose length is measured.
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
    if not cables:
        raise ParameterError(
            f"{robot.name}: no cable has measured = true: the estimate begins with their lengths", name="measured"
        )
    pairs = np.array([[robot.bar_number(name) for name in cable.bars] for cable in cables], np.int64).reshape(-1, 2)
    levers = np.array([cable.points_m for cable in cables], float).reshape(-1, 2, 3) - reference[pairs]
    of = np.array([robot.bar_number(endcap.bar) for endcap in robot.endcaps], np.int64)
    designs = [EndcapParams(endcap.diameter_mm, endcap.wall_mm) for endcap in robot.endcaps]
    heights = np.array([design.centre_height_mm for design in designs]) / MM_PER_M
    softer = np.array([design.outer_radius_mm / design.wall_mm**2 for design in designs])
    poses = np.array([endcap.T_bar_endcap for endcap in robot.endcaps])
    leads = has_force if has_force.any() else np.array([bar.name in sensors for bar in robot.bars])
    return Layout(
        robot, int(leads.argmax()), reference,
        tuple(sensors[bar.name].name if bar.name in sensors else None for bar in robot.bars), turns, has_force,
        pairs, levers, of, poses[:, :3, 3] + heights[:, None] * poses[:, :3, 2] - reference[of],
        np.ascontiguousarray(poses[:, :3, :3]), np.array([design.outer_radius_mm for design in designs]) / MM_PER_M,
        heights, np.array([bar.centre_of_mass_m for bar in robot.bars]) - reference,
        np.array([bar.mass_kg for bar in robot.bars]), softer / (RELEASED.outer_radius_mm / RELEASED.wall_mm**2),
    )  # fmt: skip
