"""Correction of rate effects: the force of the silicone beyond its long-term stress while it relaxes.

    rate = RateFilter((Term(0.054, 0.1, 0.01), Term(0.033, 1.0, 0.01)))
    step = rate.step(estimate)          # step.wrench is corrected; nothing is remembered yet
    rate.take(step)                     # the estimate counted

One picture shows how far the shell is deformed, not how long ago: the model reports the wrench of a shell that has
relaxed. N, N m, s.

Notes:
    Linear viscoelasticity of proportional loading: with w the long-term wrench of the deformation, the true one is
    w + sum_i h_i,  dh_i/dt + h_i / tau_i = b_i dw/dt  (the Prony series of Simo 1987,
    doi:10.1016/0045-7825(87)90107-1, b_i = g_i / (1 - sum g) relative to the long-term modulus), for each of the six
    axes by itself. Between two frames w is taken as linear in time, and then the step is exact for any interval dt:

        h' = exp(-dt / tau) h + b (w' - w) (tau / dt) (1 - exp(-dt / tau)).

    At the start h = 0, the shell has relaxed, unless the state of an earlier filter is given. Doubt about the constants
    goes into the covariance as sum_i (sd(b_i) / b_i)^2 h_i h_i'.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.records import Wrench

Array = NDArray[np.float64]
AXES = 6  # of a wrench
MOST_TERMS = 4  # of the Prony series
MOST_STRENGTH = 1.0  # of a term: the silicone would be twice as stiff at once as in the long term
TAU_S = (1e-3, 1e4)  # accepted relaxation times, s


@dataclass(frozen=True)
class Term:
    """One term of the series.

    Attributes:
        strength: b, over the long-term modulus.
        tau_s: relaxation time.
        sd: standard deviation of ``strength``.

    Raises:
        ParameterError: a number out of its range.
    """

    strength: float
    tau_s: float
    sd: float = 0.0

    def __post_init__(self) -> None:
        good = (
            0 < self.strength <= MOST_STRENGTH and TAU_S[0] <= self.tau_s <= TAU_S[1] and 0 <= self.sd <= MOST_STRENGTH
        )
        if not good:
            raise ParameterError(
                f"relaxation term {self.strength:g}, {self.tau_s:g}, {self.sd:g}: need 0 < strength <= "
                f"{MOST_STRENGTH:g}, tau_s {TAU_S[0]:g}..{TAU_S[1]:g} and 0 <= sd <= {MOST_STRENGTH:g}; identify "
                "them with python -m sensing.dwell",
                name="relaxation",
                value=(self.strength, self.tau_s, self.sd),
            )


def rate_words(terms: Sequence[Term]) -> str:
    """Which rate effects are corrected, for people: ``corrected: 5.4 % in 0.1 s, 3.3 % in 1 s``; else empty.

    Args:
        terms: of the series.
    """
    each = (f"{100 * term.strength:.2g} % in {term.tau_s:.2g} s" for term in terms)
    return f"corrected: {', '.join(each)}" if terms else ""


@dataclass(frozen=True)
class RateStep:
    """One estimate with the overstress on top, and the state behind it.

    Attributes:
        wrench: corrected.
        time_s, long_term, overstress: (6,) and (terms, 6); None where the estimate was unusable.
    """

    wrench: Wrench
    time_s: float
    long_term: Array | None
    overstress: Array


@dataclass(frozen=True)
class Overstress:
    """State of a :class:`RateFilter`, with which another one goes on; plain numbers, to be written and compared.

    Attributes:
        by_term: (terms, 6) overstress of each term, N and N m.
        time_s: of the last estimate that counted; None where it is unknown, as after the clock was set.
        long_term: (6,) that estimate, N and N m; empty where ``time_s`` is None.

    Raises:
        ValueError: numbers that are not finite, or too many or too few of them.
    """

    by_term: tuple[tuple[float, ...], ...]
    time_s: float | None = None
    long_term: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        numbers = [*self.long_term, *(value for row in self.by_term for value in row), self.time_s or 0.0]
        sized = 0 < len(self.by_term) <= MOST_TERMS and all(len(row) == AXES for row in self.by_term)
        if not sized or len(self.long_term) != (0 if self.time_s is None else AXES) or not np.isfinite(numbers).all():
            raise ValueError(f"overstress of {len(self.by_term)} terms and {len(self.long_term)} axes")


class RateFilter:
    """The overstress of one endcap, from frame to frame.

    Args:
        terms: of the series; none at all leaves every wrench as it is.
        begin: state of the filter before; None, or one of another number of terms, begins relaxed.
    """

    def __init__(self, terms: Sequence[Term] = (), begin: Overstress | None = None) -> None:
        self._tau = np.array([term.tau_s for term in terms])
        self._strength = np.array([term.strength for term in terms])
        self._doubt = np.array([term.sd / term.strength for term in terms])
        self._time_s = 0.0
        self._long_term: Array | None = None
        self._overstress = np.zeros((len(terms), AXES))
        if begin is not None and len(begin.by_term) == len(terms):
            self._overstress = np.array(begin.by_term)
            if begin.time_s is not None:
                self._time_s, self._long_term = begin.time_s, np.array(begin.long_term)

    @property
    def state(self) -> Overstress | None:
        """With which another filter goes on; None where it would begin relaxed anyway."""
        by_term = tuple(tuple(row) for row in self._overstress.tolist())
        if self._long_term is not None:
            return Overstress(by_term, self._time_s, tuple(self._long_term.tolist()))
        return Overstress(by_term) if self._overstress.any() else None

    def step(self, wrench: Wrench) -> RateStep:
        """The corrected wrench; one that is not finite, flagged "missing" or no newer than the last is unchanged."""
        if not len(self._tau):
            return RateStep(wrench, wrench.time_s, None, self._overstress)
        value = np.concatenate([wrench.force_n, wrench.torque_nm])
        usable = bool(np.isfinite(value).all()) and math.isfinite(wrench.time_s) and "missing" not in wrench.flags
        if not usable:
            return RateStep(wrench, wrench.time_s, None, self._overstress)
        overstress = self._overstress
        if self._long_term is not None:
            interval_s = wrench.time_s - self._time_s
            if interval_s <= 0:
                return RateStep(wrench, wrench.time_s, None, overstress)
            overstress = advanced(overstress, value - self._long_term, interval_s, self._strength, self._tau)
        corrected = value + overstress.sum(axis=0)
        doubt = self._doubt[:, None] * overstress
        moved = replace(
            wrench, force_n=corrected[:3], torque_nm=corrected[3:], covariance=wrench.covariance + doubt.T @ doubt
        )
        return RateStep(moved, wrench.time_s, value, overstress)

    def take(self, step: RateStep) -> None:
        """Remember a step whose estimate counted."""
        if step.long_term is not None:
            self._time_s, self._long_term, self._overstress = step.time_s, step.long_term, step.overstress


def advanced(overstress: Array, change: Array, interval_s: float, strength: Array, tau_s: Array) -> Array:
    """Overstress after an interval in which the long-term wrench changed linearly.

    Args:
        overstress: (terms, k) before.
        change: (k,) of the long-term wrench.
        interval_s: over 0.
        strength, tau_s: (terms,) of the series.
    """
    part = interval_s / tau_s
    ramp = -np.expm1(-part) / part  # (tau / dt) (1 - exp(-dt / tau)), 1 for short intervals
    return np.asarray(np.exp(-part)[:, None] * overstress + (strength * ramp)[:, None] * change)
