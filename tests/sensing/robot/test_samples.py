"""Samples as they really come: late, twice, out of order, missing, NaN, wrong, and for a long time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from long_cases import others_long
from standing_robot import feed, standing_samples

from sensing.robot.estimator import RobotEstimator
from sensing.robot.layout import layout_of
from sensing.robot.settings import Contacts, Settings
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

ROBOT = load_robot()
SECONDS = 60.0  # docs/robot.md has the numbers of ten minutes
POSES, SAMPLES = standing_samples(ROBOT, 2.0, rate_hz=100.0)


def after(samples, settings=Settings(), robot=ROBOT):  # noqa: B008
    estimator = RobotEstimator(robot, settings)
    feed(estimator, samples)
    return estimator.state()


def bits(estimate) -> bytes:
    arrays = [array for bar in estimate.bars for array in (bar.T_world_bar, bar.velocity_m_s, bar.covariance)]
    arrays += [np.array([estimate.friction, estimate.health.lengths_consistency])]
    return b"".join(array.tobytes() for array in arrays)


def test_late_repeated_and_reordered_samples_give_the_same_bits():
    rng = np.random.default_rng(5)
    expected = bits(after(SAMPLES))
    delays = [sample.time_s + rng.uniform(0, 0.2) for sample in SAMPLES]
    late = [SAMPLES[k] for k in np.argsort(delays)]
    assert bits(after(late)) == expected
    assert bits(after([sample for sample in late for _ in range(2)])) == expected
    estimator = RobotEstimator(ROBOT)
    for place, sample in enumerate(late):  # somebody who asks all the time changes nothing
        feed(estimator, [sample])
        if place % 50 == 0:
            estimator.state()
    assert bits(estimator.state()) == expected


def test_a_sample_older_than_the_past_is_counted():
    estimator = RobotEstimator(ROBOT)
    feed(estimator, SAMPLES)
    before = bits(estimator.state())
    estimator.lengths(LengthSample(0.1, np.full(9, 0.5)))
    assert bits(estimator.state()) == before and estimator.state().health.ignored == 1


@pytest.mark.parametrize("where", ["rate", "force", "length", "wrench", "covariance", "time"])
def test_nan_anywhere_stays_outside(where):
    samples = list(SAMPLES)
    nan = np.full(3, np.nan)
    for place in range(2 * len(samples) // 3, len(samples), 7):
        sample = samples[place]
        if where == "time":
            samples[place] = replace(sample, time_s=float("nan"))
        elif isinstance(sample, InertialSample) and where in ("rate", "force"):
            changes = {"rate": {"rate_rad_s": nan}, "force": {"acceleration_m_s2": nan}}[where]
            samples[place] = replace(sample, **changes)
        elif isinstance(sample, LengthSample) and where == "length":
            samples[place] = replace(sample, lengths_m=np.where(np.arange(9) % 2, np.nan, sample.lengths_m))
        elif isinstance(sample, FootSample) and where in ("wrench", "covariance"):
            changes = {"wrench": {"force_n": nan}, "covariance": {"covariance": np.full((6, 6), np.nan)}}[where]
            samples[place] = replace(sample, **changes)
    estimate = after(samples)
    assert all(np.isfinite(bar.T_world_bar).all() and np.isfinite(bar.covariance).all() for bar in estimate.bars)
    assert stands(estimate)


def stands(estimate, within_m: float = 0.03) -> bool:
    """Whether the bars' middles are where they were, relative to each other."""
    found = np.array([bar.T_world_bar[:3, 3] for bar in estimate.bars])
    return bool(
        np.abs((found - found.mean(axis=0))[:, :2] - (POSES[:, :3, 3] - POSES[:, :3, 3].mean(axis=0))[:, :2]).max()
        < within_m
    )


def test_a_line_of_action_that_misses_the_sphere_stays_outside():
    """Its push is zero but for rounding, so that a friction ratio would be anything."""
    rng = np.random.default_rng(3)
    samples, radius = list(SAMPLES), layout_of(ROBOT).radius_m[0]
    for place in range(2 * len(samples) // 3, len(samples)):
        if isinstance(samples[place], FootSample) and samples[place].touching:
            force, side = rng.normal(size=3), rng.normal(size=3)
            side = np.cross(force, side)
            miss = rng.uniform(1.0, 1.5) * radius * side / np.linalg.norm(side)  # from the sphere's centre
            centre = np.array([0.0, 0.0, layout_of(ROBOT).centre_height_m[0]])
            force *= 20 / np.linalg.norm(force)
            samples[place] = replace(samples[place], force_n=force, torque_nm=np.cross(centre + miss, force))
    estimate = after(samples)
    assert all(np.isfinite(bar.covariance).all() and np.isfinite(bar.T_world_bar).all() for bar in estimate.bars)
    assert 0.05 < estimate.friction < 1.5


@pytest.mark.parametrize("endcap", others_long([0, 3, 1, 2, 4, 5]))
def test_an_endcap_that_is_silent_for_a_while_changes_little(endcap):
    name = ROBOT.endcaps[endcap].name
    kept = [
        sample for sample in SAMPLES
        if not (isinstance(sample, FootSample) and sample.endcap == name and 1.0 < sample.time_s < 1.3)
    ]  # fmt: skip
    estimate = after(kept)
    assert stands(estimate) and estimate.endcaps[endcap].hold.word in ("holds", "free")
    silent = after([sample for sample in kept if not (isinstance(sample, FootSample) and sample.endcap == name)])
    assert silent.endcaps[endcap].hold.word == "unknown" and stands(silent)
    assert any(f"{name}: no reading" in note for note in silent.health.notes)


@pytest.mark.parametrize("scale", [1.35, 0.7])
def test_a_wrong_silicone_shows_in_the_weight_and_nowhere_else(scale):
    scaled = [
        replace(sample, force_n=scale * sample.force_n, torque_nm=scale * sample.torque_nm)
        if isinstance(sample, FootSample)
        else sample
        for sample in SAMPLES
    ]
    estimate, right = after(scaled), after(SAMPLES)
    assert abs(estimate.health.weight_ratio / right.health.weight_ratio - scale) < 0.05
    for one, two in zip(estimate.bars, right.bars, strict=True):
        assert np.abs(one.T_world_bar[:3, 3] - two.T_world_bar[:3, 3]).max() < 0.01


def test_a_cable_3_mm_off_moves_no_endcap_by_more_than_the_others_allow():
    off = [
        replace(sample, lengths_m=sample.lengths_m + 0.003 * (np.arange(9) == 4))
        if isinstance(sample, LengthSample)
        else sample
        for sample in SAMPLES
    ]
    estimate, right = after(off), after(SAMPLES)
    for one, two in zip(estimate.endcaps, right.endcaps, strict=True):
        assert np.linalg.norm(one.centre_m - two.centre_m) < 4 * np.sqrt(np.trace(one.covariance)) + 0.01


def test_without_contacts_the_drift_stays_inside_its_covariance():
    estimate = after(SAMPLES, Settings(contacts=Contacts.NONE))
    right = after(SAMPLES)
    away = estimate.centre_of_mass_m - right.centre_of_mass_m
    assert away @ np.linalg.solve(estimate.centre_of_mass_covariance, away) < 16
    assert np.trace(estimate.centre_of_mass_covariance) > 4 * np.trace(right.centre_of_mass_covariance)


def test_a_force_above_the_range_counts_less():
    flagged = [
        replace(sample, flags=frozenset({"out_of_range"})) if isinstance(sample, FootSample) else sample
        for sample in SAMPLES
    ]
    one, two = after(flagged).endcaps[0], after(SAMPLES).endcaps[0]
    assert one.normal_sd_rad >= two.normal_sd_rad and one.friction_ratio_sd > two.friction_ratio_sd


@pytest.mark.long
def test_a_reading_that_waits_for_the_next_frame_says_nothing():
    """The same bits as without a number; used as a measurement, a wrong force shows in the estimate."""

    def every_seventh(**changes):
        readings = 0
        for sample in SAMPLES:
            readings += isinstance(sample, FootSample)
            yield replace(sample, **changes) if isinstance(sample, FootSample) and readings % 7 == 0 else sample

    wrong = {"force_n": np.array([30.0, 30.0, 30.0]), "touching": False}
    held = after(list(every_seventh(**wrong, flags=frozenset({"unconfirmed"}))))
    missing = after(list(every_seventh(force_n=np.full(3, np.nan), touching=None)))
    taken = after(list(every_seventh(**wrong)))
    for one, two in zip(held.bars, missing.bars, strict=True):
        np.testing.assert_array_equal(one.T_world_bar, two.T_world_bar)
        np.testing.assert_array_equal(one.covariance, two.covariance)
    assert any((one.covariance != two.covariance).any() for one, two in zip(held.bars, taken.bars, strict=True))


@pytest.mark.long
def test_a_long_time_of_standing():
    _, samples = standing_samples(ROBOT, SECONDS, rate_hz=25.0, every=3)
    estimator = RobotEstimator(ROBOT, Settings(history_s=2.0))
    first = None
    for place, sample in enumerate(samples):
        feed(estimator, [sample])
        if first is None and place % 100 == 99:
            first = estimator.state()
    last = estimator.state()
    moved = last.centre_of_mass_m - first.centre_of_mass_m
    assert np.linalg.norm(moved) < 0.02
    assert moved @ np.linalg.solve(last.centre_of_mass_covariance + first.centre_of_mass_covariance, moved) < 16
    assert len(estimator._history._samples) < 600  # the past is bounded


def test_a_time_may_be_a_whole_number():
    first = [replace(s, time_s=0) if s.time_s == 0 else s for s in SAMPLES]
    assert bits(after(first)) == bits(after(SAMPLES))
