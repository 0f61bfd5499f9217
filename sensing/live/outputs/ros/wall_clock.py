"""Wall time, as ROS 2 stamps have it, of moments of ``time.monotonic``, on which pictures are captured."""

from __future__ import annotations

import math
import time

CLOCK_SET_S = 1e-3  # looks agree to microseconds, and slow corrections (NTP) move both clocks alike
QUICK_NS, MOST_LOOKS = 50_000, 20


class WallClock:
    """This computer's wall clock, followed when it is set (by NTP or PTP, after a start without network).

    Attributes:
        offset_ns: wall time less monotonic time, as of the last :meth:`follow`.
    """

    def __init__(self) -> None:
        self.offset_ns = wall_less_monotonic_ns()

    def follow(self) -> float:
        """By how much the clock was set since the last look, s; 0 where it was not."""
        offset_ns = wall_less_monotonic_ns()
        moved_s = (offset_ns - self.offset_ns) / 1e9
        if abs(moved_s) <= CLOCK_SET_S:
            return 0.0
        self.offset_ns = offset_ns
        return moved_s

    def stamp_ns(self, time_s: float) -> int:
        """Wall time of a moment, ns; a clock that was set is followed first."""
        self.follow()
        return self.offset_ns + round(time_s * 1e9)


def wall_less_monotonic_ns() -> int:
    """Wall time less monotonic time, by a quick look at both: between two clocks this thread may have to wait."""
    quickest = math.inf
    for _ in range(MOST_LOOKS):
        before, wall, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        if after - before < quickest:
            quickest, offset_ns = after - before, wall - (before + after) // 2
        if quickest < QUICK_NS:
            break
    return offset_ns
