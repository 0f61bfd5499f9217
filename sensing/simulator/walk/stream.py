"""Samples of the robot's sensors in a simulated run, with noise, biases, rates and delays of real parts.

    arrivals = sensor_stream(walk, robot, SensorSet(), seed=1)       # in the order in which they arrive
    arrivals[0].at_s, arrivals[0].sample

The inertial data are differences of the simulated bar's velocity and attitude over the interval that **ends** at a
sample's time (MuJoCo's own accelerometer does not fit its integrator), so that their sum is the motion.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sensing.simulator.similarity.ratios import REFERENCE_SHEAR_MPA, LoadScale
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.walk.mjcf import sphere_centre_m
from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import (
    GRAVITY_M_S2,
    Array,
    InertialSensor,
    MountedEndcap,
    TensegrityRobot,
)
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample, Sample

# RMSE of earlier weights on sensors outside their training. Loads of D=130 T=8; others in proportion (LoadScale).
NOISE = Path(__file__).with_name("wrench_noise.csv")
MOST_TILT_DEG, MOST_LOAD_N = 60.0, 60.0  # range of their training, beyond which wrenches are flagged
TILT_GROWTH_DEG = 10.0  # E: tilt beyond it by which the errors double
TOUCH_N, RELEASE_N = 0.5, 0.3  # force at which contact begins, and ends
SLOW_SHARE, SLOW_S = 0.8, 0.3  # E: correlated part of a wrench error's variance; its correlation time


@dataclass(frozen=True)
class SensorSet:
    """Rates, noise and delays of the sensors.

    Attributes:
        inertial_hz, length_hz, wrench_hz: rates, Hz; each sample is that of the truth nearest to its tick.
        gyro_rad_s_rthz, acceleration_m_s2_rthz: white noise densities, Bosch BMI088 (data sheet: 0.014 degrees/s and
            175 micro-g a root Hz).
        gyro_zero_rad_s, acceleration_zero_m_s2: standard deviation of the remaining constant offsets (E: 0.1 degrees/s
            after a warm start, 2 mg after calibration in six positions; the part's own are 1 and 20 mg).
        gyro_walk, acceleration_walk: random walks of the offsets, rad/s and m/s2 per root s (E).
        length_m: standard deviation of a cable's length, m.
        wrench_noise: factor on the errors of ``wrench_noise.csv``.
        beyond_noise: further factor on those beyond the range of training; the stated deviation grows by its square
            root only (1 is more than pictures show, docs/robot_accuracy.md).
        force_scale: factor on every force and torque, as of a wrong silicone.
        inertial_delay_s, length_delay_s, wrench_delay_s: time from capture to arrival, s.
        jitter_s: random part of the wrenches' delay, s.
        gyroscopes: number of inertial sensors that report, those with an accelerometer first.
    """

    inertial_hz: float = 200.0
    length_hz: float = 50.0
    wrench_hz: float = 30.0
    gyro_rad_s_rthz: float = math.radians(0.014)
    acceleration_m_s2_rthz: float = 175e-6 * GRAVITY_M_S2
    gyro_zero_rad_s: float = math.radians(0.1)
    acceleration_zero_m_s2: float = 2e-3 * GRAVITY_M_S2
    gyro_walk: float = 1e-5
    acceleration_walk: float = 1e-4
    length_m: float = 0.002
    wrench_noise: float = 1.0
    beyond_noise: float = 1.0
    force_scale: float = 1.0
    inertial_delay_s: float = 0.002
    length_delay_s: float = 0.005
    wrench_delay_s: float = 0.035
    jitter_s: float = 0.005
    gyroscopes: int = 99


@dataclass(frozen=True)
class Arrival:
    """A sample with its time of arrival.

    Attributes:
        at_s: time of arrival, s, on the clock of the samples' capture times.
        sample: sample that arrives.
    """

    at_s: float
    sample: Sample = field(compare=False)


def sensor_stream(walk: Walk, robot: TensegrityRobot, sensors: SensorSet | None = None, seed: int = 1) -> list[Arrival]:
    """All samples of a run, in the order in which they arrive.

    Args:
        walk: the run.
        robot: robot with its sensors.
        sensors: accuracy of the sensors.
        seed: seed of all noise.
    """
    sensors = sensors or SensorSet()
    arrivals: list[Arrival] = []
    reporting = sorted(robot.sensors, key=lambda sensor: not sensor.accelerometer)[: sensors.gyroscopes]
    for number, sensor in enumerate(reporting):
        samples = inertial_samples(walk, robot, sensor, sensors, np.random.default_rng([seed, 1, number]))
        arrivals += [Arrival(sample.time_s + sensors.inertial_delay_s, sample) for sample in samples]
    rng = np.random.default_rng([seed, 2])
    measured = [place for place, cable in enumerate(robot.cables) if cable.measured]
    for row in _rows(walk, sensors.length_hz):
        lengths = walk.length_m[row, measured] + sensors.length_m * rng.normal(size=len(measured))
        time_s = float(walk.time_s[row])
        arrivals.append(Arrival(time_s + sensors.length_delay_s, LengthSample(time_s, lengths)))
    for number, endcap in enumerate(robot.endcaps):
        rng = np.random.default_rng([seed, 3, number])
        for foot in foot_samples(walk, robot, endcap, sensors, rng):
            delay = max(0.0, sensors.wrench_delay_s + sensors.jitter_s * float(rng.normal()))
            arrivals.append(Arrival(foot.time_s + delay, foot))
    return sorted(arrivals, key=lambda arrival: arrival.at_s)


def inertial_samples(
    walk: Walk, robot: TensegrityRobot, sensor: InertialSensor, sensors: SensorSet, rng: np.random.Generator
) -> list[InertialSample]:
    """Samples of one inertial sensor; each is the mean over the interval that ends at its time.

    Args:
        walk: the run.
        robot, sensor: the robot, and one of its inertial sensors.
        sensors: accuracy of the sensor.
        rng: random numbers of its noise.
    """
    rows = _rows(walk, sensors.inertial_hz)
    bar = robot.bar_number(sensor.bar)
    rotation = walk.T_world_bar[rows, bar, :3, :3]
    lever = sensor.T_bar_imu[:3, 3]
    spin = walk.velocity[rows, bar, 3:]
    velocity = walk.velocity[rows, bar, :3] + np.einsum("nij,nj->ni", rotation, np.cross(spin, lever))
    step = np.diff(walk.time_s[rows])[:, None]
    turned = rotation_vectors(np.swapaxes(rotation[:-1], 1, 2) @ rotation[1:])
    middle = rotation[:-1] @ rotation_matrices(turned / 2)
    force = np.diff(velocity, axis=0) / step + [0.0, 0.0, GRAVITY_M_S2]
    force = np.einsum("nji,nj->ni", middle, force) @ sensor.T_bar_imu[:3, :3]
    rate = turned / step @ sensor.T_bar_imu[:3, :3]
    rate = rate + _errors(rng, step, sensors.gyro_rad_s_rthz, sensors.gyro_zero_rad_s, sensors.gyro_walk)
    force = force + _errors(
        rng, step, sensors.acceleration_m_s2_rthz, sensors.acceleration_zero_m_s2, sensors.acceleration_walk
    )
    return [
        InertialSample(float(time_s), sensor.name, rate[k], force[k] if sensor.accelerometer else None)
        for k, time_s in enumerate(walk.time_s[rows[1:]])
    ]


def foot_samples(
    walk: Walk, robot: TensegrityRobot, endcap: MountedEndcap, sensors: SensorSet, rng: np.random.Generator
) -> list[FootSample]:
    """Wrenches of one endcap on its mating plane, with the errors of :data:`NOISE` in proportion to its shell.

    Args:
        walk: the run.
        robot, endcap: the robot, and one of its endcaps.
        sensors: accuracy of the endcap.
        rng: random numbers of its errors.
    """
    rows = _rows(walk, sensors.wrench_hz, float(rng.uniform(0, 1)))
    scale = shell_scale(endcap)
    wrench, tilt = true_wrenches(walk, robot, endcap, rows)
    wrench = wrench * sensors.force_scale
    load = np.linalg.norm(wrench[:, :3], axis=1)
    sigma = wrench_sigma(tilt, load, scale)
    touch, release = TOUCH_N * scale.force, RELEASE_N * scale.force
    beyond = (load > MOST_LOAD_N * scale.force) | ((load > touch) & (tilt > MOST_TILT_DEG))
    more = np.where(beyond, sensors.beyond_noise, 1.0)[:, None]
    error = sensors.wrench_noise * more * sigma * _slow(rng, np.diff(walk.time_s[rows]), 6)
    stated = max(sensors.wrench_noise, 0.1) * np.sqrt(more) * sigma
    touching, samples = False, []
    for k, row in enumerate(rows):
        reported = wrench[k] + error[k]
        touching = float(np.linalg.norm(reported[:3])) > (release if touching else touch)
        samples.append(
            FootSample(
                time_s=float(walk.time_s[row]),
                endcap=endcap.name,
                force_n=reported[:3],
                torque_nm=reported[3:],
                covariance=np.diag(stated[k] ** 2),
                touching=touching,
                flags=frozenset({"out_of_range"} if beyond[k] else ()),
            )
        )
    return samples


def true_wrenches(
    walk: Walk, robot: TensegrityRobot, endcap: MountedEndcap, rows: NDArray[np.int64]
) -> tuple[Array, Array]:
    """((n, 6) wrench on the endcap at the mating plane, its frame, N, N m; (n,) degrees from its tip to the contact).

    Args:
        walk: the run.
        robot, endcap: the robot, and one of its endcaps.
        rows: numbers of samples of the run.
    """
    number, bar = robot.endcaps.index(endcap), robot.bar_number(endcap.bar)
    pose = walk.T_world_bar[rows, bar] @ endcap.T_bar_endcap
    force, point = walk.force_n[rows, number], walk.point_m[rows, number]
    torque = walk.torque_nm[rows, number] + np.cross(point - pose[:, :3, 3], force)
    into = np.swapaxes(pose[:, :3, :3], 1, 2)
    wrench = np.concatenate([np.einsum("nij,nj->ni", into, each) for each in (force, torque)], axis=1)
    centre = walk.T_world_bar[rows, bar, :3, :3] @ sphere_centre_m(endcap) + walk.T_world_bar[rows, bar, :3, 3]
    outward = point - centre
    size = np.maximum(np.linalg.norm(outward, axis=1), 1e-9)
    tilt = np.degrees(np.arccos(np.clip(np.einsum("ni,ni->n", outward, pose[:, :3, 2]) / size, -1, 1)))
    loaded = np.linalg.norm(force, axis=1) > 0
    return np.where(loaded[:, None], wrench, 0.0), np.where(loaded, tilt, 0.0)


def shell_scale(endcap: MountedEndcap) -> LoadScale:
    """Loads of an endcap's shell in proportion to those of D=130 T=8, in the same silicone."""
    return LoadScale.of(shell_geometry(endcap.diameter_mm, endcap.wall_mm), REFERENCE_SHEAR_MPA)


def wrench_sigma(tilt_deg: Array, load_n: Array, scale: LoadScale) -> Array:
    """(n, 6) standard deviation of the wrench's errors, N and N m; larger beyond the range of training.

    Args:
        tilt_deg: (n,) angle from the tip to the contact, degrees.
        load_n: (n,) force, N.
        scale: load scale of the shell.
    """
    table, tilts, loads = _noise_table()
    load_n = load_n / scale.force
    row = np.searchsorted(tilts, tilt_deg, side="right") - 1
    column = np.searchsorted(loads, load_n, side="right") - 1
    beyond = np.maximum(1.0, load_n / MOST_LOAD_N) * (1.0 + np.maximum(0.0, tilt_deg - MOST_TILT_DEG) / TILT_GROWTH_DEG)
    cells = table[row, column] * beyond[:, None]
    torque = scale.force * scale.depth  # force times lever
    return np.asarray(cells[:, [0, 0, 1, 2, 2, 2]] * np.repeat([scale.force, torque], 3))


@lru_cache(maxsize=1)
def _noise_table() -> tuple[Array, Array, Array]:
    with NOISE.open(encoding="utf-8", newline="") as stream:
        rows = np.array([[float(cell) for cell in row] for row in list(csv.reader(stream))[1:]])
    tilts, loads = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    return rows[:, 2:].reshape(len(tilts), len(loads), 3), tilts, loads


def rotation_vectors(rotations: Array) -> Array:
    """(n, 3) rotation vectors, rad, of rotations (n, 3, 3) by less than half a turn."""
    axis = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=1,
    )
    sine = np.linalg.norm(axis, axis=1) / 2
    angle = np.arctan2(sine, (np.trace(rotations, axis1=1, axis2=2) - 1) / 2)
    factor = np.where(sine > 1e-9, angle / np.maximum(2 * sine, 1e-12), 0.5)
    return np.asarray(axis * factor[:, None])


def rotation_matrices(vectors: Array) -> Array:
    """(n, 3, 3) rotation matrices of rotation vectors (n, 3), rad."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0] = vectors.T
    cross = cross - np.swapaxes(cross, 1, 2)
    small = np.maximum(angle, 1e-9)
    return np.asarray(np.eye(3) + np.sin(small) / small * cross + (1 - np.cos(small)) / small**2 * cross @ cross)


def _rows(walk: Walk, rate_hz: float, phase: float = 0.0) -> NDArray[np.int64]:
    """Numbers of the walk's samples nearest to the ticks of a rate, Hz; the first is ``phase`` of a period late."""
    ticks = np.arange(phase / rate_hz, float(walk.time_s[-1]) + 1e-9, 1 / rate_hz)
    return np.unique(np.clip(np.round(ticks / (walk.time_s[1] - walk.time_s[0])), 0, len(walk.time_s) - 1).astype(int))


def _errors(rng: np.random.Generator, step: Array, density: float, zero: float, walk: float) -> Array:
    """(n, 3) sum of white noise, constant offset and random walk over steps (n, 1), s."""
    white = density / np.sqrt(step) * rng.normal(size=(len(step), 3))
    drift = np.cumsum(walk * np.sqrt(step) * rng.normal(size=(len(step), 3)), axis=0)
    return np.asarray(white + zero * rng.normal(size=3) + drift)


def _slow(rng: np.random.Generator, step: Array, count: int) -> Array:
    """(n + 1, count) numbers of variance 1, of which :data:`SLOW_SHARE` has the correlation time :data:`SLOW_S`."""
    slow = np.empty((len(step) + 1, count))
    slow[0] = rng.normal(size=count)
    for k, keep in enumerate(np.exp(-step / SLOW_S)):
        slow[k + 1] = keep * slow[k] + math.sqrt(1 - keep**2) * rng.normal(size=count)
    return np.asarray(math.sqrt(SLOW_SHARE) * slow + math.sqrt(1 - SLOW_SHARE) * rng.normal(size=slow.shape))
