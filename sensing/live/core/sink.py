"""Outputs that can never slow the loop: readings go into a bounded queue, a thread of the output's own takes them out.

A full queue loses its oldest reading (a recording the newest) and counts it. An output that fails says so and stops;
the others go on.
"""

from __future__ import annotations

import threading
from collections import deque
from typing import Protocol

from sensing.live.core.reading import EndcapReading

LAST_S = 0.2  # for the reading under way and the end of a file


class Sink(Protocol):
    """Interface of an output for the engine."""

    def put(self, reading: EndcapReading) -> None:
        """Take one reading; must return at once."""
        ...


def reason_of(error: BaseException) -> str:
    """Why an output stopped: the system's words where it has some."""
    return getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"


class QueuedSink:
    """Base of outputs with a thread of their own: override :meth:`write` and :meth:`finish`.

    Args:
        length: readings that the output may be behind.
        idle_s: :meth:`idle` is called after so long without one.

    Attributes:
        dropped: readings lost because the output was too slow.
        failed: why it stopped; empty while it works.
    """

    def __init__(self, length: int, idle_s: float | None = None) -> None:
        self._idle_s = idle_s
        self._queue: deque[EndcapReading] = deque(maxlen=length)
        self._changed = threading.Condition()
        self._closing = False
        self.dropped, self.failed = 0, ""
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def put(self, reading: EndcapReading) -> None:
        """Queue one reading."""
        with self._changed:
            if self.failed or self._closing:
                return
            if self.admit(reading):
                self._queue.append(reading)  # a full queue loses its oldest
                self._changed.notify()

    @property
    def ended(self) -> bool:
        """Whether its thread is done; False also when it hangs."""
        return not self._thread.is_alive()

    def close(self, wait_s: float = 5.0) -> None:
        """Write the queued readings, then end; after ``wait_s`` the rest is dropped and counted."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        if self.ended or self._thread is threading.current_thread():
            return
        self._thread.join(wait_s)
        if not self.ended:
            with self._changed:
                self.dropped += len(self._queue)
                self._queue.clear()
            self._thread.join(LAST_S)

    def fail(self, error: Exception) -> None:
        """Stop because of an error outside :meth:`write` (any thread); the first one counts."""
        self.failed = self.failed or reason_of(error)

    def write(self, reading: EndcapReading) -> None:
        """One reading, in the output's thread; an OSError ends the output."""
        raise NotImplementedError

    def idle(self) -> None:
        """No reading came for ``idle_s``; in the output's thread."""

    def finish(self) -> None:
        """End of the output, in its thread, also after a failure."""

    def admit(self, reading: EndcapReading) -> bool:
        """Whether to queue a reading; counts lost ones. It is called with the queue locked and must not wait."""
        self.dropped += self._full
        return True

    @property
    def _full(self) -> bool:
        return len(self._queue) == self._queue.maxlen

    def _run(self) -> None:
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self._queue or self._closing, self._idle_s)
                    if not self._queue and self._closing:
                        break
                    reading = self._queue.popleft() if self._queue else None
                if reading is None:
                    self.idle()
                else:
                    self.write(reading)
        except Exception as error:  # an output must not end the process: it reports the error
            self.fail(error)
        try:
            self.finish()
        except Exception as error:
            self.fail(error)
