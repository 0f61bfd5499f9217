"""Pieces of the robot's filter by themselves, against draws, finite differences and formulas written out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm
from standing_robot import feed, standing_samples

from sensing.robot.contact import contact_of
from sensing.robot.contacts import _learn_normal
from sensing.robot.dome import count_load, dome_centre, unloaded
from sensing.robot.estimator import RobotEstimator
from sensing.robot.friction import COEFFICIENTS, FIRST, learned
from sensing.robot.jump import jumps
from sensing.robot.layout import layout_of
from sensing.robot.measurement_kernels import correct
from sensing.robot.report import report_of
from sensing.robot.settings import Settings
from sensing.robot.silence import MOVES_M_S, TURNS_RAD_S, follow_on, hold
from sensing.robot.start import gather, goes_on, nothing_gathered
from sensing.robot.state import MEAN_WEIGHT, empty_state
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample
from sensing.tensegrity.shape import rotation_of
from sensing.tensegrity.vectors import minus_cross

ROBOT = load_robot()
LAYOUT = layout_of(ROBOT)


def test_deviations_of_a_contact_are_those_of_drawn_wrenches():
    """The wrench is about the endcap's origin, and so is its covariance: force and torque go together."""
    rng, force, torque = np.random.default_rng(0), np.array([4.0, -6.0, -30.0]), np.array([0.25, 0.2, 0.01])
    root = np.diag([0.3, 0.3, 0.3, 0.01, 0.01, 0.01])
    root[3, 1], root[4, 0] = -0.02, 0.02  # a part of the torque is that of the force, at a lever
    name = ROBOT.endcaps[0].name

    def contact(wrench):
        return contact_of(FootSample(0.0, name, wrench[:3], wrench[3:], root @ root.T, True), 0, LAYOUT, Settings())

    mean = np.concatenate([force, torque])
    found = contact(mean)
    drawn = [contact(mean + root @ rng.normal(size=6)) for _ in range(3000)]
    spread = np.cov(np.array([d.normal for d in drawn]).T)
    assert found.normal_sd == pytest.approx(np.sqrt(np.trace(spread) / 2), rel=0.05)
    assert found.ratio_sd == pytest.approx(np.std([d.ratio for d in drawn]), rel=0.05)
    flagged = FootSample(0.0, name, force, torque, root @ root.T, True, frozenset({"out_of_range"}))
    assert contact_of(flagged, 0, LAYOUT, Settings()).normal_sd == pytest.approx(np.sqrt(2) * found.normal_sd)


@pytest.mark.parametrize("spin_m", [-0.008, 0.0, 0.008])
def test_the_normal_of_a_contact_that_pivots_under_load_is_that_of_its_place(spin_m):
    """Friction about the normal is a couple, which moves the line of action away from the contact."""
    radius, height = LAYOUT.radius_m[0], LAYOUT.centre_height_m[0]
    normal, along = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])  # out of the endcap; of the friction force
    force = -40.0 * normal + 16.0 * along
    torque = np.cross(height * np.array([0.0, 0.0, 1.0]) + radius * normal, force) + 40.0 * spin_m * normal
    found = contact_of(
        FootSample(0.0, ROBOT.endcaps[0].name, force, torque, np.eye(6) * 1e-16, True), 0, LAYOUT, Settings()
    )
    assert found.normal == pytest.approx(LAYOUT.endcap_turn[0] @ normal, abs=1e-9)
    assert (found.push_n, found.ratio, found.spin_m) == pytest.approx((40.0, 0.4, abs(spin_m)))
    share = abs(spin_m) / 0.01  # of the largest torque about the normal; the rest of the friction is left to the force
    assert found.use == pytest.approx(0.4 / np.sqrt(1 - share**2))
    assert found.use_sd == pytest.approx(0.3 * found.use * share**4, abs=1e-6)  # the ellipsoid is a model


def under(force_n, covariance=None, touching=None):
    """The contact of a force straight at a dome's tip, whose frame is turned against the bar's."""
    torque, name = np.zeros(3), ROBOT.endcaps[1].name
    spread = np.eye(6) * 1e-4 if covariance is None else covariance
    return contact_of(FootSample(0.0, name, np.array(force_n), torque, spread, touching), 1, LAYOUT, Settings())


def test_a_force_and_its_covariance_are_turned_into_the_bars_axes():
    turn, spread = LAYOUT.endcap_turn[1], np.diag([0.1, 0.2, 0.4, 0.01, 0.01, 0.01]) ** 2
    found = under([1.0, 2.0, -30.0], spread)
    assert not np.allclose(np.abs(turn), np.eye(3), atol=0.1)  # else nothing is shown
    assert found.force_n == pytest.approx(turn @ [1.0, 2.0, -30.0])
    assert found.force_covariance == pytest.approx(turn @ spread[:3, :3] @ turn.T)


@pytest.mark.parametrize("unknown", [0.0, -1.0, np.nan])
def test_a_covariance_that_says_nothing_counts_as_none(unknown):
    """With zeros, as messages have them that nobody filled, every noise of a force taught softness."""
    found, none = (under([1.0, 2.0, -30.0], np.eye(6) * value) for value in (unknown, np.nan))
    assert found.force_covariance == pytest.approx(none.force_covariance) and found.normal_sd == none.normal_sd
    assert np.diag(found.force_covariance).min() > 0.04


@pytest.mark.parametrize(("force_n", "said", "touches"), [(1.0, None, False), (2.0, None, True), (1.0, True, True)])
def test_a_sample_without_a_contact_bit_touches_from_the_least_force_on(force_n, said, touches):
    found = under([0.0, 0.0, -force_n], touching=said)
    assert found.touching is touches and found.known == (force_n > 1.5)


def test_a_force_under_which_no_dome_could_stay_a_dome_is_no_contact():
    """As a spike of a sensor: at 0.25 mm/N the yield is the radius at 260 N."""
    limit_n = LAYOUT.radius_m[1] / LAYOUT.compliance_m_n(1, Settings())
    assert under([0.0, 0.0, -0.9 * limit_n]).known and not under([0.0, 0.0, -1.1 * limit_n]).known


def test_an_error_of_a_force_is_an_error_of_the_yielding():
    """The anchor of a contact whose forces are noisy is known less well."""
    spreads = []
    for sd_n in (0.1, 20.0):
        estimator = RobotEstimator(ROBOT)
        for sample in standing_samples(ROBOT, 2.0, rate_hz=100.0)[1]:
            stated = np.diag([sd_n**2] * 3 + [25e-6] * 3)
            feed(estimator, [replace(sample, covariance=stated) if isinstance(sample, FootSample) else sample])
        spreads.append(float(np.trace(estimator.state().centre_of_mass_covariance)))
    assert spreads[1] > 1.5 * spreads[0]


def test_a_pose_that_is_held_becomes_as_doubtful_in_one_step_as_in_many():
    once, often = empty_state(LAYOUT, 0.0), empty_state(LAYOUT, 0.0)
    hold(once, 2.0, LAYOUT)
    for time_s in (0.1, 0.5, 0.9, 2.0):
        hold(often, time_s, LAYOUT)
    assert often.covariance == pytest.approx(once.covariance)
    place, turn = LAYOUT.place(0), LAYOUT.turn(0)
    assert once.covariance[place, place].diagonal() == pytest.approx(np.full(3, (MOVES_M_S * 2.0) ** 2))
    assert once.covariance[turn, turn].diagonal() == pytest.approx(np.full(3, (TURNS_RAD_S * 2.0) ** 2))


def test_what_begins_anew_heads_as_what_was_held():
    new, held, leader = empty_state(LAYOUT, 5.0), empty_state(LAYOUT, 4.0), LAYOUT.leader
    tilt = rotation_of(np.array([0.3, -0.2, 0.0]))
    held.turn[:] = rotation_of(np.array([0.0, 0.0, 1.4])) @ tilt
    new.turn[:] = rotation_of(np.array([0.0, 0.0, -0.5])) @ tilt
    held.place[:] = [1.0, 2.0, 0.3]
    turn = LAYOUT.turn(leader)
    held.covariance[turn, turn] = np.diag([0.01, 0.02, 0.3]) ** 2  # of the heading alone the new one knows nothing
    before = new.covariance[turn, turn].copy()
    follow_on(new, held, LAYOUT)
    assert new.turn[leader] == pytest.approx(held.turn[leader]) and new.place[leader, :2] == pytest.approx([1.0, 2.0])
    assert new.covariance[turn, turn] - before == pytest.approx(np.diag([0.0, 0.0, 0.3**2]))


def test_what_begins_anew_is_as_sure_of_its_place_far_from_the_origin_as_there():
    """Errors of places refer to a turn about the origin: 14 m from it a silence of 3 s was stated as 13 m, not 1 m."""
    estimator = RobotEstimator(ROBOT)
    feed(estimator, standing_samples(ROBOT, 1.5)[1])
    first = estimator._history.at(1.4).state
    assert first is not None

    def stated(state) -> np.ndarray:
        return report_of(state, state.time_s, 0, [], LAYOUT, Settings()).centre_of_mass_covariance

    def moved(shift: np.ndarray):
        state, whole = first.copy(), np.eye(LAYOUT.size)
        state.place += shift
        for bar in range(LAYOUT.bars):
            whole[LAYOUT.place(bar), LAYOUT.turn(LAYOUT.leader)] = -minus_cross(shift)
        state.covariance = whole @ state.covariance @ whole.T
        assert stated(state) == pytest.approx(stated(first), abs=1e-9)
        return state

    found = []
    for shift in (np.zeros(3), np.array([14.0, -3.0, 0.0])):
        held, new = moved(shift), first.copy()
        hold(held, held.time_s + 3.0, LAYOUT)
        follow_on(new, held, LAYOUT)
        found.append(stated(new))
    assert np.sqrt(found[0].diagonal()).max() < 1.0
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("slips", [0.02, 0.5, 0.95])
def test_the_likelihood_of_a_coefficient_is_that_of_slipping_or_of_holding(slips):
    ratio, sd = 0.5, 0.03
    spread = np.hypot(0.05 * (0.3 + COEFFICIENTS), sd)
    holds = 1 / (1 + np.exp(-1.702 * (COEFFICIENTS - ratio) / spread)) / COEFFICIENTS  # as good as norm.cdf
    slips_or_more = max(slips, 0.1)  # so many contacts slip whatever is known of this one
    likelihood = (1 - slips_or_more) * holds + slips_or_more * norm.pdf(COEFFICIENTS, ratio, spread) + 1e-2
    wanted = FIRST * likelihood**0.15
    wanted = (1 - 5e-4) * wanted / wanted.sum() + 5e-4 * FIRST
    assert learned(FIRST, ratio, sd, slips) == pytest.approx(wanted, rel=2e-3)


def test_a_correction_of_the_leaders_turn_turns_the_normals_with_it():
    state, change, vector = empty_state(LAYOUT, 0.0), np.zeros(LAYOUT.size), np.array([0.1, -0.3, 0.2])
    state.normal[:] = np.array([0.6, 0.0, 0.8])
    change[LAYOUT.turn(LAYOUT.leader)] = vector
    parts = (state.turn, state.place, state.velocity, state.rate_bias, state.force_bias, state.anchor, state.normal)
    correct(change, *parts, state.delay_s, state.creep, state.softness, LAYOUT.leader)
    assert state.normal == pytest.approx(np.tile(rotation_of(vector) @ [0.6, 0.0, 0.8], (LAYOUT.endcaps, 1)))


def test_a_normal_is_the_mean_of_its_measurements_as_long_as_it_does_not_wander():
    settings, state, rng = (
        replace(Settings(), normal_walk=0.0, normal_sd=1e-3),
        empty_state(LAYOUT, 0.0),
        np.random.default_rng(1),
    )
    drawn = np.array([0.0, 0.0, -1.0]) + 0.1 * rng.normal(size=(20, 3)) * [1, 1, 0]
    for number, normal in enumerate(drawn / np.linalg.norm(drawn, axis=1, keepdims=True)):
        contact = SimpleNamespace(normal=normal, normal_sd=0.1)
        _learn_normal(state, 0, contact, number == 0, 0.03, 0, settings)
        assert state.normal_variance[0] == pytest.approx((0.1**2 + 1e-6) / (number + 1))
    assert state.normal[0] == pytest.approx([*-drawn[:, :2].mean(axis=0), 1.0], abs=0.01)


def test_a_first_state_stands_on_the_ground_with_its_domes_pressed():
    estimator = RobotEstimator(ROBOT)
    feed(estimator, standing_samples(ROBOT, 1.2, noise=0.0, rate_hz=100.0)[1])
    state, compliance = estimator._history.at(estimator.newest_s).state, Settings().compliance_m_n
    standing = [k for k, contact in enumerate(state.contacts) if contact and contact.touching]
    heights = [(state.place[b] + state.turn[b] @ LAYOUT.endcap_lever[k])[2] for k, b in enumerate(LAYOUT.endcap_bar)]
    raised = [heights[k] + compliance * np.linalg.norm(state.contacts[k].force_n) for k in standing]
    assert len(standing) == 3 and np.mean(raised) == pytest.approx(LAYOUT.radius_m[0], abs=1e-3)


@pytest.mark.parametrize(("rate_rad_s", "is_moving"), [(0.08, False), (0.12, True)])
def test_a_bar_that_turns_on_over_the_whole_start_does_not_stand(rate_rad_s, is_moving):
    gathered, bar = nothing_gathered(LAYOUT, 0.0), 1
    gathered.first_s = 0.0
    for k in range(90):
        rate = LAYOUT.sensor_turn[bar].T @ [rate_rad_s, 0.0, 0.0]
        sample = InertialSample(0.01 * k, ROBOT.sensors[bar].name, rate, None)
        gather(gathered, 0.01 * k, bar, sample, LAYOUT, Settings())
    assert goes_on(gathered) is is_moving


def leaning_state():
    """A state of which the first endcap's bar leans and moves, and that endcap's contact."""
    sample = FootSample(
        0.0, ROBOT.endcaps[0].name, LAYOUT.endcap_turn[0].T @ [8.0, -3.0, 40.0], np.zeros(3), np.eye(6) * 1e-4, True
    )  # fmt: skip
    state = empty_state(LAYOUT, 0.0)
    state.turn[:], state.normal[0], state.velocity[0] = (
        rotation_of(np.array([0.1, -0.2, 0.3])),
        [0.6, 0.0, 0.8],
        [0.3, -0.1, -0.4],
    )
    contact = contact_of(sample, 0, LAYOUT, Settings())
    count_load(state, 0, contact, True, LAYOUT)
    return state, contact


@pytest.mark.parametrize(("name", "at"), [("delay_s", LAYOUT.delay), ("softness", LAYOUT.softness)])
def test_the_unloaded_dome_moves_with_delay_and_softness_as_finite_differences_do(name, at):
    settings, size, places = Settings(), 1e-4, []
    state, contact = leaning_state()
    for value in (0.002 - size, 0.002, 0.002 + size):
        getattr(state, name)[0] = value
        place, slopes = unloaded(state, 0, dome_centre(state, 0, contact, LAYOUT, settings), LAYOUT)
        places.append(place)
    normal, moves = state.normal[0], (places[2] - places[0]) / (2 * size)
    assert normal @ moves == pytest.approx(normal @ slopes[:, at], abs=1e-9) and abs(normal @ moves) > 5e-3
    across = slopes[:, at] - (normal @ slopes[:, at]) * normal  # the softness is learned along the normal alone
    assert across == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_dome_is_pressed_as_fast_as_its_own_centre_nears_the_ground():
    """Whether the bar moves as a whole or turns about its reference point."""
    state, contact = leaning_state()
    rate = np.array([0.5, -1.0, 0.3])
    turned, bar = state.copy(), int(LAYOUT.endcap_bar[0])
    turned.rate[bar] = rate + turned.rate_bias[bar]
    state.velocity[bar] += np.cross(state.turn[bar] @ rate, state.turn[bar] @ LAYOUT.endcap_lever[0])
    whole, spun = (dome_centre(each, 0, contact, LAYOUT, Settings()) for each in (state, turned))
    assert spun.lever_m == pytest.approx(whole.lever_m, abs=1e-12) and spun.delays_m_s == pytest.approx(
        whole.delays_m_s
    )


@pytest.mark.parametrize(("sds", "counts"), [(4.0, False), (4.5, True)])
def test_a_load_teaches_softness_where_it_differs_by_more_than_two_readings_errors(sds, counts):
    """Three deviations of a difference, whose variance is that of both."""
    state, contact = leaning_state()
    before, unit = state.load_n[0].copy(), contact.force_n / np.linalg.norm(contact.force_n)
    along = state.normal[0] @ state.turn[int(LAYOUT.endcap_bar[0])]
    heavier = replace(contact, force_n=contact.force_n + sds * 1e-2 * unit / (along @ unit))
    count_load(state, 0, heavier, False, LAYOUT)
    assert (np.linalg.norm(state.load_n[0] - before) > 1e-3) == counts


@pytest.mark.parametrize(("sds", "is_jump"), [(3.9, False), (-3.9, False), (4.1, True), (-4.1, True)])
def test_a_reading_four_deviations_off_its_anchor_is_a_jump_whose_consistency_counts_shared_errors(sds, is_jump):
    state, contact = leaning_state()
    state.covariance[:] = 0.0
    centre = dome_centre(state, 0, contact, LAYOUT, Settings())
    across = np.array([0.8, 0.0, -0.6])  # along the ground slips decide
    state.anchor[0] = unloaded(state, 0, centre, LAYOUT)[0] + sds * 1e-3 * state.normal[0] + 0.1 * across
    state.consistency[1] = 0.5
    assert jumps(state, 0, centre, 1e-6, 2.0, LAYOUT) is is_jump
    wanted = 0.5 + MEAN_WEIGHT * (sds**2 / 2.0 - 0.5) if is_jump else 0.5
    assert state.consistency[1] == pytest.approx(wanted)
