"""A robot that stands still: the first state, its covariance, what is refused and what is said of missing streams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from standing_robot import feed, standing_samples

from cad.errors import ParameterError
from sensing.robot.estimator import RobotEstimator
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample
from sensing.tensegrity.shape import rotation_of

ROBOT = load_robot()


def test_it_stands_where_it_is():
    poses, samples = standing_samples(ROBOT, 2.0)
    estimator = RobotEstimator(ROBOT)
    feed(estimator, samples)
    estimate = estimator.state()
    centre = poses[:, :3, 3].mean(axis=0)
    for bar, pose in zip(estimate.bars, poses, strict=True):
        assert bar.velocity_m_s @ np.linalg.solve(bar.covariance[6:, 6:], bar.velocity_m_s) < 16
        turned = bar.T_world_bar[:3, :3] @ pose[:3, :3].T  # the prism is singular: how much so, its covariance says
        turn = np.array([turned[2, 1], turned[0, 2], turned[1, 0]])
        assert (np.abs(turn) < 4 * np.sqrt(bar.covariance.diagonal()[3:6]) + 1e-3).all() and abs(turn[2]) < 0.1
        assert np.linalg.norm(bar.T_world_bar[:2, 3] - (pose[:3, 3] - centre)[:2]) < 0.02
    assert [endcap.hold.word for endcap in estimate.endcaps] == ["holds", "free"] * 3
    assert all(abs(endcap.normal[2] - 1) < 0.01 for endcap in estimate.endcaps[::2])
    contacts_m = [endcap.contact_m[2] for endcap in estimate.endcaps[::2]]
    assert abs(np.mean(contacts_m)) < 3e-3  # they are on the ground: domes yield by 10 mm
    assert estimate.health.good and abs(estimate.health.weight_ratio - 1) < 0.05


def test_before_it_has_stood_a_while_there_is_none():
    estimator = RobotEstimator(ROBOT)
    assert estimator.state() is None
    feed(estimator, standing_samples(ROBOT, 0.4)[1])
    assert estimator.state() is None


@pytest.mark.parametrize(
    ("sample", "word"),
    [
        (InertialSample(1.0, "imu_pink", np.zeros(3)), 'inertial sensor "imu_pink": not in the description'),
        (FootSample(1.0, "9", np.zeros(3), np.zeros(3)), 'endcap "9": not in the description'),
        (LengthSample(1.0, np.ones(8)), "give 9, in the order"),
        (InertialSample(1.0, "imu_red", np.zeros(2)), "give 3, in the order"),
        (LengthSample(-1e6, np.ones(9)), "give times of one clock"),
    ],
)
def test_what_is_not_of_this_robot_is_refused_in_one_line(sample, word):
    estimator = RobotEstimator(ROBOT)
    estimator.lengths(LengthSample(0.0, np.ones(9)))
    with pytest.raises(ParameterError, match=word) as caught:
        estimator._put(sample)
    assert "\n" not in str(caught.value)


def test_a_robot_without_measured_cables_is_refused_before_it_waits_for_ever():
    blind = replace(ROBOT, cables=tuple(replace(cable, measured=False) for cable in ROBOT.cables))
    with pytest.raises(ParameterError, match="three_bar: no cable has measured = true"):
        RobotEstimator(blind)


def test_the_first_estimate_misses_no_reading_that_came_before_it():
    """An endcap whose next reading was still on its way was said to have none yet, for up to 30 ms."""
    samples = standing_samples(ROBOT, 1.1, noise=0.0, every=28)[1]  # readings every 140 ms
    estimator, found = RobotEstimator(ROBOT), None
    for sample in samples:
        feed(estimator, [sample])
        found = found or estimator.state()
    assert found.health.notes == () and [one.hold.word for one in found.endcaps] == ["holds", "free"] * 3


def test_missing_streams_are_named():
    silent = replace(ROBOT, sensors=ROBOT.sensors[1:2])
    _, samples = standing_samples(silent, 1.0)
    estimator = RobotEstimator(silent)
    feed(estimator, [sample for sample in samples if not isinstance(sample, FootSample)])
    notes = "\n".join(estimator.state().health.notes)
    assert "bar red has no gyroscope" in notes and "which way is up is not measured" in notes
    assert "endcap_0: no reading yet" in notes
    later = "\n".join(estimator.state(at=1.5).health.notes)
    assert "cable lengths: no sample for 0.5 s" in later and "imu_green: no sample for 0.5 s" in later


def test_without_accelerometer_a_bar_with_a_gyroscope_leads():
    """The first bar led, which has none here: its pose was held from the start on, though two gyroscopes reported."""
    two = replace(ROBOT, sensors=tuple(replace(sensor, accelerometer=False) for sensor in ROBOT.sensors[1:]))
    estimator = RobotEstimator(two)
    feed(estimator, standing_samples(two, 2.0)[1])
    notes = estimator.state().health.notes
    assert any("no accelerometer" in note for note in notes) and not any("pose held" in note for note in notes)


@pytest.mark.parametrize("turn_rad", [0.0, 1.0, 2.5, -2.5])
def test_every_accelerometer_shows_how_its_bar_is_turned_about_its_axis(turn_rad):
    """Cables on the axis do not show it, nor do endcaps in the air."""
    robot = replace(ROBOT, sensors=tuple(replace(sensor, accelerometer=True) for sensor in ROBOT.sensors))
    turned = np.eye(4)
    turned[:3, :3] = rotation_of(np.array([0.0, 0.0, turn_rad]))
    last = replace(robot.sensors[-1], T_bar_imu=turned @ robot.sensors[-1].T_bar_imu)
    poses, samples = standing_samples(replace(robot, sensors=(*robot.sensors[:-1], last)), 1.1)
    estimator = RobotEstimator(robot)
    for sample in samples:
        if isinstance(sample, FootSample):
            sample = replace(sample, force_n=np.zeros(3), torque_nm=np.zeros(3), touching=False)
        feed(estimator, [sample])
    bar = estimator.state().bars[-1]
    off = bar.T_world_bar[:3, :3] @ (poses[-1] @ turned)[:3, :3].T
    angle = np.arccos(np.clip((np.trace(off) - 1) / 2, -1, 1))
    assert angle < 0.02 and np.sqrt(np.trace(bar.covariance[3:6, 3:6])) < 0.1


@pytest.mark.parametrize("moving", [False, True])
def test_a_start_in_motion_trusts_no_accelerometer_but_the_leading_bars(moving):
    """Any other bar may be turned by half a turn about itself then, and its gravity with it."""
    robot = replace(ROBOT, sensors=tuple(replace(sensor, accelerometer=True) for sensor in ROBOT.sensors))
    samples = standing_samples(robot, 1.3, noise=0.0)[1]
    estimator = RobotEstimator(robot)
    feed(estimator, [sample for sample in samples if sample.time_s < 1.199])
    state = estimator._history.at(estimator.newest_s).state.copy()
    state.turn[2] = state.turn[2] @ rotation_of(np.array([0.0, 0.0, np.pi]))
    state.began_moving = moving
    after = [s for s in samples if isinstance(s, InertialSample) and s.time_s == pytest.approx(1.2)]
    before = state.velocity.copy()
    estimator._filter.predict(state, after[0].time_s, after)
    change = np.linalg.norm(state.velocity - before, axis=1)
    assert change[:2].max() < 1e-3 and (change[2] < 1e-3) == moving
