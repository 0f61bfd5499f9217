"""Simulates one run of the robot over a terrain; the result is the true motion.

walk = simulate_walk(load_robot(), Terrain.ROUGH, TippingGait(), seed=1, duration_s=40.0)
walk.T_world_bar, walk.force_n, walk.slip_m_s
"""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np

from cad.errors import ParameterError
from sensing.simulator.walk.gait import TippingGait
from sensing.simulator.walk.mjcf import TIMESTEP_S, Dome, centre_height_m, robot_mjcf
from sensing.simulator.walk.terrain import LANDS_S, PUSH_FOR_S, PUSH_FROM_S, ROUGH_M, Ground, Terrain, ground
from sensing.simulator.walk.tips import endcap_centres
from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.shape import balanced_shape, rotation_of

RELEASED = (130.0, 8.0)  # D and T of the endcaps of the robot that ships, mm
SAMPLE_S = 0.005  # interval of the samples of the truth
SETTLE_S = 5.0  # simulated time before the run, which is not recorded
# Rate of a bar about its axis above which it is braked before a run, rad/s; for how long, s; E: time constant, s.
# Nothing else brakes it where cables are tied on the axis; knots of real cables do, and a run begins at rest.
SPINS_RAD_S, BRAKE_S, BRAKED_IN_S = 0.3, 3.0, 0.1
CABLE_DAMPING_NS_M = 40.0  # damping of a cable
GAIT_STEPS = 20  # time steps of the simulation between two of the gait


class Simulation:
    """The compiled model and its state, with the ground's reaction on each endcap."""

    def __init__(self, robot: TensegrityRobot, surface: Ground, poses: Array, dome: Dome = Dome()) -> None:  # noqa: B008
        """Compile the model.

        Args:
            robot: description of the robot.
            surface: ground below it.
            poses: (B, 4, 4) m, T_world_bar at the start.
            dome: compliance of its endcaps.
        """
        self.robot = robot
        self.model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, surface, poses, dome))
        if surface.heights.size:
            self.model.hfield_data[:] = (surface.heights / ROUGH_M).ravel()
        self.data = mujoco.MjData(self.model)
        bodies = [
            mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, f"bar{number}") for number in range(len(robot.bars))
        ]
        self.bodies = np.array(bodies)
        self.place_at = self.model.jnt_qposadr[self.model.body_jntadr[self.bodies]]
        self.velocity_at = self.model.jnt_dofadr[self.model.body_jntadr[self.bodies]]
        geoms = [
            mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_GEOM, f"dome{number}")
            for number in range(len(robot.endcaps))
        ]
        self.geoms = np.array(geoms, int)
        self.domes = {geom: number for number, geom in enumerate(geoms)}
        self.shells = self.model.geom_bodyid[geoms]
        slides = self.model.jnt_dofadr[self.model.body_jntadr[self.shells]]
        self.slides = slides[:, None] + np.arange(3)
        self.stiffness = np.array([cable.stiffness_n_m for cable in robot.cables])
        self.rest_m = np.array([cable.rest_m for cable in robot.cables])
        self.tension_n = np.zeros(len(robot.cables))  # in the last step
        mujoco.mj_forward(self.model, self.data)

    def step(self) -> None:
        """One time step; a cable's damping is at most its pull."""
        self.model.tendon_lengthspring[:, 1] = self.rest_m
        pull = self.stiffness * np.maximum(0.0, self.data.ten_length - self.rest_m)
        damping = CABLE_DAMPING_NS_M * self.data.ten_velocity
        self.data.ctrl[:] = np.where(pull > 0, np.clip(damping, -pull, pull), 0.0)
        self.tension_n = pull + self.data.ctrl
        mujoco.mj_step(self.model, self.data)

    @property
    def poses(self) -> Array:
        """(B, 4, 4) m, T_world_bar."""
        poses, turn = np.tile(np.eye(4), (len(self.bodies), 1, 1)), np.zeros(9)
        for pose, at in zip(poses, self.place_at, strict=True):  # not xmat, which is that at the beginning of the step
            mujoco.mju_quat2Mat(turn, self.data.qpos[at + 3 : at + 7])
            pose[:3, :3], pose[:3, 3] = turn.reshape(3, 3), self.data.qpos[at : at + 3]
        return poses

    @property
    def velocities(self) -> Array:
        """(B, 6) velocity of the bar's origin (m/s, world axes) and angular velocity (rad/s, bar axes)."""
        return np.array([self.data.qvel[at : at + 6] for at in self.velocity_at])

    @property
    def ground_force_n(self) -> Array:
        """(E, 3) force of the ground on each dome in the last step, N, world axes; its slides have the bar's axes."""
        rotation = self.data.xmat[self.shells].reshape(-1, 3, 3)
        return np.asarray(np.einsum("nij,nj->ni", rotation, self.data.qfrc_constraint[self.slides]))

    def contacts(self) -> Array:
        """(E, 12) contact of each endcap, world axes: torque N m about its point, that point m, slip m/s, normal.

        Several contacts of an endcap are merged: torques are added, the rest is averaged by force. 0 without contact.
        """
        result, parts = np.zeros((len(self.domes), 12)), np.zeros(6)
        found: dict[int, list[tuple[Array, Array, Array]]] = {}
        for place in range(self.data.ncon):
            contact = self.data.contact[place]
            number = self.domes.get(contact.geom2, self.domes.get(contact.geom1))
            mujoco.mj_contactForce(self.model, self.data, place, parts)
            axes = contact.frame.reshape(3, 3)
            sign = 1.0 if contact.geom2 in self.domes else -1.0
            if number is not None and parts[0] > 0:
                slip = self._slip(contact.pos, number, axes[0])
                force, torque = sign * axes.T @ parts[:3], sign * axes.T @ parts[3:]
                where = np.concatenate([contact.pos, slip, sign * axes[0]])
                found.setdefault(number, []).append((force, torque, where))
        for number, each in found.items():
            weight = np.array([np.linalg.norm(force) for force, *_ in each])
            mean = weight @ np.array([where for *_, where in each]) / weight.sum()
            for force, torque, where in each:
                result[number, :3] += torque + skew(where[:3] - mean[:3]) @ force
            result[number, 3:9] = mean[:6]
            result[number, 9:] = mean[6:] / np.linalg.norm(mean[6:])
        return result

    def _slip(self, point: Array, number: int, normal: Array) -> Array:
        """(3,) velocity of the dome's skin at a point along the ground, m/s."""
        body, velocity = int(self.shells[number]), np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        of_skin = velocity[3:] + skew(velocity[:3]) @ (point - self.data.xpos[body])
        return np.asarray(of_skin - normal * (normal @ of_skin))


def simulate_walk(
    robot: TensegrityRobot,
    terrain: Terrain = Terrain.FLAT,
    gait: TippingGait | None = None,
    seed: int = 1,
    duration_s: float = 40.0,
    progress: Callable[[float], None] | None = None,
) -> Walk:
    """Simulate a run; the seed determines attitude and ground, and the direction of the push.

    Args:
        robot: robot that rolls.
        terrain: terrain of the run.
        gait: gait of the robot; None for that of tuning.
        seed: seed of all random numbers.
        duration_s: duration of the run, s.
        progress: called with the simulated time, s, every 0.1 s.

    Raises:
        ParameterError: the robot rolls off the ground before the end, or a bar is lighter than its domes.
    """
    gait = gait or TippingGait()
    surface = ground(terrain, seed, gait.heading_deg)
    lands_s = LANDS_S if surface.drop_m else 0.0  # the gait begins with a robot that stands
    rng = np.random.default_rng([seed, 29])
    simulation = Simulation(robot, surface, _lying(robot, surface, rng))
    if not surface.drop_m:
        _settle(simulation)
    push = surface.push_n * _horizontal(rng.uniform(0, 2 * math.pi))
    rows = _Rows(simulation)
    rows.add(0.0)
    for number in range(round(duration_s / TIMESTEP_S)):
        time_s = number * TIMESTEP_S
        if number % GAIT_STEPS == 0:
            simulation.rest_m = gait.rest_lengths(
                robot, simulation.poses, time_s - lands_s, simulation.rest_m, GAIT_STEPS * TIMESTEP_S
            )
        pushed = PUSH_FROM_S <= time_s < PUSH_FROM_S + PUSH_FOR_S
        simulation.data.xfrc_applied[simulation.bodies[0], :3] = push if pushed else 0.0
        simulation.step()
        rows.push()
        if (number + 1) % round(SAMPLE_S / TIMESTEP_S) == 0:
            rows.add((number + 1) * TIMESTEP_S)
        if (number + 1) % 100 == 0:
            _require_ground(surface, endcap_centres(robot, simulation.poses), time_s)
            if progress:
                progress(time_s)
    return rows.walk(terrain.value, seed, surface.friction)


def _settle(simulation: Simulation) -> None:
    """Let the robot come to rest; bars that still spin about their axes are braked."""
    for _ in range(round(SETTLE_S / TIMESTEP_S)):
        simulation.step()
    spins = simulation.velocity_at + 5
    if np.abs(simulation.data.qvel[spins]).max() <= SPINS_RAD_S:
        return
    for _ in range(round(BRAKE_S / TIMESTEP_S)):
        simulation.data.qvel[spins] *= math.exp(-TIMESTEP_S / BRAKED_IN_S)
        simulation.step()


def _require_ground(surface: Ground, centres: Array, time_s: float) -> None:
    """Refuse a run that has left the ground, where it would fall for ever.

    Args:
        surface: ground of the run.
        centres: (E, 3) m, centres of the endcaps.
        time_s: time since the start, s.
    """
    if np.abs(centres[:, :2]).max() > surface.half_m:
        raise ParameterError(
            f"after {time_s:.1f} s the robot rolls off the ground, which ends {surface.half_m:g} m from where it "
            f"started: give at most {math.floor(time_s)} s",
            name="seconds",
        )


class _Rows:
    """Rows of the truth, one for each sample."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.rows: list[tuple[float | Array, ...]] = []
        self.force, self.steps = simulation.ground_force_n, 1

    def push(self) -> None:
        """Add a step's force to the next sample, which holds the mean since the last one."""
        self.force = self.force + self.simulation.ground_force_n
        self.steps += 1

    def add(self, time_s: float) -> None:
        now = self.simulation
        contacts, force = now.contacts(), self.force / self.steps
        left = ~contacts.any(axis=1) & force.any(axis=1)  # it touched within the interval, but not at its end
        contacts[left, 9:] = [0, 0, 1]
        contacts[left, 3:6] = now.data.xpos[now.shells[left]] - now.model.geom_size[now.geoms[left], :1] * [0, 0, 1]
        length, tension = now.data.ten_length.copy(), now.tension_n
        self.rows.append((time_s, now.poses, now.velocities, force, contacts, length, tension))
        self.force, self.steps = np.zeros_like(self.force), 0

    def walk(self, terrain: str, seed: int, friction: float) -> Walk:
        columns = [np.array(column) for column in zip(*self.rows, strict=True)]
        times, poses, velocities, force, contacts, length, tension = columns
        return Walk(
            terrain=terrain, seed=seed, friction=friction, time_s=times, T_world_bar=poses, velocity=velocities,
            force_n=force, torque_nm=contacts[..., :3], point_m=contacts[..., 3:6],
            slip_m_s=contacts[..., 6:9], normal=contacts[..., 9:], length_m=length, tension_n=tension,
        )  # fmt: skip


def skew(vector: Array) -> Array:
    """(3, 3) with skew(a) b = a x b."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _horizontal(angle: float) -> Array:
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def _lying(robot: TensegrityRobot, surface: Ground, rng: np.random.Generator) -> Array:
    """(B, 4, 4) m, T_world_bar: the balanced shape on its side, turned at random, lowest endcap above the ground."""
    poses = balanced_shape(robot).T_world_bar
    centre = poses[:, :3, 3].mean(axis=0)
    turn = rotation_of(np.array([0.0, 0.0, rng.uniform(0, 2 * math.pi)]))
    turn = turn @ rotation_of(np.array([math.pi / 2, 0.0, 0.0]))
    turn = turn @ rotation_of(np.array([0.0, 0.0, rng.uniform(0, 2 * math.pi)]))
    poses[:, :3, :3] = turn @ poses[:, :3, :3]
    poses[:, :3, 3] = (poses[:, :3, 3] - centre) @ turn.T
    low = math.inf
    for bar, pose in zip(robot.bars, poses, strict=True):
        sizes = [(endcap.diameter_mm, endcap.wall_mm) for endcap in robot.endcaps if endcap.bar == bar.name]
        diameter, wall = max(sizes, default=RELEASED)
        reach = 0.04 + (centre_height_m(diameter, wall) - centre_height_m(*RELEASED))
        for end in (-1, 1):
            tip = pose[:3, 3] + end * (bar.length_m / 2 + reach) * pose[:3, 2]
            low = min(low, float(tip @ surface.up) - (diameter / 2000 + 0.002))
    lift = surface.drop_m + (float(surface.heights.max()) if surface.heights.size else 0.002)
    poses[:, 2, 3] += (lift - low) / float(surface.up[2])
    return poses
