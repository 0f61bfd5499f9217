"""Every reading as one line of JSON, for pipes: ``python -m sensing.live --json | jq .force_n``."""

from __future__ import annotations

import errno
import json
import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, TextIO

from sensing.live.core.reading import EndcapReading, nothing, plain
from sensing.live.core.sink import QueuedSink
from sensing.live.core.state import WITHOUT_FRAMES
from sensing.live.core.stats import EndcapHealth
from sensing.live.outputs.beat import Beat

ROOM = 1024  # readings that a slow reader may be behind
BEAT_S = 0.2


class JsonLines(QueuedSink):
    """Writes JSON lines to a stream; a closed reader ends it without an error message and sets ``failed``.

    Args:
        stream: where.
        health: states of the endcaps; one that gives no frames any more gets a line with nulls, once.

    Attributes:
        lines: written.
    """

    def __init__(self, stream: TextIO, health: Callable[[], Sequence[EndcapHealth]] = list) -> None:
        super().__init__(ROOM)
        self._stream, self._health = stream, health
        self._states: dict[str, str] = {}
        self._writing, self._beat = threading.Lock(), Beat(BEAT_S, self._look, self.fail)
        self.lines = 0

    @property
    def loss(self) -> str:
        """Lines that are missing in the stream, in words; empty if there is none, or if the reader has closed it."""
        if self.failed and self.failed != os.strerror(errno.EPIPE):
            return f"--json: stopped after {self.lines} lines ({self.failed})"
        return f"--json: {self.dropped} readings lost to a slow reader" if self.dropped and not self.failed else ""

    def start(self) -> None:
        """Begin to write."""
        super().start()
        self._beat.start()

    def write(self, reading: EndcapReading) -> None:
        """One line."""
        self._line(plain(reading))

    def finish(self) -> None:
        """No more lines."""
        self._beat.stop()

    def _look(self) -> None:
        """A line for an endcap that has stopped to give numbers: null instead of silence."""
        if self._queue:
            return  # readings from before come first
        for health in self._health():
            changed, self._states[health.endcap] = self._states.get(health.endcap) != health.status, health.status
            if changed and health.status in WITHOUT_FRAMES and not self.failed:
                self._line(nothing(health.endcap, health.status, health.message))

    def _line(self, content: dict[str, Any]) -> None:
        with self._writing:
            self._stream.write(json.dumps(content, allow_nan=False, separators=(",", ":")) + "\n")
            self._stream.flush()
            self.lines += 1
