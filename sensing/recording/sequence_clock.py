"""When numbered samples were taken, from when they arrived.

    clock = SequenceClock()
    time_s = clock.stamp(sequence, arrived_s)

A sample that waited least on its way arrived earliest, so sampling times lie on the line that touches the arrivals from
below; its slope is the time of a count, whatever the sensor counts (its own ticks or the samples it sends).

Notes:
    The line is the edge of the lower convex hull of (count, arrival) below the middle of the counts, which minimises
    the sum of all waits (Moon, Skelly and Towsley 1999, doi:10.1109/INFCOM.1999.749287). A delay that is the same for
    all samples cannot be seen in it: see ``delay_s``.
"""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from cad.errors import EndcapError

LEAST_S = 0.5  # of arrivals before a rate is known; until then a sample counts as taken when it arrived
SURE_S = 2.0  # after which a rate that was given is compared, and replaced: 0.1 % off is 0.1 s after 100 s
TOLERANCE = 0.02  # of the rate
SPAN_S = 60.0  # looked back on at least, so that a drift is followed
WRAP = 1 << 32
LOST = 1 << 20  # counts; a larger step is a sensor that began anew


class RateError(EndcapError):
    """A sensor whose counter does not run at its stated rate."""


class SequenceClock:
    """One sensor's clock.

    Args:
        rate_hz: counts a second, used until they are found out; None where they are not known.
        delay_s: on the way, of every sample.
    """

    def __init__(self, rate_hz: float | None = None, delay_s: float = 0.0) -> None:
        self.delay_s = delay_s
        self._given_hz = rate_hz
        self._hull, self._next = _Hull(), _Hull()
        self._last: int | None = None
        self._count = 0

    @property
    def rate_hz(self) -> float | None:
        """Counts a second as seen; None while too little has been seen."""
        slope = self._hull.slope if self._hull.span_s >= LEAST_S else None
        return None if slope is None or slope <= 0 else 1 / slope

    def stamp(self, sequence: int, arrived_s: float) -> float:
        """When the sample of this number was taken.

        Raises:
            RateError: the rate that was given is not that of the sensor.
        """
        step = 0 if self._last is None else (sequence - self._last + WRAP // 2) % WRAP - WRAP // 2
        if abs(step) > LOST:
            self._hull, self._next, step = _Hull(), _Hull(), 1
        self._last, self._count = sequence, self._count + step
        for hull in (self._hull, self._next):
            hull.add(self._count, arrived_s)
        if self._hull.span_s > 2 * SPAN_S:
            self._hull, self._next = self._next, _Hull()
        elif self._hull.span_s < SPAN_S:
            self._next = _Hull()
        return self._on_line(arrived_s) - self.delay_s

    def _on_line(self, arrived_s: float) -> float:
        rate_hz = self.rate_hz
        if self._given_hz is not None and (rate_hz is None or self._hull.span_s <= SURE_S):
            rate_hz = self._given_hz
        elif self._given_hz is not None and rate_hz is not None and abs(rate_hz / self._given_hz - 1) > TOLERANCE:
            raise RateError(
                f"the sensor counts {rate_hz:.0f} times a second, not {self._given_hz:g}: leave --ft-rate out, or "
                f"give {rate_hz:.0f}"
            )
        if rate_hz is None:
            return arrived_s
        return self._hull.earliest(1 / rate_hz) + self._count / rate_hz


class _Hull:
    """Lower convex hull of (count, arrival), of points that come in nearly the order of their counts."""

    def __init__(self) -> None:
        self._counts: list[int] = []
        self._times: list[float] = []

    @property
    def span_s(self) -> float:
        return self._times[-1] - self._times[0] if self._times else 0.0

    @property
    def slope(self) -> float | None:
        """Seconds a count, of the edge below the middle."""
        if len(self._counts) < 2:
            return None
        right = bisect_left(self._counts, (self._counts[0] + self._counts[-1]) / 2)
        return (self._times[right] - self._times[right - 1]) / (self._counts[right] - self._counts[right - 1])

    def add(self, count: int, time_s: float) -> None:
        if self._counts and count <= self._counts[-1]:
            return  # out of order: it waited longer than one that is in
        x, y = self._counts, self._times
        while len(x) >= 2 and (y[-1] - y[-2]) * (count - x[-1]) >= (time_s - y[-1]) * (x[-1] - x[-2]):
            x.pop()
            y.pop()
        x.append(count)
        y.append(time_s)

    def earliest(self, slope: float) -> float:
        """Arrival that the count 0 would have had on the lowest line of a slope."""
        return float(np.min(np.array(self._times) - slope * np.array(self._counts)))
