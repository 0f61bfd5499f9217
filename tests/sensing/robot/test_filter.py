"""Slopes of the filter against finite differences, what nobody can measure, and what lengths leave open."""

from __future__ import annotations

import numpy as np
import pytest
from standing_robot import UP

from sensing.robot.contact import contact_of
from sensing.robot.contact_kernels import line_of_action_slopes
from sensing.robot.dome import dome_centre, unloaded
from sensing.robot.friction import COEFFICIENTS, FIRST, learned, moments, slip_probability
from sensing.robot.kernels import predict_step
from sensing.robot.layout import layout_of
from sensing.robot.measurement_kernels import correct, length_slopes, point_slopes, update_step
from sensing.robot.settings import Settings
from sensing.robot.silence import lead
from sensing.robot.slide import move_by_creep
from sensing.robot.state import empty_state
from sensing.tensegrity.description import GRAVITY_M_S2
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample
from sensing.tensegrity.shape import balanced_shape, cable_lengths, rotation_of

ROBOT = load_robot()
LAYOUT = layout_of(ROBOT)
NO_NOISE = np.zeros((3, 3)), np.zeros((3, 2))


class Moving:
    """A state of the robot in motion, with three anchors."""

    def __init__(self, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        poses = balanced_shape(ROBOT).T_world_bar
        self.turn = np.array([rotation_of(rng.normal(0, 0.2, 3)) @ pose[:3, :3] for pose in poses])
        self.place = poses[:, :3, 3] + rng.normal(0, 0.3, (3, 3)) + [2.0, -1.0, 0.5]
        self.velocity, self.rate_bias, self.force_bias = rng.normal(0, 0.5, (3, 3, 3))
        self.rate, self.force = rng.normal(0, 1.0, (3, 3)), rng.normal(0, 3.0, (3, 3)) + GRAVITY_M_S2 * UP
        self.anchor, normal = rng.normal(0, 1.0, (6, 3)), rng.normal(0, 0.3, (6, 3)) + UP
        self.normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        self.creep, self.softness = rng.normal(0, 0.01, (2, 1))
        self.delay_s = rng.normal(0, 0.005, 1)
        self.anchored = np.array([1, 0, 1, 0, 1, 0])

    def parts(self):
        return (
            self.turn,
            self.place,
            self.velocity,
            self.rate_bias,
            self.force_bias,
            self.anchor,
            self.normal,
            self.delay_s,
            self.creep,
            self.softness,
        )

    def copy(self) -> Moving:
        other = Moving()
        for name, value in vars(self).items():
            setattr(other, name, value.copy())
        return other

    def corrected(self, change) -> Moving:
        other = self.copy()
        correct(change, *other.parts(), LAYOUT.leader)
        return other

    def predicted(self, covariance, step_s: float, noise=NO_NOISE) -> Moving:
        other, fade = self.copy(), np.array([0.0, 3.0, 0.0])
        other.rate_bias *= np.exp(-step_s * fade)[:, None]
        has_force = np.array([1, 2, 2])
        predict_step(
            covariance, other.turn, other.place, other.velocity, other.anchor, other.normal, other.anchored,
            other.rate - other.rate_bias, other.force - other.force_bias, has_force, LAYOUT.leader, LAYOUT.endcap_bar,
            LAYOUT.radius_m, np.ones(6, np.int64), *noise, fade, step_s, GRAVITY_M_S2,
        )  # fmt: skip
        return other

    def less(self, other: Moving, leader: int = LAYOUT.leader):
        """(N,) error state that takes the other to this one, where a bar leads."""
        change = np.zeros(LAYOUT.size)
        for bar in range(3):
            turned = self.turn[bar] @ other.turn[bar].T
            change[LAYOUT.turn(bar)] = 0.5 * (turned - turned.T)[[2, 0, 1], [1, 2, 0]]
        whole = self.turn[leader] @ other.turn[leader].T
        for bar in range(3):
            change[LAYOUT.place(bar)] = self.place[bar] - whole @ other.place[bar]
            change[LAYOUT.velocity(bar)] = self.velocity[bar] - whole @ other.velocity[bar]
            change[LAYOUT.rate_bias(bar)] = self.rate_bias[bar] - other.rate_bias[bar]
            change[LAYOUT.force_bias(bar)] = self.force_bias[bar] - other.force_bias[bar]
        for endcap in range(6):
            change[LAYOUT.anchor(endcap)] = self.anchor[endcap] - whole @ other.anchor[endcap]
        change[LAYOUT.delay] = self.delay_s[0] - other.delay_s[0]
        change[LAYOUT.creep] = self.creep[0] - other.creep[0]
        change[LAYOUT.softness] = self.softness[0] - other.softness[0]
        return change


def test_the_prediction_moves_errors_as_finite_differences_do():
    state, step_s, size = Moving(), 1e-3, 1e-6
    after = state.predicted(np.zeros((LAYOUT.size, LAYOUT.size)), step_s)
    some = np.arange(LAYOUT.size)
    for column in some:
        spread = np.zeros((LAYOUT.size, LAYOUT.size))
        spread[column, column] = 1.0
        state.predicted(spread, step_s)
        change = np.zeros(LAYOUT.size)
        change[column] = size
        slope = state.corrected(change).predicted(np.zeros_like(spread), step_s).less(after) / size
        free = np.ones(LAYOUT.size, bool)
        for endcap in (1, 3, 5):  # without an anchor nothing moves there
            free[LAYOUT.anchor(endcap)] = False
        assert np.abs(spread - np.outer(slope, slope))[np.ix_(free, free)].max() < 2e-4, column  # of order step^2


@pytest.mark.parametrize("bar", range(3))
def test_the_noise_of_a_rate_turns_its_bar_and_rolls_its_anchors(bar):
    """Covariance of one step against finite differences after the rate."""
    state, step_s, size = Moving(2), 1e-3, 1e-3
    state.anchored[:] = 1
    quiet = np.zeros((LAYOUT.size, LAYOUT.size))
    before, slopes = state.predicted(quiet, step_s), []
    for nudge in size * np.eye(3):
        other = state.copy()
        other.rate[bar] += state.turn[bar].T @ nudge / step_s
        slopes.append(other.predicted(0 * quiet, step_s).less(before) / size)
    spread, density = 0 * quiet, NO_NOISE[0].copy()
    density[bar, 0] = 1.0
    state.predicted(spread, step_s, (density, NO_NOISE[1]))
    expected = step_s * np.transpose(slopes) @ slopes
    assert np.abs(spread - expected).max() < 0.01 * expected.max()
    rolled = [spread[LAYOUT.anchor(e), LAYOUT.turn(bar)] for e in range(6) if LAYOUT.endcap_bar[e] == bar]
    assert all(np.abs(each).max() > 0.03 * step_s for each in rolled)  # about a radius of 0.065 m


@pytest.mark.parametrize("leader", [1, 2])
def test_errors_refer_to_the_bar_that_leads(leader):
    """The same small error, of the state with one leading bar and with another one."""
    here, small = Moving(3), 1e-5 * np.random.default_rng(5).normal(size=LAYOUT.size)
    small[np.r_[LAYOUT.anchor(1), LAYOUT.anchor(3), LAYOUT.anchor(5)]] = 0.0
    true, state = here.corrected(small), empty_state(LAYOUT, 0.0)
    state.place, state.velocity, state.anchor, state.anchored = here.place, here.velocity, here.anchor, here.anchored
    state.covariance = np.outer(small, small)
    lead(state, leader, LAYOUT)
    wanted = true.less(here, leader)
    wanted[np.r_[LAYOUT.anchor(1), LAYOUT.anchor(3), LAYOUT.anchor(5)]] = 0.0  # without an anchor
    assert state.leader == leader and np.abs(wanted - small).max() > 1e-5
    assert np.abs(state.covariance - np.outer(wanted, wanted)).max() < 1e-3 * np.outer(wanted, wanted).max()


def test_points_and_lengths_have_the_slopes_of_finite_differences():
    state, size = Moving(1), 1e-6
    lever = np.array([0.1, -0.2, 0.3])
    _, slopes = point_slopes(state.turn, state.place, 1, lever, LAYOUT.leader, LAYOUT.size)
    length, rows = length_slopes(
        state.turn, state.place, LAYOUT.cable_bars, LAYOUT.cable_levers, LAYOUT.leader, LAYOUT.size
    )
    for column in range(LAYOUT.size):
        change = np.zeros(LAYOUT.size)
        change[column] = size
        more, less = state.corrected(change), state.corrected(-change)
        moved = [s.place[1] + s.turn[1] @ lever for s in (more, less)]
        assert np.abs((moved[0] - moved[1]) / (2 * size) - slopes[:, column]).max() < 1e-7
        lengths = [
            length_slopes(s.turn, s.place, LAYOUT.cable_bars, LAYOUT.cable_levers, LAYOUT.leader, LAYOUT.size)[0]
            for s in (more, less)
        ]
        assert np.abs((lengths[0] - lengths[1]) / (2 * size) - rows[:, column]).max() < 1e-7
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, :3] = state.turn
    poses[:, :3, 3] = state.place - np.einsum("bij,bj->bi", state.turn, LAYOUT.reference_m)
    assert np.abs(length - cable_lengths(ROBOT, poses)[0]).max() < 1e-12


def test_heading_and_place_are_never_known_better():
    """A turn about the vertical and a shift leave every measurement as it is, at any state and at all times."""
    unknown = np.zeros((LAYOUT.size, 4))
    for bar in range(3):
        unknown[LAYOUT.turn(bar), 3] = UP
        unknown[LAYOUT.place(bar), :3] = np.eye(3)
    for endcap in range(6):
        unknown[LAYOUT.anchor(endcap), :3] = np.eye(3)
    for seed in range(3):
        state = Moving(seed)
        _, rows = length_slopes(
            state.turn, state.place, LAYOUT.cable_bars, LAYOUT.cable_levers, LAYOUT.leader, LAYOUT.size
        )
        assert np.abs(rows @ unknown).max() < 1e-12
        spread = unknown @ unknown.T
        state.anchored[:] = 1
        state.predicted(spread, 0.005)
        assert np.abs(spread - unknown @ unknown.T).max() < 1e-12


def test_at_the_prism_lengths_leave_one_motion_and_three_turns_open():
    poses = balanced_shape(ROBOT).T_world_bar
    slopes = cable_lengths(ROBOT, poses)[1]
    values = np.linalg.svd(slopes, compute_uv=False)
    assert (values > 1e-3).sum() == 8  # nine lengths, eight motions: the ninth is of second order
    assert slopes.shape[1] - 8 - 6 - 3 == 1  # 18 less eight, less the rigid motions, less the turns about the bars


def test_normal_ratio_and_need_have_the_slopes_of_finite_differences_and_no_scale():
    wrench = np.array([4.0, -3.0, -30.0, 0.2, 0.35, 0.05])
    value, slopes = line_of_action_slopes(wrench, 0.065, 0.01)
    for column, size in enumerate([1e-4] * 3 + [1e-6] * 3):
        step = np.zeros(6)
        step[column] = size
        more, less = (line_of_action_slopes(wrench + sign * step, 0.065, 0.01)[0] for sign in (1, -1))
        assert np.allclose((more - less) / (2 * size), slopes[:, column], rtol=1e-4, atol=1e-4)
    scaled, _ = line_of_action_slopes(1.35 * wrench, 0.065, 0.01)
    assert np.allclose(np.delete(scaled, 3), np.delete(value, 3)) and np.isclose(scaled[3], 1.35 * value[3])


def test_an_anchor_creeps_against_its_friction_force_and_shares_the_error_of_its_creep():
    state, turned_m = empty_state(LAYOUT, 0.0), np.array([0.006, -0.003, 0.001])
    state.creep[0], rng = 0.02, np.random.default_rng(4)
    root = rng.normal(size=(LAYOUT.size, LAYOUT.size))
    state.covariance = root @ root.T
    slopes = np.eye(LAYOUT.size)
    slopes[LAYOUT.anchor(2), LAYOUT.creep] = -turned_m
    expected = slopes @ state.covariance @ slopes.T
    move_by_creep(state, 2, turned_m, LAYOUT)
    assert np.allclose(state.covariance, expected, rtol=1e-12)
    assert np.allclose(state.anchor[2], -0.02 * turned_m) and (state.anchor[[0, 1, 3, 4, 5]] == 0).all()


def test_independent_updates_are_those_of_the_kalman_filter():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(LAYOUT.size, LAYOUT.size))
    spread, rows, seen = root @ root.T, rng.normal(size=(4, LAYOUT.size)), rng.normal(size=4)
    variance, found = np.array([0.5, 1.0, 2.0, 3.0]), np.empty(4)
    gain = spread @ rows.T @ np.linalg.inv(rows @ spread @ rows.T + np.diag(variance))
    expected = spread - gain @ rows @ spread
    change = update_step(spread, rows, seen, variance, np.inf, found)
    assert np.allclose(change, gain @ seen) and np.allclose(spread, expected, atol=1e-8) and (found >= 0).all()


def test_a_dome_that_is_being_pressed_has_yielded_less_than_its_force_says():
    settings, state, falls_m_s = Settings(), empty_state(LAYOUT, 0.0), 0.1
    state.velocity[:, 2] = -falls_m_s
    turn = LAYOUT.endcap_turn[0]
    sample = FootSample(0.0, ROBOT.endcaps[0].name, 40.0 * turn.T @ UP, np.zeros(3), np.eye(6) * 1e-4, True)
    centre = dome_centre(state, 0, contact_of(sample, 0, LAYOUT, settings), LAYOUT, settings)
    found = centre.lever_m - LAYOUT.endcap_lever[0]
    stiffness = 1 / settings.compliance_m_n
    damping = settings.yield_delay_s * stiffness
    assert found == pytest.approx([0, 0, (40.0 - damping * falls_m_s) / stiffness], rel=1e-12)  # F = k d + c d'


@pytest.mark.parametrize("truth", [0.3, 0.7])
def test_friction_is_learned_from_contacts_of_which_some_slip(truth):
    rng, weights = np.random.default_rng(1), FIRST
    for _ in range(400):
        slips = rng.random() < 0.2
        ratio = (truth if slips else truth * rng.random()) + rng.normal(0, 0.02)
        weights = learned(weights, ratio, 0.02, slip_probability(weights, ratio, 0.02))
    mean, spread = moments(weights)
    assert abs(mean - truth) < 0.1 * truth + 0.02 and spread < 0.1
    assert slip_probability(weights, truth, 0.02) > 0.5 > 0.05 > slip_probability(weights, 0.5 * truth, 0.02)
    assert len(weights) == len(COEFFICIENTS)


def test_the_unloaded_dome_moves_with_its_bars_velocity_as_finite_differences_do():
    settings, size = Settings(yield_delay_s=0.02), 1e-3
    turn = LAYOUT.endcap_turn[0]
    sample = FootSample(0.0, ROBOT.endcaps[0].name, turn.T @ [8.0, -3.0, 40.0], np.zeros(3), np.eye(6) * 1e-4, True)
    contact = contact_of(sample, 0, LAYOUT, settings)
    for axis in range(3):
        places, slopes = [], np.zeros(3)
        for sign in (-1, 1):
            state = empty_state(LAYOUT, 0.0)
            state.turn[:], state.normal[0] = Moving(2).turn, [0.6, 0.0, 0.8]
            state.velocity[0, axis] = sign * size
            place, slope = unloaded(state, 0, dome_centre(state, 0, contact, LAYOUT, settings), LAYOUT)
            places.append(place)
            slopes = slope[:, LAYOUT.velocity(0)][:, axis]
        assert (places[1] - places[0]) / (2 * size) == pytest.approx(slopes, abs=1e-9)
        assert np.linalg.norm(slopes) == pytest.approx(0.02 * [0.6, 0.0, 0.8][axis])
