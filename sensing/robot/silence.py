"""The estimate while inertial sensors send nothing.

Where the leading bar's one is silent, another bar with an accelerometer leads. Where all are, lengths and contacts
alone do not determine the rotation about the vertical, the bars' rotations about themselves and, at the prism, one
motion of the shape: a filter on them alone diverges within minutes. So the pose is held, its covariance grows like the
motion of an unobserved robot, and when samples come again the robot has to stand a while, as at the start.
"""

from __future__ import annotations

import math

import numpy as np

from sensing.robot.contacts import LONGEST_GAP_S, release
from sensing.robot.layout import Layout
from sensing.robot.state import State
from sensing.tensegrity.description import Array
from sensing.tensegrity.vectors import minus_cross

HELD_AFTER_S = 1.0  # duration of a silence after which the pose is held
GONE_S = 3.0  # E: after it a silent gyroscope is not waited for
TRIED_S, TRIES_S = 5.0, 10.0  # E: time from one try of a start in no balance to the next, and from the first start on
UNSEEN_S = 0.1  # largest time in which several gyroscopes may be silent at once
MOVES_M_S, TURNS_RAD_S = 0.2, 0.3  # E: standard deviations of the motion of a robot that is not measured
MOST_TURN = math.pi / math.sqrt(3)  # standard deviation of an unknown rotation: uniform over a turn


def unmeasured(state: State, time_s: float, layout: Layout) -> bool:
    """Whether the leading bar's inertial sensor has been silent for too long.

    Args:
        state: state of the filter.
        time_s: time, s, not before the state's.
        layout: indices of the robot.
    """
    leader = layout.leader
    return bool(time_s - max(state.rate_s[leader], state.force_s[leader]) > HELD_AFTER_S)


def leading(state: State, time_s: float, layout: Layout) -> int:
    """Number of the bar that leads: the present one while it reports, else the first other one that does.

    After a start in motion no other one can: it may be turned by half a turn about itself, and its gravity with it.

    Args:
        state: state of the filter.
        time_s: time, s, not before the state's.
        layout: indices of the robot.
    """
    if state.began_moving or not _silent(state, time_s, state.leader):
        return state.leader
    return next((bar for bar in layout.leaders if not _silent(state, time_s, bar)), state.leader)


def _silent(state: State, time_s: float, bar: int) -> bool:
    heard_s = min(float(state.rate_s[bar]), float(state.force_s[bar]))
    return bool(time_s - heard_s > state.silent_after_s[bar])


def lead(state: State, leader: int, layout: Layout) -> None:
    """Let another bar lead: errors of places, velocities and anchors refer to its rotation from then on.

    With the error x_true - exp(a) x = x_true - exp(b) x + (b - a) x x to first order, the covariance only changes its
    coordinates.

    Args:
        state: state that is changed.
        leader: number of the bar.
        layout: indices of the robot.
    """
    if leader == state.leader:
        return
    whole, before, after = np.eye(layout.size), layout.turn(state.leader), layout.turn(leader)
    points = [(layout.place(bar), state.place[bar]) for bar in range(layout.bars)]
    points += [(layout.velocity(bar), state.velocity[bar]) for bar in range(layout.bars)]
    points += [(layout.anchor(int(endcap)), state.anchor[endcap]) for endcap in np.flatnonzero(state.anchored)]
    for at, point in points:
        whole[at, before] += minus_cross(point)
        whole[at, after] -= minus_cross(point)
    state.covariance, state.leader = whole @ state.covariance @ whole.T, leader


def watch(state: State, step_s: float, silent: np.ndarray) -> None:
    """Count the time in which several gyroscopes have been silent at once.

    Cables hold one silent bar to the others. With two, linear steps make the filter overconfident, so its estimates of
    them count as doubtful from then on.

    Args:
        state: state that is changed.
        step_s: length of the time step, s.
        silent: (B,) whether the bar's gyroscope has sent samples but sends none now.
    """
    if silent.sum() > 1:
        state.unseen_s += step_s
    elif state.unseen_s < UNSEEN_S:
        state.unseen_s = 0.0


def doubtful(state: State) -> bool:
    """Whether the error of the shape may exceed its covariance, so that a new start would be better.

    A start without an endcap's force or a gyroscope is no better as long as these send nothing, and one with no endcap
    on the ground no better until one is on it.

    Args:
        state: state of the filter.
    """
    heard = all(state.time_s - state.reading_s[endcap] < LONGEST_GAP_S for endcap in state.began_silent)
    heard &= all(state.time_s - state.rate_s[bar] <= state.silent_after_s[bar] for bar in state.began_unmeasured)
    lands = state.began_lifted and any(one is not None and one.known and one.touching for one in state.contacts)
    lacked = bool(state.began_silent or state.began_unmeasured)
    return state.began_moving or lands or state.lost or state.unseen_s >= UNSEEN_S or (lacked and heard)


def tries_balance(state: State, began_s: float) -> bool:
    """Whether a start with forces in no balance is tried again: at once and a little later, not at each stop of a walk.

    They may be those of a hand, which lets go, but also of a wrong description or noise. Where a new start finds no
    balance either, it is no better, and the state stays.

    Args:
        state: state of the filter.
        began_s: time of the first start, s.
    """
    soon = state.time_s - began_s < TRIES_S
    return state.began_unbalanced and soon and state.time_s - state.tried_s > TRIED_S


def pauses(state: State) -> bool:
    """Whether a gyroscope has just fallen silent and may come back, so that a new start should wait.

    Args:
        state: state of the filter.
    """
    since = state.time_s - state.rate_s
    return bool(((since > state.silent_after_s) & (since < GONE_S)).any())


def give_up(state: State) -> None:
    """Let all inertial sensors count as silent for long, so that the pose is held until the robot has stood still.

    Args:
        state: state that is changed.
    """
    state.rate_s = np.minimum(state.rate_s, state.time_s - GONE_S)
    state.force_s = np.minimum(state.force_s, state.time_s - GONE_S)


def hold(state: State, time_s: float, layout: Layout) -> None:
    """Hold the pose until a time, with a growing covariance.

    Args:
        state: state that is changed.
        time_s: time, s, not before the state's.
        layout: indices of the robot.
    """
    if state.held_s == 0.0:
        for endcap in range(layout.endcaps):
            release(state, endcap, layout)
        state.velocity[:], state.rate[:] = 0.0, state.rate_bias
    before, state.held_s = state.held_s, state.held_s + time_s - state.time_s
    most_s = MOST_TURN / TURNS_RAD_S
    turned = TURNS_RAD_S**2 * (min(state.held_s, most_s) ** 2 - min(before, most_s) ** 2)
    _spread(state, turned * np.eye(3), MOVES_M_S**2 * (state.held_s**2 - before**2) * np.eye(3), layout)
    state.time_s = time_s


def follow_on(state: State, held: State, layout: Layout) -> None:
    """Move a first state to the place and heading that were held, with their covariance.

    Args:
        state: the new state, which is changed.
        held: the state that was held until then; its leading bar becomes that of the new one.
        layout: indices of the robot.
    """
    lead(held, state.leader, layout)
    turn = held.turn[layout.leader] @ state.turn[layout.leader].T
    angle = math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
    back = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
    state.turn[:] = back @ state.turn
    state.place[:] = state.place @ back.T
    shift = np.zeros(3)
    shift[:2] = held.place[layout.leader, :2] - state.place[layout.leader, :2]
    state.place += shift
    whole = np.eye(layout.size)
    vectors = layout.vectors
    whole[:vectors, :vectors] = np.kron(np.eye(vectors // 3), back)
    for bar in range(layout.bars):  # what turns it turns it where it stands: errors of places refer to the origin
        whole[layout.place(bar), layout.turn(layout.leader)] = -minus_cross(shift) @ back
    state.covariance = whole @ state.covariance @ whole.T
    about = layout.turn(layout.leader).start + 2
    heading = np.diag([0.0, 0.0, min(held.covariance[about, about], MOST_TURN**2)])
    _spread(state, heading, _of_place(held, layout), layout)
    state.friction, state.anew_s = held.friction.copy(), state.time_s
    state.lengths_s, state.reading_s, state.contacts = (
        held.lengths_s.copy(), held.reading_s.copy(), held.contacts.copy()
    )  # fmt: skip
    if held.began_unbalanced or doubtful(held):  # values learned with a wrong shape are wrong, too
        return
    state.delay_s, state.creep, state.softness = held.delay_s.copy(), held.creep.copy(), held.softness.copy()
    state.covariance[layout.vectors :, layout.vectors :] = held.covariance[layout.vectors :, layout.vectors :]


def _of_place(state: State, layout: Layout) -> Array:
    """(3, 3) covariance of where the leading bar is, whichever way it is turned."""
    rows = np.zeros((3, layout.size))
    rows[:, layout.place(layout.leader)] = np.eye(3)
    rows[:, layout.turn(layout.leader)] = minus_cross(state.place[layout.leader])
    return np.asarray(rows @ state.covariance @ rows.T)


def _spread(state: State, turn: Array, place: Array, layout: Layout) -> None:
    """Add the covariances (3, 3) of a rotation of the whole robot about its middle, and of a shift."""
    slopes = np.zeros((layout.size, 6))
    x, y, z = state.place.mean(axis=0)
    for bar in range(layout.bars):
        slopes[layout.turn(bar), :3] = np.eye(3)
        slopes[layout.place(bar), :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        slopes[layout.place(bar), 3:] = np.eye(3)
    state.covariance += slopes[:, :3] @ turn @ slopes[:, :3].T + slopes[:, 3:] @ place @ slopes[:, 3:].T
