"""The newest reading of every cap, for whoever looks now and then: terminal, page, robot state."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from sensing.live.core.reading import CapReading


class Latest:
    """Newest reading by cap; putting never waits for a reader."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._readings: dict[str, CapReading] = {}
        self._lock = threading.Lock()

    def put(self, reading: CapReading) -> None:
        """Replace the cap's reading."""
        with self._lock:
            self._readings[reading.cap] = reading

    def get(self, cap: str) -> CapReading | None:
        """Newest reading of a cap; None before the first."""
        with self._lock:
            return self._readings.get(cap)

    def all(self) -> dict[str, CapReading]:
        """Newest readings so far, by cap."""
        with self._lock:
            return dict(self._readings)
