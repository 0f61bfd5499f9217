"""The filter's state at one time: everything that a return to it has to restore."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.friction import FIRST
from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import correct
from sensing.robot.settings import KnownContact
from sensing.tensegrity.description import Array

SILENT_S = 0.05  # after it the last sample of an inertial sensor is no longer used, unless it is a slow one
MEAN_WEIGHT = 0.02  # weight of a new value in the fading means of the report
INCONSISTENT = 4.0  # mean squared innovation over its variance that contradicts the estimate


@dataclass
class State:
    """State of the filter; arrays are changed in place, and copied by :meth:`copy`.

    Attributes:
        time_s: time of the state, s.
        covariance: (N, N) of the error state (:mod:`sensing.robot.kernels`).
        turn: (B, 3, 3) rotations from bar to world axes.
        place, velocity: (B, 3) positions, m, and velocities, m/s, of the reference points, world.
        rate_bias, force_bias: (B, 3) biases of gyroscopes, rad/s, and accelerometers, m/s^2, bar axes.
        anchor: (E, 3) position that the sphere's centre would have without load, world, m.
        normal: (E, 3) unit normals, out of the support, world.
        normal_variance: (E,) variances of the normals, rad^2.
        anchored: (E,) whether the endcap has an anchor.
        slips: (E,) probabilities of slip.
        creep: (1,) creep of endcaps that turn under load (:func:`sensing.robot.slide.move_by_creep`).
        softness: (1,) relative excess of the domes' yield over ``Settings.compliance_m_n``, or part by which forces are
            measured too small.
        delay_s: (1,) excess of all domes' delay of the yield behind the force over ``Settings.yield_delay_s``, s.
        rate: (B, 3) sample whose time contains the state's, or the last one, bar axes, rad/s.
        force: (B, 3) last sample, bar axes, m/s^2.
        rate_s, force_s: (B,) times of the last samples, s.
        rate_until_s: (B,) end of the time over which ``rate`` is a mean, s; it may be after the state's.
        rate_mean: (B, 3) mean rate since the last sample until then, rad/s.
        missed_s: (B,) part of that time whose samples are missing, s.
        usual_s: (B,) usual time between samples of the inertial sensors, s; inf where none is known.
        silent_after_s: (B,) time without a sample after which they count as silent, s.
        rate_over_s: (B,) time over which the last rate is a mean, s; inf where none is known.
        rate_change, force_change: (B,) fading mean squares of the change from one sample to the next, an axis,
            rad^2/s^2 and m^2/s^4.
        rate_used, force_used: (B, 3) integrals of the used values since the last samples.
        contact_s: (E,) time of the last reading with valid numbers, s.
        reading_s: (E,) time of the last reading, s.
        lengths_s: (C,) time of the last length of each measured cable that was not left out, s.
        load_n: (E, 3) normal force by which the softness is learned, world, N; NaN before the first
            (:func:`sensing.robot.dome.count_load`).
        jumped: (E,) whether the last reading was left out because it jumped (:mod:`sensing.robot.jump`).
        astray_s: (E,) time since which an endcap's readings show no contact, s: they hold no numbers, or wrenches of
            none on its dome; NaN for one whose readings do.
        contacts: last contact of each endcap.
        friction: (59,) probabilities of the coefficients.
        consistency: (2,) fading means of squared innovations over their variances, of lengths and of anchors.
        weight_ratio: fading mean of the vertical forces' sum over the weight.
        rejected: number of rejected lengths in the last sample.
        known: true contacts of a simulation.
        held_s: time for which the pose has been held without measurement, s (:mod:`sensing.robot.silence`).
        tried_s: time of the last new start that found no balance either, s; -inf without.
        anew_s: time at which the estimate began again, s; -inf without.
        began_moving: whether the robot moved as the estimate began.
        began_silent: numbers of the endcaps whose force was unknown then.
        began_unmeasured: numbers of the bars whose gyroscope was silent then.
        began_lifted: whether no endcap touched then.
        began_unbalanced: whether no shape balanced the forces then.
        unseen_s: time for which several gyroscopes were silent at once, s.
        lost: whether contacts have contradicted place and velocity.
        leader: number of the leading bar, to whose rotation the errors of positions refer.
    """

    time_s: float
    covariance: Array
    turn: Array
    place: Array
    velocity: Array
    rate_bias: Array
    force_bias: Array
    anchor: Array
    normal: Array
    normal_variance: Array
    anchored: np.ndarray
    slips: Array
    creep: Array
    softness: Array
    delay_s: Array
    rate: Array
    force: Array
    rate_s: Array
    force_s: Array
    rate_until_s: Array
    rate_mean: Array
    missed_s: Array
    usual_s: Array
    silent_after_s: Array
    rate_over_s: Array
    rate_change: Array
    force_change: Array
    rate_used: Array
    force_used: Array
    contact_s: Array
    reading_s: Array
    astray_s: Array
    load_n: Array
    jumped: np.ndarray
    lengths_s: Array
    contacts: list[Contact | None]
    friction: Array
    consistency: Array
    weight_ratio: float
    rejected: int
    known: list[KnownContact | None]
    held_s: float = 0.0
    tried_s: float = -np.inf
    anew_s: float = -np.inf
    began_moving: bool = False
    began_silent: tuple[int, ...] = ()
    began_unmeasured: tuple[int, ...] = ()
    began_lifted: bool = False
    began_unbalanced: bool = False
    unseen_s: float = 0.0
    lost: bool = False
    leader: int = 0

    def copy(self) -> Self:
        """An independent copy."""
        other = copy(self)
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, np.ndarray | list):
                setattr(other, entry.name, value.copy())
        return other

    def correct(self, change: Array) -> None:
        """Add a correction (N,) of the error state."""
        correct(
            change, self.turn, self.place, self.velocity, self.rate_bias, self.force_bias, self.anchor, self.normal,
            self.delay_s, self.creep, self.softness, self.leader,
        )  # fmt: skip


def empty_state(layout: Layout, time_s: float) -> State:
    """A state in which nothing is known yet."""
    bars, endcaps, never = layout.bars, layout.endcaps, -np.inf

    def of_bars() -> Array:
        return np.zeros((bars, 3))

    return State(
        time_s=time_s, covariance=np.zeros((layout.size, layout.size)), turn=np.tile(np.eye(3), (bars, 1, 1)),
        place=of_bars(), velocity=of_bars(), rate_bias=of_bars(), force_bias=of_bars(),
        anchor=np.zeros((endcaps, 3)), normal=np.tile([0.0, 0.0, 1.0], (endcaps, 1)), normal_variance=np.ones(endcaps),
        anchored=np.zeros(endcaps, np.int64), slips=np.zeros(endcaps), creep=np.zeros(1), softness=np.zeros(1),
        delay_s=np.zeros(1),
        rate=of_bars(), force=of_bars(), rate_s=np.full(bars, never), force_s=np.full(bars, never),
        rate_until_s=np.full(bars, never), rate_mean=of_bars(), missed_s=np.zeros(bars), usual_s=np.full(bars, np.inf),
        silent_after_s=np.full(bars, SILENT_S), rate_over_s=np.full(bars, np.inf),
        rate_change=np.zeros(bars), force_change=np.zeros(bars), rate_used=of_bars(), force_used=of_bars(),
        contact_s=np.full(endcaps, never), reading_s=np.full(endcaps, never), astray_s=np.full(endcaps, np.nan),
        load_n=np.full((endcaps, 3), np.nan), jumped=np.zeros(endcaps, bool),
        lengths_s=np.full(len(layout.cable_bars), never),
        contacts=[None] * endcaps, friction=FIRST.copy(), consistency=np.ones(2), weight_ratio=np.nan, rejected=0,
        known=[None] * endcaps, leader=layout.leader,
    )  # fmt: skip


def world_rate(state: State, bar: int) -> Array:
    """(3,) angular velocity of a bar, world axes."""
    return np.asarray(state.turn[bar] @ (state.rate[bar] - state.rate_bias[bar]))
