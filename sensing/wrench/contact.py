"""Contact detection: a threshold from an untouched interval, hysteresis, one state per endcap.

    threshold = threshold_from_rest(rest_force_n, false_positive_rate=1e-3)
    detectors = {endcap: ContactDetector(threshold[endcap]) for endcap in endcaps}
    touching = detectors[endcap].update(wrench).touching

Forces in N, times in s. A rate is per frame: 1e-3 at 30 Hz is one false contact in 33 s.

Notes:
    The untouched force norm is x. With enough independent samples the threshold is an order statistic, the smallest
    whose exceedance is below the rate with 95 % confidence (Clopper, Pearson 1934, doi:10.1093/biomet/26.4.404). With
    fewer, the tail above the 90th percentile is taken as exponential, its mean at the upper 95 % bound of the
    chi-square interval: norms of Gaussian noise have lighter tails, so this errs to the safe side. Samples that follow
    one another are not independent: their number is divided by the autocorrelation time. No threshold is below
    :data:`LEAST_ON_N`: a minute at rest does not show how the lamp will change in an hour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cad.errors import ParameterError
from sensing.records import Wrench
from sensing.wrench.quantiles import binomial_quantile, chi_square_quantile

CONFIDENCE = 0.95  # that the rate of false contacts is not larger than the stated one
TAIL = 0.10  # share of the samples that counts as tail
LEAST_TAIL = 8  # independent samples in it
LEAST_ON_N = 0.02  # M: twice the most that lamps 30 % off make of an untouched D=130 T=8 (bench_wrench_rest.py)
RELEASE_SHARE = 0.6  # E: contact ends below this share of the way from rest to the threshold


@dataclass(frozen=True)
class ContactThreshold:
    """Force norms at which contact begins and ends.

    Attributes:
        on_n: contact begins at or above.
        off_n: contact ends below.
        rate: stated false positives per frame.
        samples: number of independent samples that it is based on.
        extrapolated: whether the exponential tail was used.
    """

    on_n: float
    off_n: float
    rate: float
    samples: float
    extrapolated: bool

    def __post_init__(self) -> None:
        if not 0 <= self.off_n <= self.on_n < np.inf:
            raise ParameterError(
                f"off_n={self.off_n:g}, on_n={self.on_n:g}: need 0 <= off_n <= on_n", name="on_n", value=self.on_n
            )


@dataclass(frozen=True)
class ContactState:
    """State of contact after one frame.

    Attributes:
        time_s: capture time.
        touching: whether there is contact; for an unusable frame the last known state.
        since_s: capture time at which that state began.
        force_n: norm of the force, N.
        known: False for an unusable frame.
    """

    time_s: float
    touching: bool
    since_s: float
    force_n: float
    known: bool


def threshold_from_rest(
    forces_n: ArrayLike, false_positive_rate: float = 1e-3, load_scale: float = 1.0
) -> ContactThreshold:
    """Threshold that an untouched endcap passes at most at the stated rate, with 95 % confidence.

    Args:
        forces_n: (N, 3) force of consecutive frames of an interval without contact.
        false_positive_rate: of single frames.
        load_scale: scale of the endcap's forces (:mod:`sensing.wrench.load_scale`).

    Raises:
        ParameterError: a rate outside 1e-9..0.1, forces that are not finite, or too short an interval.
    """
    if not 1e-9 <= false_positive_rate <= 0.1:
        raise ParameterError(
            f"false_positive_rate={false_positive_rate:g} outside 1e-9..0.1: give false contacts per frame",
            name="false_positive_rate",
            value=false_positive_rate,
        )
    forces = np.asarray(forces_n, float)
    if forces.ndim != 2 or forces.shape[1] != 3 or not np.isfinite(forces).all():
        raise ParameterError(
            f"forces_n of shape {forces.shape}, all finite: {bool(np.isfinite(forces).all())}: give (N, 3) N",
            name="forces_n",
            value=forces.shape,
        )
    norm = np.sort(np.linalg.norm(forces, axis=1))
    independent = len(norm) / autocorrelation_time(np.linalg.norm(forces, axis=1)) if len(norm) else 0.0
    if independent * TAIL < LEAST_TAIL:
        raise ParameterError(
            f"forces_n holds {len(norm)} frames worth {independent:.0f} independent ones, at least "
            f"{LEAST_TAIL / TAIL:.0f} needed: leave the endcap untouched for longer",
            name="forces_n",
            value=len(norm),
        )
    allowed = _allowed_exceedances(independent, false_positive_rate)
    extrapolated = allowed < 0
    if extrapolated:
        on = _exponential_tail(norm, independent, false_positive_rate)
    else:
        on = float(norm[min(len(norm) - 1, int(np.ceil(len(norm) * (1 - allowed / independent))) - 1)])
    rest = float(np.median(norm))
    on = max(float(np.nextafter(on, np.inf)), LEAST_ON_N * load_scale)
    return ContactThreshold(on, rest + RELEASE_SHARE * (on - rest), false_positive_rate, independent, extrapolated)


class ContactDetector:
    """Contact of one endcap over time, with hysteresis.

    Args:
        threshold: of this endcap.
        touching: whether it begins in contact.

    Attributes:
        touching: as of the last frame that was judged.
    """

    def __init__(self, threshold: ContactThreshold, touching: bool = False) -> None:
        self.threshold, self.touching = threshold, touching
        self._since_s = float("nan")

    def update(self, wrench: Wrench) -> ContactState:
        """State of contact after one frame; a wrench that is not finite leaves it unchanged and unknown."""
        force = math.sqrt(float(wrench.force_n @ wrench.force_n))
        known = math.isfinite(force)
        limit = self.threshold.off_n if self.touching else self.threshold.on_n
        now = force >= limit if known else self.touching
        if now != self.touching or math.isnan(self._since_s):
            self._since_s = wrench.time_s
        self.touching = now
        return ContactState(wrench.time_s, now, self._since_s, force, known)


def autocorrelation_time(series: NDArray[np.float64]) -> float:
    """Integrated autocorrelation time: consecutive samples per independent sample, at least 1.

    Notes:
        1 + 2 sum of the autocorrelation up to the first window of five times itself (Sokal 1997,
        doi:10.1007/978-1-4899-0319-8_6).
    """
    centred = series - series.mean()
    if len(series) < 4 or series.min() == series.max():  # the mean of equal numbers is off by rounding
        return 1.0
    spectrum = np.abs(np.fft.rfft(centred, 2 * len(series))) ** 2
    correlation = np.fft.irfft(spectrum)[: len(series)]
    cumulative = 2 * np.cumsum(correlation / correlation[0]) - 1
    window = np.flatnonzero(np.arange(len(series)) >= 5 * cumulative)
    return float(max(1.0, cumulative[window[0] if len(window) else -1]))


def _allowed_exceedances(independent: float, rate: float) -> int:
    """Most samples over the threshold that still prove the rate; -1 if none would not prove it."""
    return binomial_quantile(1 - CONFIDENCE, int(independent), rate) - 1


def _exponential_tail(norm: NDArray[np.float64], independent: float, rate: float) -> float:
    start = float(np.quantile(norm, 1 - TAIL))
    excess = norm[norm > start] - start
    mean = float(excess.mean()) if len(excess) else 0.0
    count = independent * TAIL
    upper = mean * 2 * count / chi_square_quantile(1 - CONFIDENCE, 2 * count)
    return start + upper * float(np.log(TAIL / rate))
