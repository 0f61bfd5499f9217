"""Something done again and again in a thread of its own, also while no reading comes."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable


class Beat:
    """Calls a function every so often until stopped; an error ends it.

    Args:
        period_s: between calls. work: what is done.
    """

    def __init__(self, period_s: float, work: Callable[[], None]) -> None:
        self._period_s, self._work = period_s, work
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self, wait_s: float = 0.2) -> None:
        """No call begins any more; one under way is waited for."""
        self._stop.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(wait_s)

    def _run(self) -> None:
        with contextlib.suppress(Exception):  # the output that it belongs to says what failed
            while not self._stop.wait(self._period_s):
                self._work()
