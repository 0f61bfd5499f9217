"""Wall time, as ROS 2 stamps have it, of moments of ``time.monotonic``, on which pictures are captured."""

from __future__ import annotations

import time

CLOCK_SET_S = 1e-3  # looks agree to microseconds, and slow corrections (NTP) move both clocks alike
LOOKS = 3


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
    """Wall time less monotonic time, by the quickest of some looks: this thread may have to wait between two clocks."""
    looks = [(time.monotonic_ns(), time.time_ns(), time.monotonic_ns()) for _ in range(LOOKS)]
    before, wall, after = min(looks, key=lambda look: look[2] - look[0])
    return wall - (before + after) // 2
