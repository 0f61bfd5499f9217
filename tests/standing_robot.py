"""A robot that stands still on level ground, as samples: exact, or with the noise of its sensors."""

from __future__ import annotations

import numpy as np

from sensing.robot.layout import layout_of
from sensing.tensegrity.description import GRAVITY_M_S2, TensegrityRobot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample
from sensing.tensegrity.shape import balanced_shape, cable_lengths

UP = np.array([0.0, 0.0, 1.0])


def standing_samples(
    robot: TensegrityRobot, seconds: float, noise: float = 1.0, seed: int = 0, rate_hz: float = 200.0, every: int = 10
):
    """(poses (B, 4, 4), samples in time order); lengths at a quarter of the rate, readings at a tenth.

    Args:
        robot: with its first endcaps on the ground. seconds: long. noise: times that of usual sensors. seed: of the
            noise. rate_hz: of the inertial sensors. every: of their ticks that a reading takes.
    """
    rng, layout = np.random.default_rng(seed), layout_of(robot)
    poses = balanced_shape(robot).T_world_bar
    lengths = cable_lengths(robot, poses)[0]
    samples = []
    for k in range(round(seconds * rate_hz)):
        time_s = k / rate_hz
        for sensor in robot.sensors:
            turn = poses[robot.bar_number(sensor.bar), :3, :3] @ sensor.T_bar_imu[:3, :3]
            force = turn.T @ UP * GRAVITY_M_S2 + noise * rng.normal(0, 0.05, 3) if sensor.accelerometer else None
            samples.append(InertialSample(time_s, sensor.name, noise * rng.normal(0, 0.003, 3), force))
        if k % 4 == 0:
            samples.append(LengthSample(time_s, lengths + noise * rng.normal(0, 0.002, len(lengths))))
        if k % every == 0:
            samples += [_reading(time_s, endcap, layout, poses, noise, rng) for endcap in range(layout.endcaps)]
    return poses, samples


def _reading(time_s: float, endcap: int, layout, poses, noise: float, rng) -> FootSample:
    turn = poses[layout.endcap_bar[endcap], :3, :3] @ layout.endcap_turn[endcap]
    up = turn.T @ UP
    stands = endcap % 2 == 0
    force = up * layout.mass_kg.sum() * GRAVITY_M_S2 / 3 * stands
    point = np.array([0, 0, layout.centre_height_m[endcap]]) - layout.radius_m[endcap] * up
    return FootSample(
        time_s, layout.robot.endcaps[endcap].name, force + noise * rng.normal(0, 0.1, 3),
        np.cross(point, force) + noise * rng.normal(0, 0.005, 3), np.diag([0.01] * 3 + [25e-6] * 3), stands,
    )  # fmt: skip


def feed(estimator, samples) -> None:
    """Give samples to an estimator."""
    for sample in samples:
        give = {InertialSample: estimator.imu, LengthSample: estimator.lengths, FootSample: estimator.reading}
        give[type(sample)](sample)
