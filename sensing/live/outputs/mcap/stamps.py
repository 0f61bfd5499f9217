"""Wall time of the capture, for the messages of a recording, at whatever pace its pictures are read.

A camera's pictures carry times of this run's clock. Those of a file have times of their own, and the moment at which
one is read says when it was captured only at the file's own pace. So stamps of a file follow its pictures' times:
begin where the recording that is played says, or else now.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from sensing.live.core.reading import EndcapReading
from sensing.live.outputs.ros.wall_clock import wall_less_monotonic_ns

LEAST_NS = 1_000_000  # between the end of a file and its first picture when it is played again


@dataclass(frozen=True)
class RecordedClock:
    """Wall time in a recording that is played.

    Attributes:
        begin_ns: stamp of its first message.
        wall_less_capture_ns: wall time less the capture times of its pictures.
    """

    begin_ns: int
    wall_less_capture_ns: int


class CaptureStamps:
    """Stamps of one recording, ns; from one thread.

    Args:
        played: clock of the recording that the pictures come from; None for cameras and other files.
    """

    def __init__(self, played: RecordedClock | None = None) -> None:
        self._wall_ns = wall_less_monotonic_ns()  # fixed: stamps do not follow a clock being set
        self._newest_ns = None if played is None else played.begin_ns  # of files; None without
        self._read_s = -math.inf  # moment at which that one was due
        self._passes = [] if played is None else [played.wall_less_capture_ns]  # wall less file time, of each pass
        self._at: dict[str, tuple[int, float]] = {}  # pass and time of an endcap's last picture

    def of(self, reading: EndcapReading) -> int:
        """Of a reading's picture."""
        time_s, read_s = reading.frame.time_s, reading.captured_s
        if time_s == read_s:  # a camera
            return self._wall_ns + int(read_s * 1e9)
        number, last_s = self._at.get(reading.endcap, (0, -math.inf))
        number += time_s < last_s  # the file is played again, or sent back
        if number == len(self._passes):
            self._passes.append(self._next_ns(read_s) - int(time_s * 1e9))
        self._at[reading.endcap] = number, time_s
        stamp_ns = self._passes[number] + int(time_s * 1e9)
        if self._newest_ns is None or stamp_ns > self._newest_ns:
            self._newest_ns, self._read_s = stamp_ns, read_s
        return stamp_ns

    def now_ns(self) -> int:
        """Of a message that belongs to no picture: wall time, or that of a file's newest picture."""
        return self._wall_ns + int(time.monotonic() * 1e9) if self._newest_ns is None else self._newest_ns

    def _next_ns(self, read_s: float) -> int:
        """Of the first picture of a pass: it follows the newest one, as long after it as it is read after it."""
        if self._newest_ns is None:
            return self._wall_ns + int(read_s * 1e9)
        return self._newest_ns + max(LEAST_NS, int((read_s - self._read_s) * 1e9))
