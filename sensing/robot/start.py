"""The first state: shape and attitude of a robot that stands still, and their covariance (see first_shape).

Notes:
    The robot stands still if rates, the size of the force and the cables' lengths are quiet over the whole start;
    otherwise the start begins again (:func:`moves`). After a second of trying, larger rocking is accepted, as long as
    no bar keeps turning (:func:`goes_on`). The robot rocks on its cables and domes even when quiet. So means over the
    start are weighted by a parabola, which reduces the effect of rocking with one to two periods, and the bars are
    turned from their mean attitude to the last one by the angles that their gyroscopes measured. After
    ``Settings.start_limit_s`` the estimate begins with a robot that moves; its covariance and a note state that.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, fields

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.first_shape import FirstShape
from sensing.robot.inertial import silent_after_s, usual_s
from sensing.robot.layout import Layout
from sensing.robot.settings import Settings
from sensing.robot.state import State
from sensing.tensegrity.description import GRAVITY_M_S2, Array
from sensing.tensegrity.samples import InertialSample, LengthSample, Sample
from sensing.tensegrity.shape import rotation_of
from sensing.tensegrity.vectors import minus_cross

QUIET_RAD_S, QUIET_M_S2 = 0.35, 1.5  # E: limits for a robot that stands: of a rate, and of a force beside gravity
ROCKS_AFTER_S, ROCKS_MORE = 1.0, 4.0  # E: time of tries to find a robot at rest, and factor on the limits after it
ROCKS_RAD_S, NET_RAD_S = 0.32, 0.1  # E: rms and mean of the rates, over the start, of a bar that only rocks
LENGTHS_IN_S = 0.1  # E: s in which the first lengths of a start have to come
QUIET_M = 0.006  # E: difference of the lengths' means over the two halves of the start
# A gyroscope that measures more at the start is not at rest, rad/s, unless its rate is steady, about each axis, rad/s.
STILL_RATE, STEADY_RATE = 0.05, 0.01
ROCKS = 0.1  # E: error of a mean rate over the spread of the rates, since the robot rocks as the start ends
ROCKS_TURN = 0.5  # E: error of a bar's last rotation over the spread of the rotations, while it rocks
SPEED_SD = 0.01  # m/s, standard deviation at rest
MOVES_M_S, MOVES_RAD, MOVES_M = 0.5, 0.2, 0.02  # E: standard deviations of a robot that moves as the estimate begins


@dataclass
class Gathered:
    """Sums of the measurements while the robot stands, for its first shape.

    Attributes:
        tried_s: time of the first sample since the estimator began, s; NaN before.
        first_s: time of the first sample of this start, s.
        rate, force: (B, 3) weighted sums, rad/s and m/s2, bar axes.
        counts: (B, 2) sums of the weights of rates and of forces.
        lengths: (C,) weighted sums of the cables' lengths, m.
        length_counts: (C,) sums of the weights of lengths.
        squares: (B,) weighted sums of squared rates.
        sums: (B, 3) sums of rates, without weights.
        turned: (B, 3) weighted sums of ``sums`` at every sample.
        turned_squares: (B,) weighted sums of their squared norms.
        halves: (2, C) sums of the lengths in the first and the second half of the start.
        half_counts: (2, C) numbers of these lengths.
        heard_s: (B, 2) times of the last rates and forces; -inf without.
        usual_s: (B,) usual time between rates, s; inf without.
        contacts: last contact of each endcap.
        reading_s: times of their readings, s.
    """

    tried_s: float
    first_s: float
    rate: Array
    force: Array
    counts: Array
    lengths: Array
    length_counts: Array
    squares: Array
    sums: Array
    turned: Array
    turned_squares: Array
    halves: Array
    half_counts: Array
    heard_s: Array
    usual_s: Array
    contacts: dict[int, Contact] = field(default_factory=dict)
    reading_s: dict[int, float] = field(default_factory=dict)

    def copy(self) -> Gathered:
        """An independent copy."""
        other = copy(self)
        for entry in fields(self):
            value = getattr(self, entry.name)
            setattr(other, entry.name, value.copy() if isinstance(value, np.ndarray | dict) else value)
        return other


def nothing_gathered(layout: Layout, tried_s: float = np.nan) -> Gathered:
    """Empty sums before the first sample of a start.

    Args:
        layout: indices of the robot.
        tried_s: time of the first sample of all, s.
    """
    bars, cables = layout.bars, len(layout.cable_bars)
    return Gathered(
        tried_s, np.nan, np.zeros((bars, 3)), np.zeros((bars, 3)), np.zeros((bars, 2)), np.zeros(cables),
        np.zeros(cables), np.zeros(bars), np.zeros((bars, 3)), np.zeros((bars, 3)), np.zeros(bars),
        np.zeros((2, cables)), np.zeros((2, cables)), np.full((bars, 2), -np.inf), np.full(bars, np.inf),
    )  # fmt: skip


def gather(gathered: Gathered, time_s: float, bar: int, sample: Sample, layout: Layout, settings: Settings) -> None:
    """Add an inertial sample, or cable lengths.

    Args:
        gathered: sums that are changed.
        time_s: time of the sample, s.
        bar: number of the bar of an inertial sample.
        sample: sample of an inertial sensor, or of the cables' lengths.
        layout, settings: indices and assumptions of the estimator.
    """
    part = (time_s - gathered.first_s) / settings.start_s
    weight = max(6 * part * (1 - part), 0.01)
    if isinstance(sample, InertialSample):
        rate = layout.sensor_turn[bar] @ sample.rate_rad_s
        gathered.rate[bar] += weight * rate
        gathered.squares[bar] += weight * float(rate @ rate)
        gathered.sums[bar] += rate
        gathered.turned[bar] += weight * gathered.sums[bar]
        gathered.turned_squares[bar] += weight * float(gathered.sums[bar] @ gathered.sums[bar])
        gathered.counts[bar, 0] += weight
        gathered.usual_s[bar] = usual_s(float(gathered.usual_s[bar]), time_s - float(gathered.heard_s[bar, 0]))
        gathered.heard_s[bar, 0] = time_s
        if sample.acceleration_m_s2 is not None:
            gathered.heard_s[bar, 1] = time_s
            gathered.force[bar] += weight * layout.sensor_turn[bar] @ sample.acceleration_m_s2
            gathered.counts[bar, 1] += weight
    elif isinstance(sample, LengthSample):
        good, half = np.isfinite(sample.lengths_m), int(part > 0.5)
        gathered.lengths[good] += weight * np.asarray(sample.lengths_m)[good]
        gathered.length_counts += weight * good
        gathered.halves[half, good] += np.asarray(sample.lengths_m)[good]
        gathered.half_counts[half] += good


def moves(gathered: Gathered, samples: Sequence[object]) -> bool:
    """Whether these samples, or the lengths gathered so far, are of a robot that does not stand still.

    Args:
        gathered: sums so far.
        samples: samples of one time.
    """
    more = ROCKS_MORE if gathered.first_s - gathered.tried_s > ROCKS_AFTER_S else 1.0
    for sample in samples:
        if not isinstance(sample, InertialSample):
            continue
        if float(np.linalg.norm(sample.rate_rad_s)) > more * QUIET_RAD_S:
            return True
        force = sample.acceleration_m_s2
        if force is not None and abs(float(np.linalg.norm(force)) - GRAVITY_M_S2) > more * QUIET_M_S2:
            return True
    both = (gathered.half_counts > 4).all(axis=0)  # E: the means of fewer are mostly noise
    means = gathered.halves[:, both] / gathered.half_counts[:, both]
    return bool((np.abs(means[1] - means[0]) > QUIET_M).any())


def lengths_late(gathered: Gathered, time_s: float, samples: Sequence[object]) -> bool:
    """Whether the first lengths of a start come late, as of a program that was started later, so that it begins anew.

    Its angles would contain the biases of the gyroscopes over the whole wait, and its lengths the noise of a few.

    Args:
        gathered: sums so far.
        time_s: time of the samples, s.
        samples: samples of one time.
    """
    first = not gathered.length_counts.any() and any(isinstance(sample, LengthSample) for sample in samples)
    return first and time_s - gathered.first_s > LENGTHS_IN_S


def goes_on(gathered: Gathered) -> bool:
    """Whether the robot is still moving: a bar kept turning over the start, or rocks by more than a little.

    Args:
        gathered: sums over the whole start.
    """
    count = np.maximum(gathered.counts[:, 0], 1)
    turns = np.linalg.norm(gathered.sums, axis=1) > NET_RAD_S * count
    return bool((turns | (gathered.squares > ROCKS_RAD_S**2 * count)).any())


def first_leader(gathered: Gathered, layout: Layout) -> int:
    """Number of the bar that leads at first: the first of those that may lead whose accelerometer has reported.

    Args:
        gathered: sums while the robot stood.
        layout: indices of the robot.
    """
    return next((bar for bar in layout.leaders if gathered.counts[bar, 1] > 0), layout.leader)


def begin(state: State, gathered: Gathered, layout: Layout, settings: Settings, stands: bool = True) -> None:
    """Set the first state.

    Args:
        state: empty state of the time; it is changed.
        gathered: sums while the robot stood.
        layout, settings: indices and assumptions of the estimator.
        stands: False for a robot that moves as the estimate begins.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        lengths = gathered.lengths / gathered.length_counts
        force = gathered.force / gathered.counts[:, 1:]
    if not stands:  # accelerations of the motion are in the means
        force[np.arange(layout.bars) != layout.leader] = np.nan
    problem = FirstShape(lengths, force, gathered.contacts, layout, settings)
    poses, spread = problem.solved()
    state.began_unbalanced = not problem.balances(poses)
    last, rocked = _last_turns(gathered, settings)
    _rock(poses, last, layout)
    shift = -poses[:, :3, 3].mean(axis=0)
    shift[2] = -problem.ground(poses)
    poses[:, :3, 3] += shift
    spread = spread + np.diag(np.repeat(rocked**2, 6) * np.tile([0, 0, 0, 1, 1, 1], layout.bars))
    if not stands:
        spread = spread + np.diag(np.tile([MOVES_M**2] * 3 + [MOVES_RAD**2] * 3, layout.bars))
    state.turn = np.ascontiguousarray(poses[:, :3, :3])
    state.place = np.ascontiguousarray(poses[:, :3, 3] + np.einsum("bij,bj->bi", state.turn, layout.reference_m))
    counted = np.maximum(gathered.counts[:, :1], 1)
    mean, square = gathered.rate / counted, gathered.squares / counted[:, 0]
    spread_rate = np.sqrt(np.maximum(0.0, square - (mean**2).sum(axis=1)) / 3)
    still = stands & ((square <= STILL_RATE**2) | (spread_rate <= STEADY_RATE))
    state.rate_bias = np.where(still[:, None], mean, 0.0)
    _heard(state, gathered)
    bias_sd = settings.rate_noise / max(settings.start_s, 0.01) ** 0.5 + ROCKS * spread_rate + 1e-4
    bias_sd = np.where(still & (gathered.counts[:, 0] > 0), bias_sd, settings.rate_bias_sd)
    state.began_moving, state.began_silent = not stands, tuple(problem.silent)
    state.began_lifted = not problem.contacts and not problem.silent
    silent = np.flatnonzero(state.time_s - state.rate_s > state.silent_after_s).tolist()
    state.began_unmeasured = tuple(bar for bar in silent if layout.sensor_of_bar[bar])
    _set_covariance(state, spread, bias_sd, SPEED_SD if stands else MOVES_M_S, layout, settings)


def _heard(state: State, gathered: Gathered) -> None:
    """Set the time of each sensor's last sample, so that none counts as silent at the start."""
    rates, forces = (gathered.counts > 0).T
    state.rate[rates] = gathered.rate[rates] / gathered.counts[rates, :1]
    state.force[forces] = gathered.force[forces] / gathered.counts[forces, 1:]
    state.rate_s, state.force_s = gathered.heard_s.T.copy()
    state.rate_until_s, state.usual_s = state.rate_s.copy(), gathered.usual_s.copy()
    state.silent_after_s = np.array([silent_after_s(float(one)) for one in gathered.usual_s])
    for endcap, contact in gathered.contacts.items():
        state.contacts[endcap], state.reading_s[endcap] = contact, gathered.reading_s[endcap]
    since = np.where(np.isfinite(gathered.heard_s), state.time_s - gathered.heard_s, 0.0)
    state.rate_used, state.force_used = since[:, :1] * state.rate, since[:, 1:] * state.force


def _last_turns(gathered: Gathered, settings: Settings) -> tuple[Array, Array]:
    """((B, 3) rotation from a bar's mean attitude over the start to its last one, bar axes, (B,) error of it), rad."""
    count = np.maximum(gathered.counts[:, 0], 1)
    step = settings.start_s / count
    mean, middle = gathered.rate / count[:, None], gathered.turned / count[:, None]
    rocks = ROCKS**2 * np.maximum(0.0, gathered.squares / count - (mean**2).sum(axis=1)) / 3
    mean *= (settings.rate_bias_sd**2 / (settings.rate_bias_sd**2 + rocks))[:, None]  # the part of it that is the bias
    last = gathered.sums - middle - mean * count[:, None] / 2  # a rotation by the bias is none of the bar
    straight = (mean**2).sum(axis=1) * count**2 / 20  # the spread that a steady bias causes
    spread = gathered.turned_squares / count - (middle**2).sum(axis=1) - straight
    return step[:, None] * last, ROCKS_TURN * step * np.sqrt(np.maximum(0.0, spread) / 3)


def _rock(poses: Array, last: Array, layout: Layout) -> None:
    """Turn the robot with its leading bar about the ground below it, and each other bar about its middle."""
    whole = rotation_of(poses[layout.leader, :3, :3] @ last[layout.leader])
    about = np.array([*poses[:, :2, 3].mean(axis=0), poses[:, 2, 3].min()])
    for bar, pose in enumerate(poses):
        pose[:3, 3] = about + whole @ (pose[:3, 3] - about)
        pose[:3, :3] = whole @ pose[:3, :3] if bar == layout.leader else pose[:3, :3] @ rotation_of(last[bar])


def _set_covariance(
    state: State, spread: Array, bias_sd: Array, speed_sd: float, layout: Layout, settings: Settings
) -> None:
    bars, size = layout.bars, layout.size
    slopes = np.zeros((size, 6 * bars))
    leader = 6 * layout.leader + 3
    for bar in range(bars):
        arm = state.turn[bar] @ layout.reference_m[bar]
        slopes[layout.turn(bar), 6 * bar + 3 : 6 * bar + 6] = np.eye(3)
        slopes[layout.place(bar), 6 * bar : 6 * bar + 3] = np.eye(3)
        slopes[layout.place(bar), 6 * bar + 3 : 6 * bar + 6] += minus_cross(arm)
        slopes[layout.place(bar), leader : leader + 3] -= minus_cross(state.place[bar])
    state.covariance = slopes @ spread @ slopes.T
    state.covariance[layout.delay, layout.delay] = settings.delay_sd_s**2
    state.covariance[layout.creep, layout.creep] = settings.creep_sd**2
    state.covariance[layout.softness, layout.softness] = settings.softness_sd**2
    for bar in range(bars):
        at = layout.velocity(bar)
        state.covariance[at, at] += speed_sd**2 * np.eye(3)
        at = layout.rate_bias(bar)
        state.covariance[at, at] += bias_sd[bar] ** 2 * np.eye(3)
        if layout.has_force[bar]:
            at = layout.force_bias(bar)
            state.covariance[at, at] += settings.force_bias_sd**2 * np.eye(3)
