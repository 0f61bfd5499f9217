"""The filter's steady motions: what stands scatters less, what moves is not late, and intervals stay honest."""

import numpy as np
import pytest

from sensing.records import Wrench
from sensing.wrench.filter import FilterConfig, WrenchFilter

SCATTER = FilterConfig().scatter
REPORTED = np.diag((3 * SCATTER) ** 2)  # as the model's at rest


def standing(force_n, seed, frames=300, rate_hz=30.0):
    """(frames, 6) answers and deviations of a wrench that is given frame by frame, scattering as pictures do."""
    rng, tracker, answers, deviations = np.random.default_rng(seed), WrenchFilter(), [], []
    for k in range(frames):
        path = np.array([0, 0, force_n(k / rate_hz), 0, 0, 0])
        value = path + SCATTER * rng.normal(size=6)
        after = tracker.update(Wrench(k / rate_hz, value[:3], value[3:], "endcap", REPORTED))
        answers.append([*after.force_n, *after.torque_nm])
        deviations.append(np.sqrt(after.covariance.diagonal()))
    return np.array(answers), np.array(deviations)


@pytest.mark.parametrize("load_n", [0.0, -20.0])
def test_a_force_that_stands_scatters_half_as_much_and_what_repeats_stays_in_the_covariance(load_n):
    answers, deviations = standing(lambda t: load_n, seed=11)
    off = answers[30:] - [0, 0, load_n, 0, 0, 0]
    assert (off.std(axis=0) < 0.65 * SCATTER).all()
    assert (deviations[30:] > 0.94 * 3 * SCATTER).all()  # all but the scatter itself: sqrt(8 / 9)


def test_the_interval_holds_where_most_of_the_error_repeats():
    inside = []
    for seed in range(40):
        repeats = np.sqrt(8) * SCATTER * np.random.default_rng(1000 + seed).normal(size=6)
        answers, deviations = standing(lambda t, off=repeats[2]: off - 5.0, seed, frames=60)
        inside.append((np.abs(answers[20:, 2] + 5.0) < 1.96 * deviations[20:, 2]).mean())
    assert 0.9 < np.mean(inside) <= 1.0  # 0.88 without the steady motions, 0.18 if all of it counted as new


@pytest.mark.parametrize("step_n", [-0.08, -1.0, -20.0])
def test_a_step_is_answered_in_its_own_frame(step_n):
    for seed in range(5):
        answers, deviations = standing(lambda t: step_n if t >= 2.0 else 0.0, seed=seed, frames=75)
        assert abs(answers[60, 2] - step_n) < abs(step_n) / 5 + 3 * SCATTER[2]
        assert abs(answers[61:, 2] - step_n).max() < 4 * SCATTER[2]
        assert deviations[64:, 2].max() < 4 * SCATTER[2]  # 20 if the steady motions did not start again


@pytest.mark.parametrize("slope", [-0.05, -0.1, -0.3, -1.0, -10.0])
def test_slow_ramps_stay_within_the_scatter_and_the_interval(slope):
    path = np.minimum(np.arange(300) / 30 - 2.0, 5.0).clip(0) * slope
    off = np.array([standing(lambda t: slope * min(max(t - 2.0, 0.0), 5.0), seed)[0][:, 2] - path for seed in range(8)])
    assert np.sqrt((off**2).mean()) < SCATTER[2]  # a measurement's own
    assert (np.abs(off) < 1.96 * 3 * SCATTER[2]).mean() > 0.99


def test_what_repeats_is_that_of_the_last_estimate():
    """A frame whose estimate is less sure (dots are lost) makes the answer less sure at once."""
    tracker, sure = WrenchFilter(), np.diag([0.02**2] * 3 + [2e-3**2] * 3)
    for k in range(40):
        tracker.update(Wrench(k / 30, np.array([0, 0, -5.0]), np.zeros(3), "sphere", sure))
    after = tracker.update(Wrench(40 / 30, np.array([0, 0, -5.0]), np.zeros(3), "sphere", 100 * sure))
    assert after.covariance[2, 2] > 50 * sure[2, 2]


@pytest.mark.parametrize(("load_scale", "radius_mm"), [(0.6, 49.45), (1.0, 125.0), (9.8, 125.0)])
def test_another_dome_is_filtered_as_the_released_one_in_its_own_loads_and_radius(load_scale, radius_mm):
    """Torques go with forces and the radius: with the released lever those of D=250 scattered 1.5 times as much."""
    unit = np.repeat([load_scale, load_scale * radius_mm / 65.0], 3)
    released, other = WrenchFilter(), WrenchFilter(FilterConfig().scaled(load_scale, radius_mm))
    rng = np.random.default_rng(5)
    for k in range(200):
        value = 2.0 * max(0.0, np.sin(k / 20)) * np.array([0, 0, -1, 0.02, 0, 0]) + SCATTER * rng.normal(size=6)
        one = released.update(Wrench(k / 30, value[:3], value[3:], "sphere", REPORTED))
        value, covariance = unit * value, REPORTED * np.outer(unit, unit)
        same = other.update(Wrench(k / 30, value[:3], value[3:], "sphere", covariance))
        assert np.concatenate([same.force_n, same.torque_nm]) / unit == pytest.approx(
            np.concatenate([one.force_n, one.torque_nm]), rel=1e-6, abs=1e-9
        )
        assert same.covariance / np.outer(unit, unit) == pytest.approx(one.covariance, rel=1e-6)
