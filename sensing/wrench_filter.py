"""Wrenches of single frames to a smooth wrench now: a causal Kalman filter that counts in capture times.

    tracker = WrenchFilter()
    for wrench in estimates:                      # each stamped with the middle of its frame's exposure
        tracker.update(wrench)
        print(tracker.at(time.monotonic()))       # lag removed: told for now, not for the frame

Each of the six axes has a value and a rate that changes by white noise of density ``acceleration``; measurement noise
is the estimate's own covariance where it tells one (its diagonal: axes are filtered apart). Time steps are those
between capture times, so 30 or 120 Hz and dropped frames need no setting. N and N m, seconds.

Notes:
    Constant-velocity model (Bar-Shalom, Li, Kirubarajan 2001, sec. 6.2.2): F = [[1, dt], [0, 1]],
    Q = q [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]; update in Joseph's form, which stays positive definite; a surprise
    widens the rate first, so that an impact is followed at once. Lag removed from a ramp is complete; from a sine of
    frequency w it is down to order (w lag)^2. The arithmetic is in :mod:`sensing.wrench_kernels`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from cad.errors import ParameterError
from sensing.records import Wrench
from sensing.wrench_kernels import ahead, correct

Array = NDArray[np.float64]
MANEUVER_NIS = float(stats.chi2.isf(1e-5, 6))  # innovation beyond this: the motion changed faster than the model
TINY = 1e-12


@dataclass(frozen=True)
class FilterConfig:
    """Knobs of the filter.

    Attributes:
        acceleration: (6,) noise density q, N^2/s^3 and (N m)^2/s^3.
        noise: (6,) standard deviation of a measurement where the estimate tells none, N and N m.
        start_rate: (6,) standard deviation of the first rate, N/s and N m/s.
        ahead_s: longest prediction with a moving value; beyond it the value stays and "stale" is flagged.
        gap_s: after a longer silence the filter starts anew.

    Raises:
        ParameterError: a number that is not positive and finite.
    """

    acceleration: Array = field(default_factory=lambda: np.array([300.0] * 3 + [1.5] * 3))
    noise: Array = field(default_factory=lambda: np.array([0.15] * 3 + [0.02] * 3))
    start_rate: Array = field(default_factory=lambda: np.array([50.0] * 3 + [3.0] * 3))
    ahead_s: float = 0.15
    gap_s: float = 0.5

    def __post_init__(self) -> None:
        for name in ("acceleration", "noise", "start_rate"):
            value = np.broadcast_to(np.asarray(getattr(self, name), float), (6,))
            _require(bool(np.isfinite(value).all() and (value > 0).all()), name, value)
            object.__setattr__(self, name, value)
        for name in ("ahead_s", "gap_s"):
            _require(bool(np.isfinite(getattr(self, name)) and getattr(self, name) > 0), name, getattr(self, name))


class WrenchFilter:
    """Estimates in, in the order of capture; the wrench at any later time out.

    Attributes:
        nis: normalised innovation squared of the last update (chi-square of 6 when the model holds), NaN before.
        late: estimates ignored because they were not newer than the last one.
    """

    def __init__(self, config: FilterConfig | None = None) -> None:
        self.config = config or FilterConfig()
        self.nis, self.late = float("nan"), 0
        self._density, self._noise = np.array(self.config.acceleration), np.array(self.config.noise) ** 2
        self._rates = np.array(self.config.start_rate) ** 2
        self._last: Wrench | None = None
        self._state = np.zeros((2, 6))  # values, rates
        self._covariance = np.zeros((3, 6))  # of value, of value with rate, of rate

    def update(self, wrench: Wrench) -> Wrench:
        """Take one estimate; returns the filtered wrench at its capture time.

        An estimate that is not finite or flagged "missing" is passed over (the answer is predicted and so flagged); one
        that is not newer than the last changes nothing (flagged "late").

        Raises:
            ParameterError: an estimate in another frame than those before, or without a finite time.
        """
        if not np.isfinite(wrench.time_s):
            raise ParameterError(f"time_s={wrench.time_s}: an estimate needs its capture time", name="time_s")
        measured = np.concatenate([wrench.force_n, wrench.torque_nm])
        variance = self._variance(wrench.covariance)
        usable = bool(np.isfinite(measured).all()) and "missing" not in wrench.flags
        if self._last is None:
            return self._start(wrench, measured, variance) if usable else _flagged(wrench)
        if wrench.frame != self._last.frame:
            raise ParameterError(
                f"frame={wrench.frame!r}, before it was {self._last.frame!r}: use a filter for each frame", name="frame"
            )
        step = wrench.time_s - self._last.time_s
        if step <= 0:
            self.late += 1
            return self._told(self._last.time_s, wrench.flags | {"late"})
        if not usable:
            return self._predicted(wrench.time_s, wrench.flags | {"missing"})
        if step > self.config.gap_s:
            return self._start(wrench, measured, variance)
        self._state, self._covariance = ahead(self._state, self._covariance, step, self._density)
        self.nis = correct(self._state, self._covariance, measured, variance, MANEUVER_NIS, self._rates)
        self._last = wrench
        return self._told(wrench.time_s, wrench.flags)

    def at(self, time_s: float) -> Wrench:
        """The wrench predicted to a time at or after the last estimate; flagged "stale" when that is too far.

        Raises:
            ParameterError: nothing has been estimated yet, or a time before the last estimate.
        """
        if self._last is None:
            raise ParameterError("no estimate yet: update the filter first", name="time_s")
        if not time_s >= self._last.time_s:
            raise ParameterError(
                f"time_s={time_s} before the last estimate at {self._last.time_s}: the filter is causal", name="time_s"
            )
        return self._predicted(time_s, self._last.flags)

    def _start(self, wrench: Wrench, measured: Array, variance: Array) -> Wrench:
        self._state = np.stack([measured, np.zeros(6)])
        self._covariance = np.stack([variance, np.zeros(6), self._rates])
        self._last, self.nis = wrench, float("nan")
        return self._told(wrench.time_s, wrench.flags)

    def _variance(self, covariance: Array) -> Array:
        told = covariance.diagonal()
        return np.where((told > TINY) & (told < np.inf), told, self._noise)

    def _predicted(self, time_s: float, flags: frozenset[str]) -> Wrench:
        assert self._last is not None
        step = time_s - self._last.time_s
        state, covariance = ahead(self._state, self._covariance, step, self._density)
        if step > self.config.ahead_s:
            state = ahead(self._state, self._covariance, self.config.ahead_s, self._density)[0]
            flags = flags | {"stale"}
        return _wrench(time_s, state[0], covariance[0], self._last.frame, flags)

    def _told(self, time_s: float, flags: frozenset[str]) -> Wrench:
        assert self._last is not None
        return _wrench(time_s, self._state[0], self._covariance[0], self._last.frame, flags)


def _wrench(time_s: float, value: Array, variance: Array, frame: str, flags: frozenset[str]) -> Wrench:
    covariance = np.zeros((6, 6))
    covariance.flat[::7] = variance
    return Wrench(time_s, value[:3], value[3:], frame, covariance, flags)


def _flagged(wrench: Wrench) -> Wrench:
    """Before the first usable estimate nothing is known: zero, without a covariance, and said so."""
    return Wrench(wrench.time_s, np.zeros(3), np.zeros(3), wrench.frame, flags=wrench.flags | {"missing"})


def _require(good: bool, name: str, value: Any) -> None:
    if not good:
        raise ParameterError(f"{name}={value}: must be positive and finite", name=name, value=value)
