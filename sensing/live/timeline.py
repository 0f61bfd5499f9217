"""Index of a recording: places of moments in its file, from which a replay can start.

    timeline = Timeline(path)
    start = timeline.start("endcap_0", 12.0)          # byte, reference and channels; recorded_frames(path, name, start)

Moments are seconds since the first message. Only the heads of the file's records are read for this, and the chunks
that hold a reference.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Channel, Message

from sensing.live.mcap_records import CutError, DamagedError, chunk_places, read_chunk, read_records
from sensing.live.outputs.mcap.stamps import RecordedClock
from sensing.live.recorded_messages import time_in

NS = 1e-9
CAPTURE_TIME = "/image/capture_time"  # end of the topics with the time of each picture


@dataclass(frozen=True)
class Start:
    """Where to begin with one endcap.

    Attributes:
        byte: of the chunk; 0 for the file's own begin.
        from_ns: stamp of the first message that counts.
        zero: message with the reference in use there; None where the first is yet to come.
        zero_error: message with how much its dots scatter.
        kept: message with what the frames before have left; None where there is none.
        topics: of the file's channels, by number.
    """

    byte: int = 0
    from_ns: int = 0
    zero: Message | None = None
    zero_error: Message | None = None
    kept: Message | None = None
    topics: dict[int, str] = field(default_factory=dict)


WHOLE = Start()


class Timeline:
    """Of one recording.

    Args:
        path: of the file.

    Attributes:
        span_s: from the first message to the last.

    Raises:
        FileError: it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._chunks = path, chunk_places(path)
        self._topics: dict[int, str] = {}
        self.begin_ns = min((chunk.begin_ns for chunk in self._chunks), default=0)
        self.span_s = NS * (max((chunk.end_ns for chunk in self._chunks), default=0) - self.begin_ns)

    def at_s(self, stamp_ns: int) -> float:
        """Moment of a message."""
        return NS * (stamp_ns - self.begin_ns)

    def clock(self) -> RecordedClock | None:
        """Wall time of the capture times, as of the first picture; None where none can be read."""
        topics: dict[int, str] = {}
        with suppress(CutError, DamagedError):  # said when it is played
            for record in read_records(self._path):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and topics.get(record.channel_id, "").endswith(CAPTURE_TIME):
                    time_s = time_in(self._path, CAPTURE_TIME, record)
                    return RecordedClock(self.begin_ns, record.log_time - int(time_s * 1e9))
        return None

    def start(self, endcap: str, moment_s: float) -> Start:
        """Where to begin so that the first picture is that of a moment.

        Args:
            endcap: its name.
            moment_s: 0 or less for the begin.

        Raises:
            FileError: the file is damaged before the moment.
        """
        if moment_s <= 0 or not self._chunks:
            return WHOLE
        self._topics = self._topics or _topics(self._path)
        from_ns = self.begin_ns + round(moment_s / NS)
        first = next((chunk for chunk in self._chunks if chunk.end_ns >= from_ns), self._chunks[-1])
        zero, error, kept = (self._last(f"/{endcap}/{name}", from_ns) for name in ("zero", "zero_error_px", "kept"))
        return Start(first.byte, from_ns, zero, error, kept, self._topics)

    def _last(self, topic: str, before_ns: int) -> Message | None:
        """The last message of a topic before a stamp."""
        channels = {number for number, named in self._topics.items() if named == topic}
        for chunk in reversed(self._chunks) if channels else ():
            if chunk.begin_ns < before_ns and (not chunk.channels or chunk.channels & channels):
                found = [
                    record
                    for record in read_chunk(self._path, chunk.byte)
                    if isinstance(record, Message) and record.channel_id in channels and record.log_time < before_ns
                ]
                if found:
                    return found[-1]
        return None


def _topics(path: Path) -> dict[int, str]:
    """Of the channels that are named before the first message, as a recorder does with all of them."""
    found: dict[int, str] = {}
    for record in read_records(path):
        if isinstance(record, Message):
            break
        if isinstance(record, Channel):
            found[record.id] = record.topic
    return found
