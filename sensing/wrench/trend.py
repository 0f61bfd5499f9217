"""Which part of a predicted change occurs: regression of measured changes on those that the filter's rate predicts.

    trend = Trend()
    trend.update(time_s, measured, variance, value, rate)
    prediction = value + trend.factors[row_for(delay_s)] * rate * delay_s

Notes:
    A prediction that is one delay old is compared with the present measurement. With x the predicted and y the measured
    change, both over the measurement's standard deviation and pooled over the three forces and over the three torques,
    the least-squares factor is sum xy / sum xx with exponentially fading weights: one on a steady motion, zero or below
    where the rate is noise or the motion reverses within the delay. It is lowered by :data:`CAUTION` of its standard
    deviations and clipped to 0..1, so that the last value is held (factor zero) unless prediction was clearly better.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.wrench.filter_kernels import rate_factors

Array = NDArray[np.float64]
HORIZONS_S = (0.025, 0.05, 0.1, 0.15)  # delays at which predictions are compared; a USB camera's is 0.05 (E)
MEMORY_S = 0.6  # E: time constant of the fading weights
CAUTION = 2.0  # E: standard deviations of a factor by which it is lowered
LEAST = 4.0  # E: prior, as predicted changes of one standard deviation that did not occur
NOISE = 2.0  # variance of y - x over the measurement's on a steady motion: that of two measurements
ROOM = 256  # estimates in the ring buffer: enough for the longest delay at 1,700 frames/s
_LAW = (MEMORY_S, CAUTION, LEAST, NOISE)


class Trend:
    """Factors on the filter's rate from past comparisons, one set for each of :data:`HORIZONS_S`.

    Attributes:
        factors: (H, 6) 0..1, of the filter's rate.
    """

    def __init__(self) -> None:
        self._horizons_s = np.array(HORIZONS_S)
        self._past_s, self._past = np.zeros(ROOM), np.zeros((ROOM, 2, 6))  # times; values and rates
        self._sums = np.zeros((2, len(HORIZONS_S), 2))  # of x y and of x x, forces and torques
        self.restart()

    def restart(self) -> None:
        """Forget all comparisons: the last value is held until there are new ones."""
        self.factors: Array = np.zeros((len(HORIZONS_S), 6))
        self._sums[:] = 0.0
        self._first, self._next = 0, 0  # of the predictions kept, counted since the restart

    def update(self, time_s: float, measured: Array, variance: Array, value: Array, rate: Array) -> None:
        """Compare earlier predictions with a measurement, then store the filter's estimate for later comparisons.

        Args:
            time_s: capture time of the measurement.
            measured, variance: (6,) wrench, N and N m, and its variances.
            value, rate: (6,) wrench and rate of the filter after this measurement.
        """
        self.factors, first = rate_factors(
            self._past_s, self._past, self._first, self._next, time_s, measured, variance, self._horizons_s,
            self._sums, _LAW,
        )  # fmt: skip
        place = self._next % ROOM
        self._past_s[place], self._past[place, 0], self._past[place, 1] = time_s, value, rate
        self._next += 1
        self._first = max(first, self._next - ROOM)


def row_for(delay_s: float) -> int:
    """Number of the horizon that serves a delay: the next longer one, or the longest."""
    return next((k for k, horizon_s in enumerate(HORIZONS_S) if horizon_s >= delay_s - 1e-9), len(HORIZONS_S) - 1)
