"""An endcap whose dots are given, not drawn: own weight, a shifted camera and a touch move them."""

from __future__ import annotations

import numpy as np
from live_stand_in import film, frames, pipeline

from sensing.live.core.reading import EndcapReading
from sensing.live.core.seen import SeenFrame

SIZE, RATE_HZ, NOISE_PX = (640, 480), 30.0, 0.01
SIDEWAYS_G = (1.0, 0.0, 1.0)  # from upright to lying


class Turned:
    """An endcap whose dots are moved as own weight, a shifted camera and a touch move them."""

    def __init__(self) -> None:
        self.pipe, self.count = pipeline(), 1
        self.pipe.update(frames(film([0]))[0])
        method = self.pipe._used.method
        self.places = method.tracker.reference_px
        self.sag = np.zeros_like(self.places)
        self.sag[method.known] = self.pipe._measurement._own_weight._modes @ np.array(SIDEWAYS_G)
        away = self.places - self.places.mean(axis=0) - [60.0, 40.0]
        self.touch = 8.0 * np.exp(-(away**2).sum(axis=1) / 2 / 60.0**2)[:, None] * [1.0, 0.4]
        self._rng = np.random.default_rng(0)

    def frame(self, moved: np.ndarray) -> SeenFrame:
        self.count += 1
        count = len(self.places)
        noise = self._rng.normal(0.0, NOISE_PX, moved.shape)
        rows = np.column_stack([self.places + moved + noise, np.full(count, 0.995), np.zeros(count)])
        return SeenFrame(100.0 + self.count / RATE_HZ, self.count, "test", size=SIZE, rows=rows, likeness=0.99)

    def give(self, moved: np.ndarray, count: int) -> list[EndcapReading]:
        return [self.pipe.update(self.frame(moved)) for _ in range(count)]
