"""Every reading as one line of JSON, for pipes: ``python -m sensing.live --json | jq .force_n``."""

from __future__ import annotations

import json
from typing import TextIO

from sensing.live.core.reading import CapReading, plain
from sensing.live.core.sink import QueuedSink

ROOM = 1024  # readings that a slow reader may be behind


class JsonLines(QueuedSink):
    """Writes to a stream; a reader that went away ends it without noise (``failed`` says so)."""

    def __init__(self, stream: TextIO) -> None:
        super().__init__(ROOM)
        self._stream = stream

    def write(self, reading: CapReading) -> None:
        """One line."""
        self._stream.write(json.dumps(plain(reading), allow_nan=False, separators=(",", ":")) + "\n")
        self._stream.flush()
