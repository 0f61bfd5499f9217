"""Progress of a recording, one line that is rewritten twice a second; no output without a terminal."""

from __future__ import annotations

import sys
import threading
import time
from typing import TextIO

EVERY_S = 0.5


class Progress:
    """A context; its thread writes even while the camera or the sensor blocks.

    Attributes:
        frames, rest, written, unpaired, damaged, waiting: counts so far.
        rest_wanted: untouched frames that are needed.
        force_n: norm of the last force written.
        samples: of the force sensor.
    """

    def __init__(self, rest_wanted: int, stream: TextIO | None = None) -> None:
        self.rest_wanted = rest_wanted
        self.frames = self.rest = self.written = self.unpaired = self.damaged = self.waiting = self.samples = 0
        self.force_n = float("nan")
        self._stream = sys.stderr if stream is None else stream
        self._begin_s = time.monotonic()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Progress:
        if self._stream.isatty():
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        if self._thread.is_alive():
            self._thread.join(1.0)
            self._stream.write("\n")

    def line(self) -> str:
        """The state now."""
        said = f"{time.monotonic() - self._begin_s:.0f} s: "
        if not self.frames:
            return said + "waiting for the first picture"
        if not self.samples:
            return said + f"{self.frames} pictures, waiting for the force sensor"
        if self.rest < self.rest_wanted:
            return (
                said + f"leave it untouched: {self.rest} of {self.rest_wanted} pictures, {self.unpaired} without force"
            )
        force = "" if self.force_n != self.force_n else f", {self.force_n:.1f} N"
        return (
            said + f"{self.written} frames written{force}, {self.waiting} wait for their force, {self.unpaired} without"
        )

    def _run(self) -> None:
        while not self._done.wait(EVERY_S):
            self._stream.write(f"\r\x1b[2K{self.line()}")
            self._stream.flush()
