"""Inertial sensors slower than what they measure with: lengths and contacts fall between their samples."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from standing_robot import feed, standing_samples

from sensing.robot.between import TUNED_S, measured_errors, rate_walk, settle, turn_slopes, turn_variance
from sensing.robot.estimator import RobotEstimator
from sensing.robot.inertial import used_over_step
from sensing.robot.layout import layout_of
from sensing.robot.settings import Settings
from sensing.robot.state import empty_state
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import SensorSet, sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import InertialSample

ROBOT = load_robot()
LAYOUT = layout_of(ROBOT)
LEADER = LAYOUT.leader
NAME = LAYOUT.sensor_of_bar[LEADER]
OVER_S = 0.04  # between samples


@lru_cache(maxsize=1)
def walk():
    return simulate_walk(ROBOT, Terrain.FLAT, seed=1, duration_s=10.0)  # of the tuning gait


@lru_cache(maxsize=4)
def followed(inertial_hz: float):
    estimator = RobotEstimator(ROBOT)
    feed(estimator, [one.sample for one in sensor_stream(walk(), ROBOT, SensorSet(inertial_hz=inertial_hz), seed=1)])
    return estimator.state()


@pytest.mark.parametrize("inertial_hz", [15.0, 25.0, 50.0])
def test_slow_inertial_sensors_follow_a_walk(inertial_hz):
    """Contacts were compared with poses turned by the last rate: 57 mm off after 10 s at 25 Hz, 0.3 m at 15."""
    fast, slow = followed(200.0), followed(inertial_hz)
    assert np.linalg.norm(slow.centre_of_mass_m - fast.centre_of_mass_m) < 0.02
    assert abs(slow.softness) < 0.1 and slow.health.good, slow.health.notes


@pytest.mark.parametrize("inertial_hz", [25.0, 200.0])
def test_a_walk_with_one_inertial_sample_in_ten_lost_is_followed(inertial_hz):
    """The next sample counted for twice its time, as if nothing were missing: bars were off by 5 deviations."""
    rng, estimator = np.random.default_rng(1), RobotEstimator(ROBOT)
    stream = sensor_stream(walk(), ROBOT, SensorSet(inertial_hz=inertial_hz), seed=1)
    samples = [one.sample for one in stream]
    feed(estimator, [one for one in samples if not (isinstance(one, InertialSample) and rng.random() < 0.1)])
    found, whole = estimator.state(), followed(inertial_hz)
    assert np.linalg.norm(found.centre_of_mass_m - whole.centre_of_mass_m) < 0.02
    turns = [a.T_world_bar[:3, :3] @ b.T_world_bar[:3, :3].T for a, b in zip(found.bars, whole.bars, strict=True)]
    off = np.array([[turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]] for turn in turns]) / 2
    spreads = [bar.covariance[3:6, 3:6] for bar in found.bars]
    squares = [one @ np.linalg.solve(spread, one) for one, spread in zip(off, spreads, strict=True)]
    assert max(squares) < 16, squares


def test_sensors_too_slow_to_follow_are_named():
    """Of a robot that stands, too: before it walks."""
    notes = {}
    for rate_hz in (10.0, 15.0):
        estimator = RobotEstimator(ROBOT)
        feed(estimator, standing_samples(ROBOT, 2.0, rate_hz=rate_hz, every=1)[1])
        notes[rate_hz] = [note.split(",")[0] for note in estimator.state().health.notes if "samples a second" in note]
    assert notes[10.0] == [f"{sensor.name}: 10 samples a second" for sensor in ROBOT.sensors]
    assert not notes[15.0]


@pytest.mark.parametrize("rate_hz", [15.0, 25.0])
def test_samples_between_those_of_slow_sensors_may_come_in_any_order(rate_hz):
    """A sample of an inertial sensor changes what was computed since the one before it."""
    stream = sensor_stream(walk(), ROBOT, SensorSet(inertial_hz=rate_hz), seed=1)
    samples = [one.sample for one in stream if one.sample.time_s < 4.0]
    ends = []
    for delay_s in (0.0, 0.15, 0.3):
        late = np.random.default_rng(1).uniform(0, delay_s, len(samples))
        order = np.argsort(np.array([sample.time_s for sample in samples]) + late)
        estimator = RobotEstimator(ROBOT)
        for place in order:
            feed(estimator, [samples[place]])
            estimator.state()
        ends.append(estimator.state())
    assert (ends[0].bars[1].T_world_bar == ends[1].bars[1].T_world_bar).all()
    assert (ends[0].centre_of_mass_covariance == ends[2].centre_of_mass_covariance).all()


@pytest.mark.parametrize("inertial_hz", [25.0, 200.0])
def test_velocities_between_samples_are_as_sure_as_they_say(inertial_hz):
    """Regions of 95 % held the speed 20 % of the time at 25 Hz, and 84 at 200: they knew of no change since."""
    stream, truth = sensor_stream(walk(), ROBOT, SensorSet(inertial_hz=inertial_hz), seed=1), walk()
    estimator, inside, ask_s = RobotEstimator(ROBOT), [], 1.5
    for one in stream:
        feed(estimator, [one.sample])
        if ask_s < one.at_s < truth.time_s[-1]:
            ask_s, bar = ask_s + 0.1, estimator.state(at=one.at_s).bars[LEADER]
            axes = truth.velocity[:, LEADER, :3].T
            moves = np.linalg.norm([np.interp(one.at_s, truth.time_s, axis) for axis in axes])
            off = moves - np.linalg.norm(bar.velocity_m_s)
            inside.append(abs(off) < 1.96 * np.sqrt(np.trace(bar.covariance[6:, 6:]) / 3))
    assert len(inside) > 80 and np.mean(inside) > 0.9


def at_sample():
    """A state at a sample of the leading bar's sensor, all bars with an anchor, rates of any size."""
    rng, state = np.random.default_rng(3), empty_state(LAYOUT, 1.0)
    state.rate_s[:], state.force_s[:], state.rate_until_s[:] = 1.0, 1.0, 1.0
    state.rate_over_s[:], state.usual_s[:], state.silent_after_s[:] = OVER_S, OVER_S, 2 * OVER_S
    state.place[:], state.velocity[:] = rng.normal(size=(2, LAYOUT.bars, 3))
    state.anchor[:], state.anchored[:] = rng.normal(size=(LAYOUT.endcaps, 3)), 1
    settings = Settings()
    noises = 2 * settings.rate_noise**2 / OVER_S, 2 * settings.force_noise**2 / OVER_S
    state.rate_change[:], state.force_change[:] = np.array([[2 / 3 * OVER_S * 4.0], [2 / 3 * OVER_S * 9.0]]) + np.array(
        [[noises[0]], [noises[1]]]
    )
    return state


def test_a_sample_that_has_come_is_used_over_the_time_whose_mean_it_is():
    """Once only, whatever the steps, and not before the sample that it follows."""
    state, rate, turned = at_sample(), np.array([0.3, -2.0, 1.0]), np.zeros(3)
    sample = InertialSample(1.0 + OVER_S, NAME, rate, np.array([1.0, 2.0, 9.0]))
    turn = LAYOUT.sensor_turn[LEADER]
    for time_s in (1.007, 1.019, 1.033, sample.time_s):
        used = used_over_step(state, time_s, [sample], LAYOUT)
        assert used.heard[:, LEADER].all() and used.rate[LEADER] == pytest.approx(turn @ rate)
        turned, state.time_s = turned + used.rate[LEADER] * (time_s - state.time_s), time_s
    assert turned == pytest.approx(OVER_S * turn @ rate)
    assert state.rate_s[LEADER] == state.force_s[LEADER] == sample.time_s
    after = InertialSample(state.time_s + 0.2, NAME, 9 * rate, None)  # after a silence: a mean over nobody knows what
    used = used_over_step(state, state.time_s + 0.01, [after], LAYOUT)
    assert used.rate[LEADER] == pytest.approx(turn @ rate)


@pytest.mark.parametrize("contained", [True, False])
@pytest.mark.parametrize("since_s", [0.01, 0.02, 0.035])
def test_errors_between_samples_are_those_of_drawn_walks(contained, since_s):
    """Turns, velocities and places of rates and accelerations that walk at random, by the means over 40 ms."""
    rng, fine = np.random.default_rng(2), 400
    step_s = OVER_S / fine
    walks = np.cumsum(np.sqrt(step_s) * rng.normal(size=(20_000, 2 * fine)), axis=1)
    mean = walks[:, fine:].mean(axis=1) if contained else walks[:, :fine].mean(axis=1)
    off = np.cumsum(walks[:, fine:] - mean[:, None], axis=1) * step_s
    count = round(since_s / step_s)
    once, twice = off[:, count - 1].var(), (off[:, :count].sum(axis=1) * step_s).var()
    state = at_sample()
    state.time_s, state.rate_until_s[:] = 1.0 + since_s, 1.0 + (OVER_S if contained else 0.0)
    assert turn_variance(state, LEADER, Settings()) == pytest.approx(4.0 * once, rel=0.06)
    rows = np.zeros((2, LAYOUT.size))
    rows[0, LAYOUT.velocity(LEADER).start], rows[1, LAYOUT.place(LEADER).start] = 1.0, 1.0
    state.rate_change[:] = 0.0
    assert measured_errors(state, rows, LAYOUT, Settings()) == pytest.approx(9.0 * np.array([once, twice]), rel=0.06)


def test_places_keep_what_means_of_accelerations_do_not_show():
    """Of the mean over 40 ms; samples of 200 Hz leave what the noises were chosen with."""
    rng, fine = np.random.default_rng(2), 200
    step_s = OVER_S / fine
    walks = np.cumsum(np.sqrt(step_s) * rng.normal(size=(20_000, fine)), axis=1)
    off = np.cumsum(np.cumsum(walks - walks.mean(axis=1)[:, None], axis=1), axis=1)[:, -1] * step_s**2
    state = at_sample()
    settle(state, LEADER, LAYOUT, Settings())
    kept = state.covariance[LAYOUT.place(LEADER), LAYOUT.place(LEADER)]
    assert kept == pytest.approx(9.0 * off.var() * np.eye(3), rel=0.06, abs=1e-15)
    other = next(bar for bar in range(LAYOUT.bars) if not LAYOUT.has_force[bar])
    assert state.covariance[LAYOUT.place(LEADER), LAYOUT.place(other)] == pytest.approx(kept)
    fast = at_sample()
    fast.rate_over_s[:] = TUNED_S
    settle(fast, LEADER, LAYOUT, Settings())
    assert not fast.covariance.any()


@pytest.mark.parametrize("missing", [1, 2])
def test_what_a_missing_sample_leaves_is_what_drawn_walks_leave(missing):
    """The neighbours' mean for it: turns, velocities, and places that these moved until the sample came."""
    rng, fine = np.random.default_rng(2), 100
    step_s, count = OVER_S / fine, (2 + missing) * fine
    walks = np.cumsum(np.sqrt(step_s) * rng.normal(size=(20_000, count)), axis=1)
    old, new, lost = walks[:, :fine].mean(axis=1), walks[:, -fine:].mean(axis=1), walks[:, fine:-fine]
    off = (lost.mean(axis=1) - (old + new) / 2) * missing * OVER_S
    state, turn = at_sample(), LAYOUT.sensor_turn[LEADER].T
    state.silent_after_s[:] = 0.2
    time_s = 1.0 + (1 + missing) * OVER_S
    used = used_over_step(state, time_s, [InertialSample(time_s, NAME, turn @ np.ones(3), turn @ np.ones(3))], LAYOUT)
    assert used.rate[LEADER] == pytest.approx(np.full(3, (1 + missing / 2) / (1 + missing)))
    assert used.force[LEADER] == pytest.approx(used.rate[LEADER])
    state.time_s = time_s
    settle(state, LEADER, LAYOUT, Settings())
    spread, turns, velocities = state.covariance, LAYOUT.turn(LEADER), LAYOUT.velocity(LEADER)
    assert spread[turns, turns] == pytest.approx(4.0 * off.var() * np.eye(3), rel=0.06, abs=1e-12)
    at, without = velocities.start, at_sample()
    assert spread[at, at] > 9.0 * 0.94 * off.var()
    settle(without, LEADER, LAYOUT, Settings())
    place = LAYOUT.place(LEADER).start
    assert spread[place, place] > without.covariance[place, place] > 0


def test_errors_of_turns_between_samples_reach_measurements_by_their_slopes():
    state = at_sample()
    state.time_s += 0.03
    state.normal[:] = np.linalg.qr(np.random.default_rng(4).normal(size=(6, 3)))[0]
    state.force_change[:] = 0.0
    rows = np.random.default_rng(5).normal(size=(4, LAYOUT.size))
    expected = np.zeros(4)
    for bar in range(LAYOUT.bars):
        expected += turn_variance(state, bar, Settings()) * ((rows @ turn_slopes(state, bar, LAYOUT)) ** 2).sum(axis=1)
    assert rate_walk(state, LEADER, Settings()) == pytest.approx(4.0)
    assert expected.min() > 0 and measured_errors(state, rows, LAYOUT, Settings()) == pytest.approx(expected)
    state.time_s = 1.0
    assert not measured_errors(state, rows, LAYOUT, Settings()).any()
