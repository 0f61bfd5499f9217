"""Progress of a command, for people who look at a terminal."""

from __future__ import annotations

import sys
import time


class Progress:
    """One line for each step on a terminal; silent elsewhere."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._shown = sys.stderr.isatty()

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._start

    def __call__(self, step: str) -> None:
        """Announce a step."""
        if self._shown:
            print(f"\r\033[K[{self.seconds:5.1f} s] {step}", end="", file=sys.stderr, flush=True)

    def end(self) -> None:
        """Clear the line."""
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
