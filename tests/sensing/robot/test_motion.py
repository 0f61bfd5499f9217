"""Motions that walks do not have: a bar that spins about its axis, and a fall of the whole robot."""

from __future__ import annotations

import numpy as np
import pytest
from standing_robot import UP, feed, standing_samples

from sensing.robot.estimator import RobotEstimator
from sensing.robot.filter import Filter
from sensing.robot.layout import layout_of
from sensing.robot.report import report_of
from sensing.robot.settings import Settings
from sensing.robot.state import empty_state
from sensing.tensegrity.description import GRAVITY_M_S2
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample
from sensing.tensegrity.shape import cable_lengths, rotation_of

ROBOT = load_robot()
LAYOUT, RATE_HZ, STANDS_S, FALL_M = layout_of(ROBOT), 200, 2.0, 0.3
STAND = standing_samples(ROBOT, STANDS_S, rate_hz=RATE_HZ)
FALL_S = np.sqrt(2 * FALL_M / GRAVITY_M_S2)


def moving_samples(poses, from_s: float, seconds: float, seed: int = 0):
    """Samples of a robot that nothing touches; inertial ones are means over the intervals that end at their times.

    Args:
        poses: (B, 4, 4) at a time since from_s. from_s: when the motion begins. seconds: long. seed: of the noise.
    """
    rng, samples, step = np.random.default_rng(seed), [], 1 / RATE_HZ
    for k in range(round(seconds * RATE_HZ) + 1):
        time_s, places = from_s + k * step, [poses((k + shift) * step) for shift in (-1.5, -1.0, -0.5, 0.0, 0.5)]
        for sensor in ROBOT.sensors:
            bar = ROBOT.bar_number(sensor.bar)
            before, middle, now = (place[bar] @ sensor.T_bar_imu for place in places[1:4])
            ends = [(places[j + 2][bar] - places[j][bar]) @ sensor.T_bar_imu[:, 3] / step for j in (0, 2)]
            turned = before[:3, :3].T @ now[:3, :3]
            rate = 0.5 * np.array(
                [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
            )
            force = middle[:3, :3].T @ ((ends[1] - ends[0])[:3] / step + GRAVITY_M_S2 * UP) + rng.normal(0, 0.05, 3)
            rate = rate / step + rng.normal(0, 0.003, 3)
            samples.append(InertialSample(time_s, sensor.name, rate, force if sensor.accelerometer else None))
        if k % 4 == 0:
            lengths = cable_lengths(ROBOT, places[3])[0]
            samples.append(LengthSample(time_s, lengths + rng.normal(0, 0.002, len(lengths))))
        if k % 10 == 0:
            nothing = rng.normal(0, 0.05, (6, 2, 3)) * [[[1.0], [0.01]]]
            samples += [FootSample(time_s, e.name, *nothing[n], touching=False) for n, e in enumerate(ROBOT.endcaps)]
    return samples


def height_m(time_s: float) -> float:
    """Of a robot that falls from rest and then lies where it fell."""
    return -0.5 * GRAVITY_M_S2 * float(np.clip(time_s, 0.0, FALL_S)) ** 2


def fallen(time_s: float):
    poses = STAND[0].copy()
    poses[:, 2, 3] += height_m(time_s)
    return poses


def inside(estimate, poses, bar: int, most: float = 4.0) -> bool:
    """Whether a bar's turn is as well known as is said."""
    turned = estimate.bars[bar].T_world_bar[:3, :3] @ poses[bar, :3, :3].T
    turn = 0.5 * np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    return bool((np.abs(turn) < most * np.sqrt(estimate.bars[bar].covariance.diagonal()[3:6]) + 2e-3).all())


@pytest.mark.parametrize("bar", [0, 1])
def test_a_bar_that_spins_about_its_axis_is_followed(bar):
    def spun(time_s: float):
        poses = STAND[0].copy()
        poses[:, 2, 3] += 0.2 * np.clip(time_s, 0, 1) ** 2 * (3 - 2 * np.clip(time_s, 0, 1))  # lifted, then held
        angle = 1.5 * np.pi * np.clip(time_s - 0.2, 0, 1.0) ** 2  # three quarters of a turn, up to 1.5 turns a second
        poses[bar, :3, :3] = poses[bar, :3, :3] @ rotation_of(np.array([0.0, 0.0, angle]))
        return poses

    estimator = RobotEstimator(ROBOT)
    feed(estimator, STAND[1])
    feed(estimator, moving_samples(spun, STANDS_S, 1.4))
    estimate, truth = estimator.state(), spun(1.4)
    assert all(inside(estimate, truth, each) for each in range(3))
    away = np.array([one.T_world_bar[2, 3] for one in estimate.bars]) - truth[:, 2, 3]
    away -= STAND[0][:, 2, 3].mean() - truth[:, 2, 3].mean() + 0.2  # the ground's height is where it stood
    assert np.abs(away).max() < 4 * max(np.sqrt(one.covariance[2, 2]) for one in estimate.bars)
    assert [endcap.hold.word for endcap in estimate.endcaps] == ["free"] * 6 and np.isfinite(estimate.friction)
    assert all(np.isfinite(one.T_world_bar).all() and np.isfinite(one.covariance).all() for one in estimate.bars)


def test_a_fall_is_followed_to_the_ground():
    estimator = RobotEstimator(ROBOT)
    feed(estimator, STAND[1])
    first, checked = estimator.state(), 0
    for sample in moving_samples(fallen, STANDS_S, 0.6):
        feed(estimator, [sample])
        if not isinstance(sample, FootSample) or sample.endcap != ROBOT.endcaps[-1].name:
            continue
        estimate, since_s, checked = estimator.state(), sample.time_s - STANDS_S, checked + 1
        away = estimate.centre_of_mass_m - first.centre_of_mass_m - height_m(since_s) * UP
        spread = estimate.centre_of_mass_covariance + first.centre_of_mass_covariance
        assert away @ np.linalg.solve(spread, away) < 16 and np.abs(away).max() < 0.1
        assert all(inside(estimate, STAND[0], bar) for bar in range(3))
        assert [endcap.hold.word for endcap in estimate.endcaps] == ["free"] * 6
    assert checked == 13


@pytest.mark.parametrize("ahead_s", [0.0, 0.002, 0.005])
def test_turns_and_rates_between_samples_are_as_sure_as_they_say(ahead_s):
    """Rates of a tipping robot change by 100 rad/s^2; regions of 95 % held the turns of six bars 70 % of the time."""
    rng, step_s, intensity, fine = np.random.default_rng(1), 1 / RATE_HZ, 4.0, 50
    state = empty_state(LAYOUT, 0.0)
    walk = np.cumsum(np.sqrt(intensity * step_s / fine) * rng.normal(size=(4000 * fine, 3)), axis=0)
    means = walk.reshape(4000, fine, 3).mean(axis=1)
    turned, rates, stated = [], [], []
    drive = Filter(LAYOUT, Settings())
    for k in range(3900):
        time_s, sensor = (k + 1) * step_s, ROBOT.sensors[0]
        rate = sensor.T_bar_imu[:3, :3].T @ means[k]
        state.turn[:] = np.eye(3)
        drive.predict(state, time_s, [InertialSample(time_s, sensor.name, rate, None)])
        state.turn[:], state.covariance[:], asked = np.eye(3), 0.0, state.copy()
        asked.time_s += ahead_s
        bar = report_of(asked, time_s, 0, [], LAYOUT, Settings()).bars[0]
        at, more = (k + 1) * fine, round(ahead_s / step_s * fine)
        turned.append(walk[at : at + more].sum(axis=0) * step_s / fine - ahead_s * means[k])
        rates.append(walk[at + more - 1] - means[k])
        stated.append((bar.covariance[3, 3], bar.rate_covariance[0, 0]))
    wanted = np.mean(np.square(turned[100:])), np.mean(np.square(rates[100:]))
    found = np.mean(stated[100:], axis=0)
    assert found[1] == pytest.approx(wanted[1], rel=0.15)
    assert found[0] == pytest.approx(wanted[0], rel=0.15, abs=1e-9)  # the noise of one sample
