"""Whether the stamps of a topic can be of this computer's clock: those of another make samples count as late, or lost.

Nothing arrives before it was measured, and waiting on the way only adds to its age: so the youngest sample of the first
second says by how much the clocks differ, to within the time on the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable

LOOK_S = 1.0
AHEAD_S = 0.05  # E: clocks set by NTP agree to some milliseconds; a gyroscope counts as silent after as much
BEHIND_S = 0.5  # E: more than any sensor and network that a robot can walk with take


class ClockWatch:
    """Names every topic whose clock differs, once.

    Args:
        say: takes the line.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._seen: dict[str, tuple[float, float]] = {}  # first arrival, least age; s
        self._judged: set[str] = set()

    def take(self, topic: str, stamp_s: float, now_s: float) -> None:
        """One sample.

        Args:
            topic: it came on. stamp_s: its capture time. now_s: its arrival, on the same clock.
        """
        if topic in self._judged or not math.isfinite(stamp_s):
            return
        first_s, age_s = self._seen.get(topic, (now_s, math.inf))
        age_s = min(age_s, now_s - stamp_s)
        self._seen[topic] = first_s, age_s
        if now_s - first_s < LOOK_S:
            return
        self._judged.add(topic)
        if not -AHEAD_S <= age_s <= BEHIND_S:
            way = "ahead of" if age_s < 0 else "behind"
            self._say(
                f"/{topic}: its stamps are {abs(age_s):.2f} s {way} this computer's clock, so its samples or those of "
                "the others count as late: set all clocks by NTP or PTP"
            )
