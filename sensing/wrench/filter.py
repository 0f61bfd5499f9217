"""Multiple-model Kalman filter: wrenches of single frames to a smooth wrench at any later time, by capture times.

    tracker = WrenchFilter()
    for wrench in estimates:                      # each stamped with the middle of its frame's exposure
        tracker.update(wrench)
        print(tracker.now(time.monotonic()))      # predicted from the frame's time to the present

Ten motion models run in parallel, from a constant force to one that jumps; each axis weights them by how well they
predicted its last measurements (mode probabilities). The measurement variances are the diagonal of the estimate's
covariance where it has one, as axes are filtered separately. Only the part ``scatter`` of a measurement's error is
independent from picture to picture, whatever the load; the rest repeats while the load stays. Steady motions therefore
average over ``scatter`` alone, and the variance of the rest is added to their result. Time steps are those between
capture times, so the frame rate and dropped frames need no setting. N and N m, seconds.

Notes:
    A motion has a value and a rate, F = [[1, dt], [0, 1]], and white noise on both, Q = q [[dt^3 / 3, dt^2 / 2],
    [dt^2 / 2, dt]] + [[w dt, 0], [0, 0]] (Bar-Shalom, Li, Kirubarajan 2001, sec. 6.2.2). The update is in Joseph's
    form, which stays positive definite. An innovation too large for all motions increases their covariances first, so
    that an impact is followed at once; a steady motion whose own innovation is too large starts again from the
    measurement. The motions are mixed as autonomous multiple models (ibid., sec. 11.6.2) with fading mode
    probabilities. Prediction leaves 0.3 % of the lag behind a ramp well over the noise, and of the lag behind a sine of
    frequency w a part of the order (w lag)^2; a force that reverses too fast to be predicted is held by the motions
    without a rate. ``at`` gives the mean of the mixture; ``now`` multiplies its rate by the factors of
    :mod:`sensing.wrench.trend`. The arithmetic is in :mod:`sensing.wrench.filter_kernels`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.records import Wrench
from sensing.wrench.filter_kernels import correct, mixture, mode_probabilities, predict
from sensing.wrench.load_scale import RELEASED_RADIUS_MM
from sensing.wrench.quantiles import chi_square_quantile
from sensing.wrench.trend import Trend, row_for

Array = NDArray[np.float64]
MANEUVER_NIS = chi_square_quantile(1 - 1e-5, 6)  # normalised innovation squared beyond which all motions are widened
LOST_NIS = chi_square_quantile(1 - 1e-5, 1)  # the same of one axis, beyond which a steady motion starts again
TINY = 1e-12  # least variance taken as one, N^2 or (N m)^2
LEAST_PROBABILITY = 1e-3  # least mode probability, so that a motion can return within some frames
ARM_M = 0.07  # E: at D=130: lever arm, about R, between torques about the sphere's centre and forces on the dome


@dataclass(frozen=True)
class Motion:
    """Motion model of a force; that of a torque is the same for a force with a lever arm of :attr:`FilterConfig.arm_m`.

    Attributes:
        walk: noise density of the value, N^2/s.
        acceleration: noise density of the rate, N^2/s^3.
        start_rate: standard deviation of the first rate, N/s; with 0, and no acceleration, the model has no rate.
        steady: so slow that the measurement error repeats, but for :attr:`FilterConfig.scatter`.
    """

    walk: float = 0.0
    acceleration: float = 0.0
    start_rate: float = 0.0
    steady: bool = False


STANDARD = (
    Motion(walk=2e-4, steady=True),
    Motion(0.0, 0.3, 1.0, steady=True), Motion(0.0, 10.0, 3.0, steady=True), Motion(0.0, 300.0, 30.0, steady=True),
    Motion(walk=10.0), Motion(walk=300.0), Motion(walk=1e4),
    Motion(0.0, 30.0, 50.0), Motion(0.0, 1e4, 300.0), Motion(0.0, 3e5, 1000.0),
)  # fmt: skip


@dataclass(frozen=True)
class FilterConfig:
    """Parameters of the filter.

    Attributes:
        motions: the motion models.
        memory: factor on the logarithm of the mode probabilities from one measurement to the next, (0, 1].
        noise: (6,) standard deviation of a measurement where the estimate has none, N and N m.
        scatter: (6,) standard deviation of its part that is independent from picture to picture, N and N m (M: rendered
            frames of an endcap at rest and held at 13 to 52 N; unlike the whole error, it does not grow with the load).
        ahead_s: longest prediction with a moving value; beyond it the value stays and "stale" is flagged.
        gap_s: after a longer gap between estimates the filter restarts.
        arm_m: lever arm between torques about the sphere's centre and forces on the dome.

    Raises:
        ParameterError: a number out of its range, or no motion.
    """

    motions: tuple[Motion, ...] = STANDARD
    memory: float = 0.9
    noise: Array = field(default_factory=lambda: np.array([0.15] * 3 + [0.02] * 3))
    scatter: Array = field(default_factory=lambda: np.array([0.0055, 0.0055, 0.011, 5e-4, 5e-4, 4e-4]))
    ahead_s: float = 0.15
    gap_s: float = 0.5
    arm_m: float = ARM_M

    def __post_init__(self) -> None:
        for name in ("noise", "scatter"):
            deviation = np.broadcast_to(np.asarray(getattr(self, name), float), (6,))
            _require(bool(np.isfinite(deviation).all() and (deviation > 0).all()), name, deviation)
            object.__setattr__(self, name, deviation)
        for name in ("ahead_s", "gap_s", "arm_m"):
            _require(bool(np.isfinite(getattr(self, name)) and getattr(self, name) > 0), name, getattr(self, name))
        _require(0 < self.memory <= 1, "memory", self.memory, "over 0 and at most 1")
        numbers = [n for motion in self.motions for n in (motion.walk, motion.acceleration, motion.start_rate)]
        good = bool(np.isfinite(numbers).all() and min(numbers, default=-1.0) >= 0)
        _require(good, "motions", self.motions, "one or more, with finite numbers of at least 0")

    def scaled(self, load_scale: float, radius_mm: float = RELEASED_RADIUS_MM) -> FilterConfig:
        """The parameters for forces ``load_scale`` times as large (:mod:`sensing.wrench.load_scale`).

        Args:
            load_scale: of forces; torques scale with the radius, too.
            radius_mm: of the outer sphere.
        """
        longer = radius_mm / RELEASED_RADIUS_MM
        scale = np.repeat([load_scale, load_scale * longer], 3)
        motions = tuple(
            replace(m, walk=m.walk * load_scale**2, acceleration=m.acceleration * load_scale**2,
                    start_rate=m.start_rate * load_scale) for m in self.motions
        )  # fmt: skip
        return replace(
            self, motions=motions, noise=self.noise * scale, scatter=self.scatter * scale, arm_m=self.arm_m * longer
        )


class WrenchFilter:
    """Filter of one endcap: takes estimates in the order of capture, gives the wrench at any later time.

    Attributes:
        nis: normalised innovation squared of the last update (chi-square of 6 when the model holds), NaN before.
        late: estimates ignored because they were not newer than the last one.
    """

    def __init__(self, config: FilterConfig | None = None) -> None:
        self.config = config or FilterConfig()
        self.nis, self.late = float("nan"), 0
        arm = np.array([1.0] * 3 + [self.config.arm_m] * 3) ** 2
        motions, self._noise = self.config.motions, np.array(self.config.noise) ** 2
        self._walk = np.array([motion.walk for motion in motions])[:, None] * arm
        self._density = np.array([motion.acceleration for motion in motions])[:, None] * arm
        self._rates = np.array([motion.start_rate for motion in motions])[:, None] ** 2 * arm
        self._last: Wrench | None = None
        self._weight = np.full((len(motions), 6), 1 / len(motions))
        steady = np.array([motion.steady for motion in motions])
        self._new_variance = np.where(steady[:, None], np.array(self.config.scatter) ** 2, np.inf)
        self._nis_limit = np.where(steady, LOST_NIS, np.inf)
        self._common = np.zeros((len(motions), 6))  # variances that repeat from frame to frame
        self._state = np.zeros((len(motions), 2, 6))  # values, rates
        self._covariance = np.zeros((len(motions), 3, 6))  # of value, of value with rate, of rate
        self._trend = Trend()

    def update(self, wrench: Wrench) -> Wrench:
        """Take one estimate; returns the filtered wrench at its capture time.

        An estimate that is not finite or flagged "missing" is not used: the result is predicted and flagged "missing".
        One that is not newer than the last is not used, either: the result is flagged "late".

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
            return self._reported(self._last.time_s, wrench.flags | {"late"})
        if not usable:
            return self._predicted(wrench.time_s, wrench.flags | {"missing"})
        if step > self.config.gap_s:
            return self._start(wrench, measured, variance)
        self._state, self._covariance = self._predict_step(step)
        noise = self._noise_of(variance)
        value, spread = mixture(self._weight, self._state, self._covariance, noise)
        self.nis = float(((measured - value) ** 2 / spread).sum())
        self._weight = mode_probabilities(
            self._weight, self._state, self._covariance, measured, noise, self.config.memory, LEAST_PROBABILITY
        )
        correct(self._state, self._covariance, measured, noise, MANEUVER_NIS, self._rates, self._nis_limit)
        self._common = variance - noise
        self._last = wrench
        value = (self._weight * self._state[:, 0]).sum(axis=0)
        self._trend.update(wrench.time_s, measured, variance, value, self._rate())
        return self._reported(wrench.time_s, wrench.flags)

    @property
    def last_s(self) -> float | None:
        """Capture time of the last estimate that was used; None before."""
        return None if self._last is None else self._last.time_s

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

    def now(self, time_s: float) -> Wrench:
        """The wrench at a time at or after the last estimate, predicted with the rate times its recent factors.

        On a steady motion this is :meth:`at`; where the force reverses within the delay, or only noise moves it, the
        last value is held. The part of the change that is left out is added to the covariance.

        Raises:
            ParameterError: as :meth:`at`.
        """
        full = self.at(time_s)
        assert self._last is not None
        delay_s = time_s - self._last.time_s
        left = (self._rate() - self.trend[row_for(delay_s)]) * min(delay_s, self.config.ahead_s)
        covariance = full.covariance + np.diag(left**2)
        return replace(
            full, force_n=full.force_n - left[:3], torque_nm=full.torque_nm - left[3:], covariance=covariance
        )

    @property
    def trend(self) -> Array:
        """(H, 6) rate, N/s and N m/s, that :meth:`now` uses, for each of :data:`sensing.wrench.trend.HORIZONS_S`."""
        return np.asarray(self._trend.factors * self._rate())

    def _rate(self) -> Array:
        """(6,) mean rate of the mixture, N/s and N m/s."""
        return np.asarray((self._weight * self._state[:, 1]).sum(axis=0))

    def _start(self, wrench: Wrench, measured: Array, variance: Array) -> Wrench:
        self._weight[:] = 1 / len(self._weight)
        self._state[:, 0], self._state[:, 1] = measured, 0.0
        noise = self._noise_of(variance)
        self._covariance[:, 0], self._covariance[:, 1], self._covariance[:, 2] = noise, 0.0, self._rates
        self._common = variance - noise
        self._last, self.nis = wrench, float("nan")
        self._trend.restart()
        return self._reported(wrench.time_s, wrench.flags)

    def _predict_step(self, step: float) -> tuple[Array, Array]:
        return predict(self._state, self._covariance, step, self._walk, self._density)

    def _noise_of(self, variance: Array) -> Array:
        """(M, 6) measurement variance that each motion assumes."""
        return np.minimum(self._new_variance, variance)

    def _variance(self, covariance: Array) -> Array:
        reported = covariance.diagonal()
        return np.where((reported > TINY) & (reported < np.inf), reported, self._noise)

    def _predicted(self, time_s: float, flags: frozenset[str]) -> Wrench:
        assert self._last is not None
        step = time_s - self._last.time_s
        state, covariance = self._predict_step(step)
        if step > self.config.ahead_s:
            state = self._predict_step(self.config.ahead_s)[0]
            flags = flags | {"stale"}
        return _wrench(time_s, mixture(self._weight, state, covariance, self._common), self._last.frame, flags)

    def _reported(self, time_s: float, flags: frozenset[str]) -> Wrench:
        assert self._last is not None
        reported = mixture(self._weight, self._state, self._covariance, self._common)
        return _wrench(time_s, reported, self._last.frame, flags)


def _wrench(time_s: float, reported: tuple[Array, Array], frame: str, flags: frozenset[str]) -> Wrench:
    value, variance = reported
    covariance = np.zeros((6, 6))
    covariance.flat[::7] = variance
    return Wrench(time_s, value[:3], value[3:], frame, covariance, flags)


def _flagged(wrench: Wrench) -> Wrench:
    """The result before the first usable estimate: zero, without a covariance, flagged "missing"."""
    return Wrench(wrench.time_s, np.zeros(3), np.zeros(3), wrench.frame, flags=wrench.flags | {"missing"})


def _require(good: bool, name: str, value: Any, wanted: str = "positive and finite") -> None:
    if not good:
        raise ParameterError(f"{name}={value}: must be {wanted}", name=name, value=value)
