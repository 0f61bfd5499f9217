"""Something done again and again in a thread of its own, also while no reading comes."""

from __future__ import annotations

import threading
from collections.abc import Callable

WAIT_S = 0.2  # for a call under way at the end


class Beat:
    """Calls a function every so often until stopped, also after an error.

    Args:
        period_s: between calls.
        work: what is done.
        on_error: takes every error, in the same thread, to report it.
    """

    def __init__(self, period_s: float, work: Callable[[], None], on_error: Callable[[Exception], None]) -> None:
        self._period_s, self._work, self._on_error = period_s, work, on_error
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """No call begins any more; one under way is waited for."""
        self._stop.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(WAIT_S)

    def _run(self) -> None:
        while not self._stop.wait(self._period_s):
            try:
                self._work()
            except Exception as error:  # of a request or a state: the next may be good
                if not self._stop.is_set():  # what is taken away at the end is no error
                    self._on_error(error)
