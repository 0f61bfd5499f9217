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

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HORIZONS_S = (0.025, 0.05, 0.1, 0.15)  # delays at which predictions are compared; a USB camera's is 0.05 (E)
MEMORY_S = 0.6  # E: over which comparisons fade
CAUTION = 2.0  # deviations by which a factor is lowered
LEAST = 4.0  # pseudo-count of changes of one deviation that came to nothing
NOISE = 2.0  # variance of y - x over the measurement's where the motion is steady: of two measurements


class Trend:
    """Factors from comparisons in the past, one set for each of :data:`HORIZONS_S`.

    Attributes:
        factors: (H, 6) 0..1, of the filter's rate.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget everything: the last value is held until something is known."""
        self.factors: Array = np.zeros((len(HORIZONS_S), 6))
        self._past: deque[tuple[float, Array, Array]] = deque()
        self._xy, self._xx = np.zeros((len(HORIZONS_S), 2)), np.zeros((len(HORIZONS_S), 2))
        self._last_s: float | None = None

    def update(self, time_s: float, measured: Array, variance: Array, value: Array, rate: Array) -> None:
        """Compare, then remember what is predicted from here.

        Args:
            time_s: of the measurement. measured, variance: (6,) of it. value, rate: (6,) of the filter after it.
        """
        if self._last_s is not None:
            fading = math.exp(-(time_s - self._last_s) / MEMORY_S)
            self._xy *= fading
            self._xx *= fading
        self._last_s = time_s
        while len(self._past) > 1 and time_s - self._past[1][0] >= HORIZONS_S[-1]:
            self._past.popleft()
        for number, horizon_s in enumerate(HORIZONS_S):
            old = next((entry for entry in reversed(self._past) if time_s - entry[0] >= horizon_s), None)
            if old is not None:
                x, y = old[2] * (time_s - old[0]), measured - old[1]
                self._xy[number] += (x * y / variance).reshape(2, 3).sum(axis=1)
                self._xx[number] += (x * x / variance).reshape(2, 3).sum(axis=1)
        self._past.append((time_s, value, rate))
        careful = (self._xy - CAUTION * np.sqrt(NOISE * self._xx)) / (self._xx + LEAST)
        self.factors = np.repeat(np.clip(careful, 0.0, 1.0), 3, axis=1)


def row_for(delay_s: float) -> int:
    """Number of the horizon that serves a delay: the next longer one, or the longest."""
    return next((k for k, horizon_s in enumerate(HORIZONS_S) if horizon_s >= delay_s - 1e-9), len(HORIZONS_S) - 1)
