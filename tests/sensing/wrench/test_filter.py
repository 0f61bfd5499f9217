"""The filter against an independent batch solution, closed-form signals, its own statistics, and abuse."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from textbook_filter import Textbook

from cad.errors import ParameterError
from sensing.records import Wrench
from sensing.wrench.filter import ARM_M, STANDARD, FilterConfig, Motion, WrenchFilter

SIGMA = np.array([0.15] * 3 + [0.02] * 3)
ARM = np.array([1.0] * 3 + [ARM_M] * 3)
SINGLE, BACKWARD = Motion(0.0, 300.0, 50.0), (Motion(walk=-1.0),)


def wrench(value, time_s, covariance=None, frame="endcap"):
    value = np.asarray(value, float)
    covariance = np.full((6, 6), np.nan) if covariance is None else covariance
    return Wrench(time_s, value[:3], value[3:], frame, covariance)


def capture_times(rate_hz, count, rng, dropped=0.1):
    times = np.cumsum(rng.normal(1 / rate_hz, 0.05 / rate_hz, count))
    return times[(rng.uniform(size=count) > dropped) | (np.arange(count) == 0)]


def test_filter_is_the_batch_gaussian_posterior():
    """One axis, all times at once: prior covariance of the whole path from the model, conditioned on the data."""
    rng = np.random.default_rng(0)
    times = capture_times(30, 25, rng)
    config = FilterConfig((SINGLE,))
    q, r, v0 = 300.0, 0.15**2, 50.0**2
    data = np.cumsum(rng.normal(size=(len(times), 6)), axis=0) * SIGMA
    tracker = WrenchFilter(config)
    for t, row in zip(times, data, strict=True):
        tracker.update(wrench(row, t))
    now = times[-1] + 0.03
    s = np.append(times, now) - times[0]
    low = np.minimum.outer(s, s)
    # integrated Brownian motion from rest, plus an unknown first rate, plus a flat (very wide) first value
    prior = q * (low**2 * (np.add.outer(s, s) - low) / 2 - low**3 / 6) + v0 * np.outer(s, s) + 1e5
    gram = prior[:-1, :-1] + r * np.eye(len(times))
    weight = np.linalg.solve(gram, prior[:-1, -1])
    reported = tracker.at(now)
    assert reported.force_n[0] == pytest.approx(weight @ data[:, 0], abs=1e-4)
    assert reported.covariance[0, 0] == pytest.approx(prior[-1, -1] - weight @ prior[:-1, -1], rel=1e-3)


def test_steps_are_those_of_the_textbooks_matrices_and_bayes_rule():
    """The last step is a surprise: of it all densities are 0 in floating point."""
    steady = Motion(0.01, 0.5, 1.0, steady=True)
    rng, motions = np.random.default_rng(4), (SINGLE, Motion(walk=40.0), Motion(2.0, 9000.0, 100.0), steady)
    noise = np.array([SIGMA**2 / 9 if motion.steady else SIGMA**2 for motion in motions])
    tracker, book = (
        WrenchFilter(FilterConfig(motions, memory=0.8, scatter=SIGMA / 3)),
        Textbook(motions, noise, SIGMA, ARM),
    )
    tracker.update(wrench(np.zeros(6), 0.0))
    for k, dt in enumerate((0.033, 0.05, 0.033, 0.4, 0.033)):
        measured = SIGMA * rng.normal(size=6) + (k == 4) * 400.0
        book.predict(dt)
        nis = book.nis(measured)
        if k < 4:
            book.weigh(measured)
        assert book.correct(measured) == (k == 4)
        after = tracker.update(wrench(measured, tracker._last.time_s + dt))
        assert tracker.nis == pytest.approx(nis, rel=1e-9)
        assert tracker._state == pytest.approx(book.x.transpose(0, 2, 1), rel=1e-9)
        covariance = np.stack([book.P[:, :, 0, 0], book.P[:, :, 0, 1], book.P[:, :, 1, 1]], axis=1)
        assert tracker._covariance == pytest.approx(covariance, rel=1e-9)
        if k < 4:
            assert np.concatenate([after.force_n, after.torque_nm]) == pytest.approx(book.value(), rel=1e-9)
            assert after.covariance.diagonal() == pytest.approx(book.variance(), rel=1e-9)
    assert book.lost


@pytest.mark.parametrize("rate_hz", [30, 60, 120])
def test_innovations_are_consistent_when_the_model_holds(rate_hz):
    rng = np.random.default_rng(rate_hz)
    found = []
    for _ in range(20):
        times = capture_times(rate_hz, 60, rng)
        value, slope = np.zeros(6), SINGLE.start_rate * ARM * rng.normal(size=6)
        tracker = WrenchFilter(FilterConfig((SINGLE,)))
        for k, t in enumerate(times):
            if k:
                dt = t - times[k - 1]
                joint = np.linalg.cholesky(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]))
                kick = (joint @ rng.normal(size=(2, 6))) * np.sqrt(SINGLE.acceleration) * ARM
                value, slope = value + dt * slope + kick[0], slope + kick[1]
            tracker.update(wrench(value + SIGMA * rng.normal(size=6), t))
            if k:
                found.append(tracker.nis)
    total, freedom = np.sum(found), 6 * len(found)
    low, high = stats.chi2.ppf([1e-4, 1 - 1e-4], freedom)
    assert low < total < high


@pytest.mark.parametrize("rate_hz", [30, 120])
def test_a_ramp_is_reported_without_lag(rate_hz):
    rng = np.random.default_rng(1)
    slope = np.array([10, -5, 20, 0.3, 0.2, -0.1])
    tracker = WrenchFilter()
    times = capture_times(rate_hz, 3 * rate_hz, rng, dropped=0.2)
    for t in times:
        tracker.update(wrench(slope * t, t))
    reported = tracker.at(times[-1] + 0.08)
    off = np.concatenate([reported.force_n, reported.torque_nm]) - slope * (times[-1] + 0.08)
    left = np.abs(off / (0.08 * slope))
    assert left[:3].max() < 0.005  # the motions without a rate keep a little probability,
    assert left[3:].max() < 0.02  # and more where a step of the ramp is a tenth of the noise


@pytest.mark.parametrize("rate_hz", [30, 60, 120])
@pytest.mark.parametrize("latency_s", [0.03, 0.06])
def test_prediction_to_now_beats_holding_the_last_estimate(rate_hz, latency_s):
    ratio, covered = against_holding(FilterConfig(), 1.0, rate_hz, latency_s)
    assert (ratio[:3] < 0.45).all()  # one motion: 0.5 to 0.6
    assert covered > 0.95  # one motion: 0.4 to 0.8


@pytest.mark.parametrize(("turns_hz", "rate_hz"), [(6.0, 30), (8.0, 30), (12.0, 60)])
def test_what_turns_too_fast_to_be_predicted_is_held(turns_hz, rate_hz):
    ratio, covered = against_holding(FilterConfig(), turns_hz, rate_hz, 0.05)
    assert ratio.max() < 1.15 and covered > 0.9
    worse, missed = against_holding(FilterConfig((SINGLE,)), turns_hz, rate_hz, 0.05)
    assert worse.max() > 1.3 and missed < 0.9


def against_holding(config, turns_hz, rate_hz, latency_s):
    """Errors of the prediction on sines over those of the last measurement, and share inside the 95 % interval."""
    rng = np.random.default_rng(2)
    times = capture_times(rate_hz, 4 * rate_hz, rng)
    swing = np.array([8, 6, 10, 0.6, 0.5, 0.2])

    def signal(t):
        return swing * np.sin(2 * np.pi * turns_hz * t + np.arange(6))

    tracker = WrenchFilter(config)
    held, reported, inside = [], [], []
    for t in times:
        measured = signal(t) + SIGMA * rng.normal(size=6)
        tracker.update(wrench(measured, t))
        if t > 0.5:
            answer = tracker.at(t + latency_s)
            truth = signal(t + latency_s)
            reported.append(np.concatenate([answer.force_n, answer.torque_nm]) - truth)
            held.append(measured - truth)
            inside.append(np.abs(reported[-1]) < 1.96 * np.sqrt(answer.covariance.diagonal()))
    ratio = np.sqrt(np.mean(np.square(reported), axis=0) / np.mean(np.square(held), axis=0))
    return ratio, float(np.mean(inside))


def test_an_impact_is_followed_within_two_frames():
    tracker = WrenchFilter()
    for k in range(30):
        tracker.update(wrench(np.zeros(6), k / 30))
    jump = np.array([0, 0, -25.0, 0, 0, 0])
    tracker.update(wrench(jump, 1.0))
    after = tracker.update(wrench(jump, 1.0 + 1 / 30))
    assert abs(after.force_n[2] + 25) < 1.0


def test_late_missing_stale_and_gaps_are_said():
    tracker = WrenchFilter()
    assert "missing" in tracker.update(wrench(np.full(6, np.nan), 0.0)).flags
    tracker.update(wrench(np.ones(6), 1.0))
    assert "late" in tracker.update(wrench(np.full(6, 99.0), 0.9)).flags and tracker.late == 1
    twice = tracker.update(wrench(np.full(6, 1.1), 1.0))  # the same frame again
    assert "late" in twice.flags and tracker.late == 2 and np.allclose(twice.force_n, 1)
    missing = tracker.update(wrench([np.inf, 0, 0, 0, 0, 0], 1.03))
    assert "missing" in missing.flags and np.allclose(missing.force_n, 1)
    zeros = replace(wrench(np.zeros(6), 1.04), flags=frozenset({"missing"}))  # what a model without dots answers
    assert np.allclose(tracker.update(zeros).force_n, 1)
    assert "stale" not in tracker.at(1.1).flags and "stale" in tracker.at(1.3).flags
    ramp = WrenchFilter()
    for k in range(30):
        ramp.update(wrench(k * SIGMA, k / 30))
    newest, longest, beyond = (ramp.at(29 / 30 + ahead_s).force_n for ahead_s in (0.0, 0.15, 0.6))
    assert np.allclose(longest, beyond) and (longest > newest + 3 * SIGMA[:3]).all()  # a stale value stays
    far = tracker.update(wrench(np.full(6, 5.0), 3.0))
    assert np.allclose(far.force_n, 5.0) and np.isnan(tracker.nis)  # started anew
    with pytest.raises(ParameterError, match="causal"):
        tracker.at(2.0)
    with pytest.raises(ParameterError, match="frame='ft'"):
        tracker.update(wrench(np.zeros(6), 3.1, frame="ft"))
    with pytest.raises(ParameterError, match="no estimate yet"):
        WrenchFilter().at(0.0)
    bad_ones = {"noise": [np.zeros(6)], "scatter": [np.nan], "memory": [0.0], "motions": [(), BACKWARD]}
    for name, bad in ((name, bad) for name, values in bad_ones.items() for bad in values):
        with pytest.raises(ParameterError, match=f"{name}="):
            FilterConfig(**{name: bad})


def test_after_a_gap_the_filter_is_a_new_one_to_the_bit():
    old, new = WrenchFilter(), WrenchFilter()
    for k in range(60):
        old.update(wrench(k * SIGMA, k / 30))
    spread = np.diag((2 * SIGMA) ** 2)
    for k in range(6):
        measured = wrench((5 - k) * SIGMA, 3.0 + k / 30, spread)
        answers = [tracker.update(measured) for tracker in (old, new)]
        answers += [tracker.now(measured.time_s + 0.05) for tracker in (old, new)]
        for one, other in (answers[:2], answers[2:]):
            assert (one.force_n == other.force_n).all() and (one.covariance == other.covariance).all()
        if k == 0:  # nothing was averaged: as sure as the first estimate is, whatever of its error repeats
            assert answers[0].covariance.diagonal() == pytest.approx(spread.diagonal())


def test_a_thousand_restarts_never_give_nan_or_lose_definiteness():
    rng = np.random.default_rng(5)
    for _ in range(1000):
        tracker = WrenchFilter()
        t = float(rng.uniform(0, 1e6))
        for _ in range(6):
            t += float(10 ** rng.uniform(-7, 0.5))
            size = 10 ** rng.uniform(-8, 8)
            covariance = np.diag(10 ** rng.uniform(-20, 6, 6)) if rng.uniform() < 0.5 else np.full((6, 6), np.nan)
            value = rng.normal(size=6) * size
            if rng.uniform() < 0.2:
                value[rng.integers(6)] = rng.choice([np.nan, np.inf])
            tracker.update(wrench(value, t, covariance))
            if not np.isnan(tracker._state).any() and tracker._last is not None:
                reported = tracker.at(t + float(rng.uniform(0, 0.3)))
                assert np.isfinite(reported.force_n).all() and np.isfinite(reported.covariance).all()
                assert (np.linalg.eigvalsh(reported.covariance) > 0).all()
        value, mixed, rate = tracker._covariance.transpose(1, 0, 2)
        moving = np.array([motion.start_rate > 0 for motion in STANDARD])
        definite = (value > 0).all() and (value * rate > mixed**2)[moving].all() and (rate[~moving] == 0).all()
        assert (np.isfinite(tracker._state).all() and definite) or tracker._last is None


# --- prediction to now -------------------------------------------------------------------------------------------
def late_errors(path, rate_hz=60.0, delay_s=0.05, noise_n=0.1, seconds=6.0, seed=0):
    """(2,) RMSE of the force: the last value held, and what ``now`` says."""
    rng = np.random.default_rng(seed)
    tracker, rows = WrenchFilter(), []
    covariance = np.diag([noise_n**2] * 3 + [1e-4] * 3)
    for time_s in capture_times(rate_hz, int(seconds * rate_hz), rng, 0.05):
        force = np.array([0.0, 0.0, path(time_s)]) + rng.normal(0, noise_n, 3)
        held = tracker.update(wrench([*force, 0, 0, 0], time_s, covariance))
        if time_s > 1.0:
            rows.append(
                [
                    (held.force_n[2] - path(time_s + delay_s)) ** 2,
                    (tracker.now(time_s + delay_s).force_n[2] - path(time_s + delay_s)) ** 2,
                ]
            )
    return np.sqrt(np.mean(rows, axis=0))


@pytest.mark.parametrize(
    "path",
    [
        lambda t: -10.0,
        lambda t: 5 * np.sin(2 * np.pi * 9 * t),
        lambda t: 10.0 * np.sign(np.sin(2 * np.pi * 0.7 * t)),
        lambda t: 6 * (4.0 * t % 1.0),
        lambda t: -20 * max(0.0, np.sin(2 * np.pi * 3 * t)) ** 8,
    ],
    ids=["rest", "fast sine", "steps", "saw", "impacts"],
)
def test_now_is_no_worse_than_holding_where_nothing_can_be_known(path):
    for seed in range(3):
        held, now = late_errors(path, seed=seed)
        assert now < 1.02 * held


@pytest.mark.parametrize(
    "path", [lambda t: 40 * abs(t % 2 - 1), lambda t: 5 * np.sin(2 * np.pi * 0.8 * t)], ids=["ramps", "sine"]
)
def test_now_is_better_than_holding_on_a_steady_motion(path):
    held, now = late_errors(path)
    assert now < 0.6 * held


def test_now_is_at_when_the_rate_came_true_and_the_last_value_at_first():
    tracker = WrenchFilter()
    tracker.update(wrench(np.zeros(6), 0.0))
    assert tracker.now(0.05).force_n == pytest.approx(np.zeros(3))
    tracker.update(wrench([1, 0, 0, 0, 0, 0], 0.03))
    assert tracker.now(0.08).force_n == pytest.approx(tracker.at(0.03).force_n)  # nothing was compared yet
    for k in range(2, 90):
        tracker.update(wrench([k, 0, 0, 0, 0, 0], 0.03 * k))
    full, held, now = tracker.at(2.72).force_n[0], tracker.at(2.67).force_n[0], tracker.now(2.72)
    assert (
        0.9 * (full - held) < now.force_n[0] - held <= full - held
        and now.covariance[0, 0] >= tracker.at(2.72).covariance[0, 0]
    )
    left = full - now.force_n[0]  # what is left out of the rate widens the covariance
    assert now.covariance[0, 0] - tracker.at(2.72).covariance[0, 0] == pytest.approx(left**2, rel=1e-6) and left > 0
    tracker.update(wrench([3, 0, 0, 0, 0, 0], 9.0))  # a gap starts anew
    assert tracker.now(9.05).force_n[0] == pytest.approx(3.0)
