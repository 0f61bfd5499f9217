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
    Q = q [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]; update in Joseph's form, which stays positive definite. Lag removed
    from a ramp is complete; from a sine of frequency w it is down to order (w lag)^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from cad.errors import ParameterError
from sensing.records import Wrench

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
        self._last: Wrench | None = None
        self._state = np.zeros((6, 2))
        self._covariance = np.zeros((6, 2, 2))

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
        self._state, self._covariance = self._ahead(step)
        self._correct(measured, variance)
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
        self._state = np.stack([measured, np.zeros(6)], axis=1)
        self._covariance = np.zeros((6, 2, 2))
        self._covariance[:, 0, 0], self._covariance[:, 1, 1] = variance, self.config.start_rate**2
        self._last, self.nis = wrench, float("nan")
        return self._told(wrench.time_s, wrench.flags)

    def _variance(self, covariance: Array) -> Array:
        told = np.diagonal(covariance)
        return np.where(np.isfinite(told) & (told > TINY), told, self.config.noise**2)

    def _ahead(self, step: float) -> tuple[Array, Array]:
        F = np.array([[1.0, step], [0.0, 1.0]])
        Q = np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
        return self._state @ F.T, F @ self._covariance @ F.T + self.config.acceleration[:, None, None] * Q

    def _correct(self, measured: Array, variance: Array) -> None:
        """Joseph's form; a surprise widens the rate first, so that an impact is followed at once."""
        innovation = measured - self._state[:, 0]
        spread = self._covariance[:, 0, 0] + variance
        self.nis = float((innovation**2 / spread).sum())
        if self.nis > MANEUVER_NIS:
            self._covariance = self._covariance.copy()
            self._covariance[:, 0, 0] += innovation**2
            self._covariance[:, 1, 1] += self.config.start_rate**2
            spread = self._covariance[:, 0, 0] + variance
        gain = self._covariance[:, :, 0] / spread[:, None]  # (6, 2)
        self._state = self._state + gain * innovation[:, None]
        keep = np.tile(np.eye(2), (6, 1, 1))
        keep[:, :, 0] -= gain
        noise = gain[:, :, None] * gain[:, None, :] * variance[:, None, None]
        self._covariance = keep @ self._covariance @ keep.transpose(0, 2, 1) + noise

    def _predicted(self, time_s: float, flags: frozenset[str]) -> Wrench:
        assert self._last is not None
        step = time_s - self._last.time_s
        state, covariance = self._ahead(step)
        if step > self.config.ahead_s:
            state, flags = self._ahead(self.config.ahead_s)[0], flags | {"stale"}
        return _wrench(time_s, state[:, 0], covariance[:, 0, 0], self._last.frame, flags)

    def _told(self, time_s: float, flags: frozenset[str]) -> Wrench:
        assert self._last is not None
        return _wrench(time_s, self._state[:, 0], self._covariance[:, 0, 0], self._last.frame, flags)


def _wrench(time_s: float, value: Array, variance: Array, frame: str, flags: frozenset[str]) -> Wrench:
    return Wrench(time_s, value[:3], value[3:], frame, np.diag(variance), flags)


def _flagged(wrench: Wrench) -> Wrench:
    """Before the first usable estimate nothing is known: zero, without a covariance, and said so."""
    return Wrench(wrench.time_s, np.zeros(3), np.zeros(3), wrench.frame, flags=wrench.flags | {"missing"})


def _require(good: bool, name: str, value: Any) -> None:
    if not good:
        raise ParameterError(f"{name}={value}: must be positive and finite", name=name, value=value)
