"""Lines for a terminal or a pipe, written by a thread of their own, so that a slow reader delays nothing else."""

from __future__ import annotations

import errno
import queue
import threading
from typing import TextIO

ROOM = 256  # texts that a stopped terminal (Ctrl-S) may be behind; later ones are left out


class Lines:
    """A text stream that never waits and never raises.

    Args:
        stream: where the texts go.

    Attributes:
        gone: the reader has left (a closed pipe, a closed terminal).
        failed: why nothing can be written; empty while it can.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._tty = stream.isatty()
        self._texts: queue.Queue[str | None] = queue.Queue(ROOM)
        self.gone, self.failed = False, ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def isatty(self) -> bool:
        """Whether the stream is a terminal."""
        return self._tty

    def write(self, text: str) -> int:
        """Queue a text."""
        try:
            self._texts.put_nowait(text)
        except queue.Full:
            return 0
        return len(text)

    def flush(self) -> None:
        """Nothing: every text is flushed when it is written."""

    def close(self, wait_s: float = 0.25) -> None:
        """Write the queued lines; gives up after ``wait_s``."""
        try:
            self._texts.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(wait_s)

    def _run(self) -> None:
        while (text := self._texts.get()) is not None:
            if self.failed:
                continue
            try:
                self._put(text)
            except (OSError, ValueError) as error:
                self.gone = isinstance(error, BrokenPipeError) or getattr(error, "errno", 0) == errno.EIO  # no terminal
                self.failed = getattr(error, "strerror", None) or str(error)

    def _put(self, text: str) -> None:
        try:
            self._stream.write(text)
        except UnicodeEncodeError:  # a terminal of another encoding
            self._stream.write(text.encode("ascii", "backslashreplace").decode())
        self._stream.flush()
