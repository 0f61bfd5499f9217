"""The newest reading of every endcap, for readers that poll: terminal, page, robot state."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from sensing.live.core.reading import EndcapReading


class Latest:
    """Newest reading by endcap; putting never waits for a reader."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self._readings: dict[str, EndcapReading] = {}
        self._lock = threading.Lock()

    def put(self, reading: EndcapReading) -> None:
        """Replace the endcap's reading."""
        with self._lock:
            self._readings[reading.endcap] = reading

    def get(self, endcap: str) -> EndcapReading | None:
        """Newest reading of an endcap; None before the first."""
        with self._lock:
            return self._readings.get(endcap)

    def all(self) -> dict[str, EndcapReading]:
        """Newest readings so far, by endcap."""
        with self._lock:
            return dict(self._readings)
