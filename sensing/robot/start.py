"""The first state: shape and attitude of a robot that stands still, and their covariance (see first_shape)."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field, fields

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.first_shape import FirstShape
from sensing.robot.layout import Layout
from sensing.robot.settings import Settings
from sensing.robot.state import State
from sensing.tensegrity.description import Array

STILL_RATE = 0.05  # rad/s: a gyroscope that shows more at the start is not at rest
ROCKS = 0.1  # E: error of a mean rate, as a part of the rates' spread: the robot rocks as the start ends
SPEED_SD = 0.01  # m/s at rest


@dataclass
class Gathered:
    """Means of what was measured while the robot stands.

    Attributes:
        first_s: time of the first sample; NaN before. rate, force: (B, 3) sums, bar axes. lengths: (C,) sums.
        counts: (B, 2) of rates and forces. length_counts: (C,). squares: (B,) sums of squared rates.
    """

    first_s: float
    rate: Array
    force: Array
    counts: Array
    lengths: Array
    length_counts: Array
    squares: Array
    contacts: dict[int, Contact] = field(default_factory=dict)

    def copy(self) -> Gathered:
        """One that can be changed on its own."""
        other = copy(self)
        for entry in fields(self):
            setattr(other, entry.name, getattr(self, entry.name).copy() if entry.name != "first_s" else self.first_s)
        return other


def nothing_gathered(layout: Layout) -> Gathered:
    """Before the first sample."""
    bars, cables = layout.bars, len(layout.cable_bars)
    return Gathered(
        np.nan, np.zeros((bars, 3)), np.zeros((bars, 3)), np.zeros((bars, 2)), np.zeros(cables), np.zeros(cables),
        np.zeros(bars),
    )  # fmt: skip


def begin(state: State, gathered: Gathered, layout: Layout, settings: Settings) -> None:
    """Set the first state.

    Args:
        state: empty, of the time, is changed. gathered: while the robot stood. layout, settings: of the estimator.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        lengths = gathered.lengths / gathered.length_counts
        force = gathered.force[layout.leader] / gathered.counts[layout.leader, 1]
    problem = FirstShape(lengths, force, gathered.contacts, layout, settings)
    poses, spread = problem.solved()
    shift = -poses[:, :3, 3].mean(axis=0)
    shift[2] = -problem.ground(poses)
    poses[:, :3, 3] += shift
    state.turn = np.ascontiguousarray(poses[:, :3, :3])
    state.place = np.ascontiguousarray(poses[:, :3, 3] + np.einsum("bij,bj->bi", state.turn, layout.reference_m))
    still = gathered.squares <= STILL_RATE**2 * np.maximum(gathered.counts[:, 0], 1)
    counted = np.maximum(gathered.counts[:, :1], 1)
    state.rate_bias = np.where(still[:, None], gathered.rate / counted, 0.0)
    mean = gathered.rate / counted
    spread_rate = np.sqrt(np.maximum(0.0, gathered.squares / counted[:, 0] - (mean**2).sum(axis=1)) / 3)
    bias_sd = settings.rate_noise / max(settings.start_s, 0.01) ** 0.5 + ROCKS * spread_rate + 1e-4
    bias_sd = np.where(still & (gathered.counts[:, 0] > 0), bias_sd, settings.rate_bias_sd)
    _set_covariance(state, spread, bias_sd, layout, settings)


def _set_covariance(state: State, spread: Array, bias_sd: Array, layout: Layout, settings: Settings) -> None:
    bars, size = layout.bars, layout.size
    slopes = np.zeros((size, 6 * bars))
    leader = 6 * layout.leader + 3
    for bar in range(bars):
        arm = state.turn[bar] @ layout.reference_m[bar]
        slopes[layout.turn(bar), 6 * bar + 3 : 6 * bar + 6] = np.eye(3)
        slopes[layout.place(bar), 6 * bar : 6 * bar + 3] = np.eye(3)
        slopes[layout.place(bar), 6 * bar + 3 : 6 * bar + 6] += _minus_cross(arm)
        slopes[layout.place(bar), leader : leader + 3] -= _minus_cross(state.place[bar])
    state.covariance = slopes @ spread @ slopes.T
    for bar in range(bars):
        at = layout.velocity(bar)
        state.covariance[at, at] += SPEED_SD**2 * np.eye(3)
        at = layout.rate_bias(bar)
        state.covariance[at, at] += bias_sd[bar] ** 2 * np.eye(3)
        if layout.has_force[bar]:
            at = layout.force_bias(bar)
            state.covariance[at, at] += settings.force_bias_sd**2 * np.eye(3)


def _minus_cross(arm: Array) -> Array:
    x, y, z = arm
    return np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
