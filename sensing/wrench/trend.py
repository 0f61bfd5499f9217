"""How much of a predicted change comes true: the filter's rate against what came of it.

    trend = Trend()
    trend.update(time_s, measured, variance, value, rate)
    prediction = value + trend.factors[row_for(delay_s)] * rate * delay_s

Notes:
    A prediction that is one delay old is compared with what is measured now. With x the change predicted then and y
    the change that came, both over the measurement's deviation and pooled over the three forces and over the three
    torques, the factor of least squares error is sum xy / sum xx over a fading memory: one on a steady motion, zero or
    below where the rate is noise or the motion turns faster than the delay. It is lowered by :data:`CAUTION` deviations
    of itself and cut to 0..1, so holding the last value, the factor zero, is left only where prediction was better.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.wrench.filter_kernels import came_true

Array = NDArray[np.float64]
HORIZONS_S = (0.025, 0.05, 0.1, 0.15)  # delays at which predictions are compared; a USB camera's is 0.05 (E)
MEMORY_S = 0.6  # E: over which comparisons fade
CAUTION = 2.0  # deviations by which a factor is lowered
LEAST = 4.0  # pseudo-count of changes of one deviation that came to nothing
NOISE = 2.0  # variance of y - x over the measurement's where the motion is steady: of two measurements
ROOM = 256  # predictions that are kept: enough for the longest delay at 1,700 frames/s
_LAW = (MEMORY_S, CAUTION, LEAST, NOISE)


class Trend:
    """Factors from comparisons in the past, one set for each of :data:`HORIZONS_S`.

    Attributes:
        factors: (H, 6) 0..1, of the filter's rate.
    """

    def __init__(self) -> None:
        self._horizons_s = np.array(HORIZONS_S)
        self._past_s, self._past = np.zeros(ROOM), np.zeros((ROOM, 2, 6))  # times; values and rates
        self._sums = np.zeros((2, len(HORIZONS_S), 2))  # of x y and of x x, forces and torques
        self.restart()

    def restart(self) -> None:
        """Forget everything: the last value is held until something is known."""
        self.factors: Array = np.zeros((len(HORIZONS_S), 6))
        self._sums[:] = 0.0
        self._first, self._next = 0, 0  # of the predictions kept, counted since the restart

    def update(self, time_s: float, measured: Array, variance: Array, value: Array, rate: Array) -> None:
        """Compare, then remember what is predicted from here.

        Args:
            time_s: of the measurement.
            measured, variance: (6,) of it.
            value, rate: (6,) of the filter after it.
        """
        self.factors, first = came_true(
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
