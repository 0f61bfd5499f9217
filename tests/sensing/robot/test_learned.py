"""What the filter learns while the robot walks: creep, the domes' softness, the rate of a bar without gyroscope."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from long_cases import others_long
from standing_robot import feed, standing_samples

pytest.importorskip("mujoco")

from sensing.robot.estimator import RobotEstimator
from sensing.robot.layout import layout_of
from sensing.robot.settings import Settings
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import SensorSet, sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample

ROBOT = load_robot()


@pytest.mark.long
def test_creep_is_learned_from_contacts_that_pull_apart():
    """Beside the creep of the simulated contacts themselves, by least squares over those that are slow."""
    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=10.0)
    push = np.einsum("tei,tei->te", walk.force_n, walk.normal)
    along = walk.force_n - push[..., None] * walk.normal
    friction = np.linalg.norm(along, axis=2)
    speed = -np.einsum("tei,tei->te", walk.slip_m_s, along) / np.maximum(friction, 1e-9)
    bars = [ROBOT.bar_number(endcap.bar) for endcap in ROBOT.endcaps]
    arc = 0.065 * np.linalg.norm(walk.velocity[:, bars, 3:], axis=2) * friction / np.maximum(push, 1e-9)
    slow = (push > 1.5) & (np.linalg.norm(walk.slip_m_s, axis=2) < 0.03)
    true = float(speed[slow] @ arc[slow] / (arc[slow] @ arc[slow]))
    estimator = RobotEstimator(ROBOT)
    feed(estimator, [arrival.sample for arrival in sensor_stream(walk, ROBOT, seed=1)])
    state = estimator._history.at(estimator.newest_s).state
    creep = layout_of(ROBOT).creep
    spread = state.covariance[creep, creep] ** 0.5
    assert true > 3 * spread and abs(state.creep[0] - true) < 3 * spread


@pytest.mark.parametrize("compliance", others_long([1.25, 0.8, 1.0]))
def test_the_domes_softness_is_learned_from_contacts_that_are_loaded_and_unloaded(compliance):
    """Domes of 4 N/mm in the simulation; the settings say something else."""
    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=10.0)
    assumed = Settings(compliance_m_n=compliance * Settings().compliance_m_n)
    estimator = RobotEstimator(ROBOT, assumed)
    feed(estimator, [arrival.sample for arrival in sensor_stream(walk, ROBOT, seed=1)])
    found, true = estimator.state(), 1 / compliance - 1
    assert found.softness_sd < 0.4 * assumed.softness_sd
    assert abs(found.softness - true) < 3 * found.softness_sd


@pytest.mark.parametrize("assumed_s", others_long([0.0, 0.02]))
def test_the_delay_between_force_and_yield_is_learned_from_contacts_that_are_pressed(assumed_s):
    """The simulated domes have 10 ms; forces are means over the 5 ms that end at their stamp, 2.5 ms late of them."""
    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=10.0)
    estimator = RobotEstimator(ROBOT, Settings(yield_delay_s=assumed_s))
    feed(estimator, [arrival.sample for arrival in sensor_stream(walk, ROBOT, seed=1)])
    found = estimator.state()
    assert found.delay_sd_s < 0.3 * Settings().delay_sd_s
    assert abs(assumed_s + found.delay_s - 0.0075) < 0.5 * abs(assumed_s - 0.0075)


@pytest.mark.long
def test_a_bar_without_gyroscope_is_followed_through_a_walk():
    """Its angular velocity is learned from cables and contacts: with a zero instead, its anchors would not roll."""
    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=2, duration_s=12.0)
    estimator = RobotEstimator(ROBOT)
    arrivals = sensor_stream(walk, ROBOT, SensorSet(gyroscopes=2), seed=2)
    feed(estimator, [arrival.sample for arrival in arrivals])
    estimate, state = estimator.state(), estimator._history.at(estimator.newest_s).state
    silent = next(bar for bar in range(3) if not np.isfinite(state.rate_s[bar]))
    true = walk.velocity[-1, silent, 3:]
    spread = np.sqrt(state.covariance.diagonal()[layout_of(ROBOT).rate_bias(silent)])
    assert (np.abs(-state.rate_bias[silent] - true) < 4 * spread).all()
    axes = np.array([bar.T_world_bar[:3, 2] for bar in estimate.bars])
    assert np.abs(axes @ axes.T - walk.T_world_bar[-1, :, :3, 2] @ walk.T_world_bar[-1, :, :3, 2].T).max() < 0.05


def test_a_gyroscope_that_is_heard_late_has_a_bias_and_no_angular_velocity():
    samples = standing_samples(ROBOT, 4.0)[1]
    late = ROBOT.sensors[-1].name
    kept = [s for s in samples if not (isinstance(s, InertialSample) and s.sensor == late and s.time_s < 3.0)]
    estimator = RobotEstimator(ROBOT)
    feed(estimator, kept)
    state = estimator._history.at(estimator.newest_s).state
    bar = ROBOT.bar_number(ROBOT.sensors[-1].bar)
    at = layout_of(ROBOT).rate_bias(bar)
    assert np.abs(state.rate_bias[bar]).max() < 0.02 and np.sqrt(state.covariance.diagonal()[at]).max() < 0.011
    assert np.isfinite(state.rate_s[bar])


@pytest.mark.long
def test_a_robot_that_stands_does_not_come_to_know_its_softness_worse_than_at_first():
    _, samples = standing_samples(ROBOT, 30.0, rate_hz=50.0, every=2)
    settings = Settings(softness_stays_s=3.0)  # thirty seconds are then as long as five hundred
    estimator = RobotEstimator(ROBOT, settings)
    feed(estimator, samples)
    found = estimator.state()
    assert found.softness_sd < 1.01 * settings.softness_sd and abs(found.softness) < 3 * settings.softness_sd


@pytest.mark.parametrize("noise_n", others_long([1.0, 0.3, 2.0, 5.0]))
def test_noise_of_forces_teaches_a_robot_that_stands_no_softness(noise_n):
    """It was -0.4 after ten seconds: of the differences that noise makes, stiffer domes explain more."""
    rng, estimator, slow = np.random.default_rng(3), RobotEstimator(ROBOT), np.zeros((6, 3))
    keep = np.exp(-0.05 / 0.3)  # most of it stays for 0.3 s, as in the simulated walks
    for sample in standing_samples(ROBOT, 8.0, seed=3)[1]:
        if isinstance(sample, FootSample):
            number = int(sample.endcap[-1])
            slow[number] = keep * slow[number] + np.sqrt(1 - keep**2) * rng.normal(size=3)
            noise = noise_n * (np.sqrt(0.8) * slow[number] + np.sqrt(0.2) * rng.normal(size=3))
            stated = np.diag([0.01 + noise_n**2] * 3 + [25e-6] * 3)
            sample = replace(sample, force_n=sample.force_n + noise, covariance=stated)
        feed(estimator, [sample])
    found = estimator.state()
    assert abs(found.softness) < 0.05 and abs(found.delay_s) < 0.001


@pytest.mark.parametrize(("noise_n", "stated_n", "said"), [(0.1, 0.1, False), (5.0, 5.0, False), (5.0, 0.1, True)])
def test_a_softness_that_is_noise_of_the_forces_is_said_where_the_wrenches_do_not_state_it(noise_n, stated_n, said):
    """The filter takes a force's error for a stiffer dome, and is sure of it where the error is not stated."""
    rng, estimator = np.random.default_rng(0), RobotEstimator(ROBOT)
    for sample in standing_samples(ROBOT, 5.0)[1]:
        if isinstance(sample, FootSample):
            stated = np.diag([0.01 + stated_n**2] * 3 + [25e-6] * 3)
            sample = replace(sample, force_n=sample.force_n + rng.normal(0, noise_n, 3), covariance=stated)
        feed(estimator, [sample])
    found = estimator.state()
    assert (abs(found.softness) > 3 * found.softness_sd) == said
    assert any("domes seem to yield" in note for note in found.health.notes) == said
