"""The filter's state at one time: everything that a rewind has to bring back."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from sensing.robot.contact import Contact
from sensing.robot.friction import FIRST
from sensing.robot.layout import Layout
from sensing.robot.settings import KnownContact
from sensing.tensegrity.description import Array


@dataclass
class State:
    """State of the filter; arrays are changed in place, and copied by :meth:`copy`.

    Attributes:
        time_s: for which it holds. covariance: (N, N) of the error state (:mod:`sensing.robot.kernels`).
        turn: (B, 3, 3) bar to world. place, velocity: (B, 3) of the reference points. rate_bias, force_bias: (B, 3).
        anchor: (E, 3) where the sphere's centre would be without load, world. normal: (E, 3) out of the support.
        normal_variance: (E,) rad^2. anchored: (E,) whether the anchor counts.
        slips: (E,) probability.
        rate, force: (B, 3) last samples, bar axes. rate_s, force_s: (B,) their times.
        rate_used, force_used: (B, 3) their integrals since.
        contact_s: (E,) time of the last reading whose numbers counted. reading_s: (E,) of any. lengths_s: of lengths.
        contacts: last reading of each endcap. friction: (59,) weights of the coefficients.
        consistency: (2,) mean squared innovation over its variance, lengths and anchors. weight_ratio: lately.
        rejected: lengths of the last sample. known: what a simulation knows of each contact.
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
    rate: Array
    force: Array
    rate_s: Array
    force_s: Array
    rate_used: Array
    force_used: Array
    contact_s: Array
    reading_s: Array
    lengths_s: float
    contacts: list[Contact | None]
    friction: Array
    consistency: Array
    weight_ratio: float
    rejected: int
    known: list[KnownContact | None]

    def copy(self) -> Self:
        """One that can be changed on its own."""
        other = copy(self)
        for entry in fields(self):
            value = getattr(self, entry.name)
            if isinstance(value, np.ndarray | list):
                setattr(other, entry.name, value.copy())
        return other


def empty_state(layout: Layout, time_s: float) -> State:
    """A state of which nothing is known yet."""
    bars, endcaps = layout.bars, layout.endcaps
    per_bar = [np.zeros((bars, 3)) for _ in range(8)]
    never = -np.inf
    return State(
        time_s, np.zeros((layout.size, layout.size)), np.tile(np.eye(3), (bars, 1, 1)), *per_bar[:4],
        np.zeros((endcaps, 3)), np.tile([0.0, 0.0, 1.0], (endcaps, 1)), np.ones(endcaps),
        np.zeros(endcaps, np.int64), np.zeros(endcaps), per_bar[4], per_bar[5],
        np.full(bars, never), np.full(bars, never), per_bar[6], per_bar[7],
        np.full(endcaps, never), np.full(endcaps, never), never, [None] * endcaps, FIRST.copy(), np.ones(2), np.nan, 0,
        [None] * endcaps,
    )  # fmt: skip
