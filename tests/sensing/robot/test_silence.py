"""Inertial sensors that fall silent or are slow: what is said stays true, or the estimate says that it is not good."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from standing_robot import feed, standing_samples

from sensing.robot.estimator import RobotEstimator
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import InertialSample
from sensing.tensegrity.shape import rotation_of

ROBOT = load_robot()


def asked(samples, from_s: float = 1.5, every_s: float = 0.5):
    """The estimates of a robot that stands, at times at which all streams have reported."""
    estimator, found, next_s = RobotEstimator(ROBOT), [], from_s
    for sample in samples:
        feed(estimator, [sample])
        if sample.time_s >= next_s:
            next_s += every_s
            found.append(estimator.state())
    return found


def standing_deviations(estimate, first) -> float:
    """How far it thinks to have moved, in standard deviations."""
    away = estimate.centre_of_mass_m - first.centre_of_mass_m
    return float(np.sqrt(away @ np.linalg.solve(estimate.centre_of_mass_covariance, away)))


@pytest.mark.parametrize("last_s", [0.0, 2.0])
def test_a_silent_inertial_sensor_does_not_let_the_robot_run_away(last_s):
    _, samples = standing_samples(ROBOT, 25.0, rate_hz=25.0, every=3)
    found = asked([x for x in samples if not (isinstance(x, InertialSample) and x.time_s > last_s)])
    silent = [estimate for estimate in found if estimate.time_s > last_s + 1.5]
    assert len(silent) > 40
    for before, estimate in pairwise(silent):
        assert not estimate.health.good and any("pose held" in note for note in estimate.health.notes)
        assert standing_deviations(estimate, found[0]) < 3
        assert (estimate.bars[0].T_world_bar == before.bars[0].T_world_bar).all()
        assert (np.diag(estimate.centre_of_mass_covariance) > np.diag(before.centre_of_mass_covariance)).all()
        assert (np.linalg.eigvalsh(estimate.bars[0].covariance) > -1e-9).all()
    assert [endcap.hold.word for endcap in silent[-1].endcaps] == ["holds", "free"] * 3


@pytest.mark.parametrize("last_s", [0.0, 2.0])
def test_another_bar_with_an_accelerometer_leads_while_the_leading_ones_sensor_is_silent(last_s):
    """The pose was held, and lost by 0.2 m a second, though two other bars had all that it takes."""
    robot = replace(ROBOT, sensors=tuple(replace(sensor, accelerometer=True) for sensor in ROBOT.sensors))
    name, estimator = robot.sensors[0].name, RobotEstimator(robot)
    samples = standing_samples(robot, 6.0, rate_hz=100.0)[1]
    feed(estimator, [x for x in samples if x.time_s < 1.5 and not (getattr(x, "sensor", "") == name and last_s == 0)])
    before = estimator.state()
    rest = [x for x in samples if x.time_s >= 1.5]
    feed(estimator, [x for x in rest if not (getattr(x, "sensor", "") == name and x.time_s > last_s)])
    found = estimator.state()
    notes = "\n".join(found.health.notes)
    assert f"{name}: no sample" in notes and "pose held" not in notes and "accelerometer" not in notes
    assert np.linalg.norm(found.centre_of_mass_m - before.centre_of_mass_m) < 0.01
    assert np.sqrt(np.trace(found.centre_of_mass_covariance)) < 0.02
    feed(estimator, standing_samples(robot, 8.0, rate_hz=100.0)[1])  # it comes again: nothing begins anew
    after = estimator.state()
    assert "pose held" not in "\n".join(after.health.notes)
    assert np.linalg.norm(after.centre_of_mass_m - before.centre_of_mass_m) < 0.01


def test_a_slow_sensor_leads_between_its_samples_too():
    """Sensors of 15 Hz whose samples come one after another: the lead went round 572 times in 20 s."""
    robot = replace(ROBOT, sensors=tuple(replace(sensor, accelerometer=True) for sensor in ROBOT.sensors))
    order, late = [sensor.name for sensor in robot.sensors], 0.02
    samples = [
        replace(x, time_s=x.time_s + late * order.index(x.sensor)) if isinstance(x, InertialSample) else x
        for x in standing_samples(robot, 5.0, rate_hz=15.0, every=1)[1]
    ]
    estimator, leaders = RobotEstimator(robot), set()
    for sample in sorted(samples, key=lambda x: x.time_s):
        feed(estimator, [sample])
        state = estimator._history.at(estimator.newest_s).state
        leaders |= set() if state is None else {state.leader}
    assert leaders == {0}


def test_after_a_silence_it_stands_a_while_and_begins_anew():
    _, samples = standing_samples(ROBOT, 7.0, rate_hz=100.0)
    found = asked([x for x in samples if not (isinstance(x, InertialSample) and 2.0 < x.time_s < 4.0)])
    last = found[-1]
    assert last.health.notes[0].startswith("begun anew while it stood") and len(last.health.notes) == 1
    assert standing_deviations(last, found[0]) < 3
    held = np.diag([x for x in found if x.time_s < 4.0][-1].centre_of_mass_covariance)
    assert (np.diag(last.centre_of_mass_covariance) > held).all()  # what was not seen stays unknown
    anew = next(x for x in found if any("begun anew" in note for note in x.health.notes))
    assert last.bars[0].covariance[5, 5] > 0.99 * anew.bars[0].covariance[5, 5] > 0.1  # nobody measures the heading
    assert np.sqrt(last.bars[0].covariance[3, 3]) < 0.02  # gravity says again which way is up


def test_while_the_pose_is_held_a_bar_turns_as_fast_as_its_gyroscope_says():
    """It was said to stand, to 0.006 rad/s, and its sensors to send nothing, until the robot stood for a second."""
    robot = replace(ROBOT, sensors=tuple(replace(sensor, accelerometer=True) for sensor in ROBOT.sensors))
    estimator, rate = RobotEstimator(robot), np.array([0.0, 0.3, 1.0])
    for sample in standing_samples(robot, 5.0, rate_hz=100.0)[1]:
        if isinstance(sample, InertialSample) and sample.time_s > 2.0:
            if sample.time_s < 4.0:
                continue
            sample = replace(sample, rate_rad_s=sample.rate_rad_s + rate)
        feed(estimator, [sample])
    estimate = estimator.state()
    assert any("pose held" in note for note in estimate.health.notes)
    assert not any("no sample" in note for note in estimate.health.notes)
    for sensor in robot.sensors:
        bar = estimate.bars[robot.bar_number(sensor.bar)]
        turned = sensor.T_bar_imu[:3, :3].T @ bar.T_world_bar[:3, :3].T @ bar.rate_rad_s
        assert turned == pytest.approx(rate, abs=0.02)
        assert np.trace(bar.rate_covariance) > 0.1  # nobody knows in which direction, beside the bar itself:
        assert np.trace(bar.bar_rate_covariance) < 0.01**2


def test_what_begins_anew_is_finite_between_its_first_samples():
    """Asked before the first sample after the new start, covariances were NaN."""
    _, samples = standing_samples(ROBOT, 5.5, rate_hz=100.0)
    estimator, asked_anew = RobotEstimator(ROBOT), 0
    for sample in samples:
        if isinstance(sample, InertialSample) and 2.0 < sample.time_s < 4.0:
            continue
        feed(estimator, [sample])
        found = estimator.state(at=sample.time_s + 0.002) if sample.time_s > 4.5 else None
        asked_anew += found is not None and any("begun anew" in note for note in found.health.notes)
        assert found is None or all(np.isfinite(bar.covariance).all() for bar in found.bars)
    assert asked_anew > 100


@pytest.mark.long
def test_slow_streams_are_inside_the_covariance_or_flagged():
    _, samples = standing_samples(ROBOT, 90.0, rate_hz=10.0, every=3)
    found = asked(samples, every_s=5.0)
    assert all(standing_deviations(estimate, found[0]) < 3 or not estimate.health.good for estimate in found)
    assert any("place is being lost" in note for note in found[-1].health.notes)


@pytest.mark.parametrize(("seed", "silent"), [(1, "imu_green"), (1, "imu_blue"), (3, "imu_green")])
def test_a_bar_whose_gyroscope_falls_silent_stands_where_the_others_do(seed, silent):
    """Nothing but the others' rates says that it does not turn about itself: with rates of 0.5 it was 13 off."""
    poses, samples = standing_samples(ROBOT, 5.0, rate_hz=100.0, seed=seed)
    heard = [
        sample for sample in samples if not (getattr(sample, "sensor", "") == silent and 1.5 < sample.time_s < 3.5)
    ]
    estimator = RobotEstimator(ROBOT)
    feed(estimator, heard)
    for bar, pose in zip(estimator.state().bars, poses, strict=True):
        turn = bar.T_world_bar[:3, :3] @ pose[:3, :3].T
        turn = rotation_of(np.array([0, 0, -np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])])) @ turn
        assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 6


@pytest.mark.parametrize(("seconds", "doubtful"), [(0.1, False), (0.5, True)])
def test_several_gyroscopes_silent_at_once_leave_a_note(seconds, doubtful):
    """Covariances do not cover what that leaves: up to 22 degrees, of twenty drawn sets of outages."""
    _, samples = standing_samples(ROBOT, 4.0, rate_hz=100.0)
    gone = {sensor.name for sensor in ROBOT.sensors[1:]}
    heard = [s for s in samples if not (getattr(s, "sensor", "") in gone and 3.9 - seconds < s.time_s < 3.9)]
    estimator = RobotEstimator(ROBOT)
    feed(estimator, heard)
    health = estimator.state().health
    assert health.good != doubtful
    assert any("several gyroscopes were silent at once: for 0." in note for note in health.notes) == doubtful


@pytest.mark.parametrize("pause_s", [0.5, 5.0, 3600.0])
def test_a_pause_of_all_sensors_moves_no_robot(pause_s):
    """The first sample after it was taken for all of it: after 20 s the robot was 26 km off, then without end."""
    _, samples = standing_samples(ROBOT, 6.0, rate_hz=100.0)
    estimator = RobotEstimator(ROBOT)
    feed(estimator, [sample for sample in samples if sample.time_s <= 2.0])
    before, found = estimator.state(), []
    for begin_s in np.arange(2.0, 6.0, 0.5):
        part = [sample for sample in samples if begin_s < sample.time_s <= begin_s + 0.5]
        feed(estimator, [replace(sample, time_s=sample.time_s + pause_s) for sample in part])
        found.append(estimator.state())
        assert np.linalg.norm(found[-1].centre_of_mass_m - before.centre_of_mass_m) < 0.02
    assert not found[0].health.good
    assert any(note.startswith("pose held") for note in found[0].health.notes) == (pause_s > 1)
    assert [note[:10] for note in found[-1].health.notes] == ["begun anew"]


def test_a_silence_of_the_leading_sensor_does_not_let_a_walking_robot_run_away():
    """Twice the rates of bars that tip over is more than linear steps bear: in 0.7 s it went 10^24 m and further."""
    walk = simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=10.0)
    samples = [arrival.sample for arrival in sensor_stream(walk, ROBOT, seed=1)]
    heard = RobotEstimator(ROBOT)
    feed(heard, [sample for sample in samples if sample.time_s <= 2.0])
    for begin_s, end_s in ((2.0, 4.1), (4.1, 6.3), (6.3, 7.5), (7.5, 9.5)):
        silent = deepcopy(heard)
        gap = [sample for sample in samples if begin_s < sample.time_s <= begin_s + 0.7]
        feed(silent, [sample for sample in gap if getattr(sample, "sensor", "") != ROBOT.sensors[0].name])
        feed(heard, gap)
        assert np.linalg.norm(silent.state().centre_of_mass_m - heard.state().centre_of_mass_m) < 0.1
        feed(heard, [sample for sample in samples if begin_s + 0.7 < sample.time_s <= end_s])


def test_the_last_rate_of_a_gyroscope_that_falls_silent_goes_on_for_nobody():
    """It stayed in the reported rate, velocity and rolling for as long as the silence lasted."""
    name, turned = ROBOT.sensors[1].name, []
    for sample in standing_samples(ROBOT, 2.0)[1]:
        if isinstance(sample, InertialSample) and sample.sensor == name and sample.time_s > 1.4:
            if sample.time_s > 1.5:
                continue
            sample = replace(sample, rate_rad_s=np.array([0.0, 0.0, 0.6]))
        turned.append(sample)
    estimator = RobotEstimator(ROBOT)
    feed(estimator, turned)
    bar = estimator.state().bars[ROBOT.bar_number(ROBOT.sensors[1].bar)]
    assert np.abs(bar.rate_rad_s).max() < 1e-3
    assert np.sqrt(np.diag(bar.rate_covariance)).min() > 0.5  # nobody measures it


def test_rates_are_as_sure_as_they_say():
    """Of bars that stand: errors are those of noise, of the biases, and none of the turn."""
    found = asked(standing_samples(ROBOT, 4.0)[1], every_s=0.05)
    squares = [b.rate_rad_s @ np.linalg.solve(b.rate_covariance, b.rate_rad_s) / 3 for e in found for b in e.bars]
    assert 0.5 < np.mean(squares) < 1.5
