"""Every reading as one line of JSON, for pipes: ``python -m sensing.live --json | jq .force_n``."""

from __future__ import annotations

import errno
import json
import os
from typing import TextIO

from sensing.live.core.reading import CapReading, plain
from sensing.live.core.sink import QueuedSink

ROOM = 1024  # readings that a slow reader may be behind


class JsonLines(QueuedSink):
    """Writes to a stream; a reader that went away ends it without noise (``failed`` says so).

    Attributes:
        lines: written.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__(ROOM)
        self._stream = stream
        self.lines = 0

    @property
    def loss(self) -> str:
        """What is missing in the stream, in one line; empty if nothing is, or if its reader has left."""
        if self.failed and self.failed != os.strerror(errno.EPIPE):
            return f"--json: stopped after {self.lines} lines ({self.failed})"
        return f"--json: {self.dropped} readings lost to a slow reader" if self.dropped and not self.failed else ""

    def write(self, reading: CapReading) -> None:
        """One line."""
        self._stream.write(json.dumps(plain(reading), allow_nan=False, separators=(",", ":")) + "\n")
        self._stream.flush()
        self.lines += 1
