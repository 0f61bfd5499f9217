"""Checks whether the stamps of a topic are of this computer's clock; with another clock samples count as late or lost.

No sample arrives before it was measured, and delays only add to its age. So the youngest sample of the first
second gives the difference of the clocks, up to the least delay.

A stamp far ahead would make the samples of all other topics too late until its time has come, so it is left out at any
time; so is one that is far behind.
"""

from __future__ import annotations

import math
from collections.abc import Callable

LOOK_S = 1.0  # s, time in which the youngest sample is looked for
AHEAD_S = 0.05  # E: clocks set by NTP agree to some milliseconds; a gyroscope counts as silent after this time
BEHIND_S = 0.5  # E: more than the delay of any sensor and network with which a robot can walk
MOST_AHEAD_S = 0.5  # half of the history that the estimator keeps (Settings.history_s)
MOST_BEHIND_S = 30.0  # a driver or computer whose clock was never set
REMEDY = "set all clocks by NTP or PTP"  # advice at the end of each message


class ClockWatch:
    """Reports every topic with another clock once, when its first unusable sample arrives.

    Args:
        say: function that takes the line.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._seen: dict[str, tuple[float, float]] = {}  # first arrival, least age; s
        self._judged: set[str] = set()
        self._left_out: set[str] = set()

    def take(self, topic: str, stamp_s: float, now_s: float) -> bool:
        """Whether a sample can be used.

        Args:
            topic: topic of the sample.
            stamp_s: its capture time, s.
            now_s: its arrival, s, on the same clock.
        """
        if not math.isfinite(stamp_s):  # the estimator counts such samples
            return True
        if not -MOST_AHEAD_S <= now_s - stamp_s <= MOST_BEHIND_S:
            self._leave_out(topic, now_s - stamp_s)
            return False
        if topic not in self._judged:
            self._judge(topic, now_s, now_s - stamp_s)
        return True

    def _leave_out(self, topic: str, age_s: float) -> None:
        if topic in self._left_out:
            return
        self._left_out.add(topic)
        self._say(f"/{topic}: a stamp {_off(age_s)}: such samples are left out; {REMEDY}")

    def _judge(self, topic: str, now_s: float, age_s: float) -> None:
        first_s, least_s = self._seen.get(topic, (now_s, math.inf))
        age_s = min(least_s, age_s)
        self._seen[topic] = first_s, age_s
        if now_s - first_s < LOOK_S:
            return
        self._judged.add(topic)
        if not -AHEAD_S <= age_s <= BEHIND_S:
            self._say(
                f"/{topic}: its stamps are {_off(age_s)}, so its samples or those of the others count as late: {REMEDY}"
            )


def _off(age_s: float) -> str:
    return f"{abs(age_s):.2f} s {'ahead of' if age_s < 0 else 'behind'} this computer's clock"
