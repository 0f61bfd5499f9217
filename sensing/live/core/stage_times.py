"""Stop watch of the stages of a frame."""

from __future__ import annotations

import time


class StageTimes:
    """Begins now.

    Attributes:
        stages: duration of each stage, ms.
    """

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        """The stage of this name ends, and the next one begins."""
        now = time.perf_counter()
        self.stages[name] = 1e3 * (now - self._last)
        self._last = now
