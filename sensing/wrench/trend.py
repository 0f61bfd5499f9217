"""How much of a predicted change comes true: the filter's rate against what came of it, at the delay of a camera.

    trend = Trend(horizon_s=0.05)
    trend.update(time_s, measured, variance, value, rate)
    prediction = value + trend.factor * rate * delay_s

Notes:
    A prediction that is one delay old is compared with what is measured now. With x the change predicted then and y
    the change that came, both over the measurement's deviation and pooled over the three forces and over the three
    torques, the factor of least squares error is sum xy / sum xx over a fading memory: one on a steady motion, zero or
    below where the rate is noise or the motion turns faster than the delay. It is lowered by :data:`CAUTION` deviations
    of itself and cut to 0..1, so holding the last value, the factor zero, is left only where prediction was better.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HORIZON_S = 0.05  # E: from mid-exposure to the answer of a USB camera
MEMORY_S = 0.6  # E: over which comparisons fade
CAUTION = 2.0  # deviations by which a factor is lowered
LEAST = 4.0  # pseudo-count of changes of one deviation that came to nothing
NOISE = 2.0  # variance of y - x over the measurement's where the motion is steady: of two measurements


class Trend:
    """Factor for each axis, from comparisons in the past.

    Args:
        horizon_s: delay at which predictions are compared. memory_s: time constant of the memory.

    Attributes:
        factor: (6,) 0..1, of the filter's rate.
    """

    def __init__(self, horizon_s: float = HORIZON_S, memory_s: float = MEMORY_S) -> None:
        self._horizon_s, self._memory_s = horizon_s, memory_s
        self.restart()

    def restart(self) -> None:
        """Forget everything: the last value is held until something is known."""
        self.factor: Array = np.zeros(6)
        self._past: deque[tuple[float, Array, Array]] = deque()
        self._xy, self._xx = np.zeros(2), np.zeros(2)
        self._last_s: float | None = None

    def update(self, time_s: float, measured: Array, variance: Array, value: Array, rate: Array) -> None:
        """Compare, then remember what is predicted from here.

        Args:
            time_s: of the measurement. measured, variance: (6,) of it. value, rate: (6,) of the filter after it.
        """
        if self._last_s is not None:
            fading = np.exp(-(time_s - self._last_s) / self._memory_s)
            self._xy, self._xx = fading * self._xy, fading * self._xx
        self._last_s = time_s
        while len(self._past) > 1 and time_s - self._past[1][0] >= self._horizon_s:
            self._past.popleft()
        if self._past and time_s - self._past[0][0] >= self._horizon_s:
            then_s, before, slope = self._past[0]
            x, y = slope * (time_s - then_s), measured - before
            self._xy += (x * y / variance).reshape(2, 3).sum(axis=1)
            self._xx += (x * x / variance).reshape(2, 3).sum(axis=1)
        self._past.append((time_s, value, rate))
        careful = (self._xy - CAUTION * np.sqrt(NOISE * self._xx)) / (self._xx + LEAST)
        self.factor = np.repeat(np.clip(careful, 0.0, 1.0), 3)
