"""Pairs frames with a force/torque stream by capture time: both neighbours within a slop, interpolated between them.

Times are seconds of one monotonic clock. A clock that jumps would pair pictures with the wrong forces without a sign,
so it is refused: times that go backwards, or that leap forward. Samples that were lost while nobody read the stream
leave a gap that is no jump.

Notes:
    Approximate synchronisation as robots know it, with a slop of 50 ms (P, NET23: labels synchronised
    within 50 ms); between the two samples around the frame the wrench is interpolated, so that the error is that of a
    straight line over the sensor's own step rather than the slop.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError, ParameterError
from sensing.recording.ft_streams import FtSample

SLOP_S = 0.05  # P, NET23
LEAP_S, FRAME_LEAP_S = 1.0, 10.0  # between samples, and frames, that follow one another: no stream pauses so long


class ClockError(EndcapError):
    """A clock that jumped."""


class Synchroniser:
    """Samples in as they arrive, wrenches at capture times out.

    Args:
        slop_s: farthest that a sample may be from the frame, on either side.

    Raises:
        ParameterError: a slop outside 1 ms..1 s.
    """

    def __init__(self, slop_s: float = SLOP_S) -> None:
        if not 1e-3 <= slop_s <= 1.0:
            raise ParameterError(f"slop_s={slop_s:g} outside 0.001..1 s: 0.05 is usual", name="slop_s", value=slop_s)
        self.slop_s = slop_s
        self._times: list[float] = []
        self._wrenches: list[NDArray[np.float64]] = []
        self._frame_s: float | None = None

    def add(self, sample: FtSample, unread_s: float = 0.0) -> None:
        """Take a sample; one of equal time replaces the last.

        Args:
            sample: the next that came.
            unread_s: for so long nobody read the stream, which keeps only some of what comes meanwhile.

        Raises:
            ClockError: earlier than the last by more than the slop, later by over ``unread_s`` and a second, or not
                finite.
        """
        last = self._times[-1] if self._times else None
        _require_going_on("force/torque sample", sample.time_s, last, self.slop_s, LEAP_S + unread_s)
        if last is not None and sample.time_s <= last:
            place = bisect_left(self._times, sample.time_s)  # out of order within the slop: UDP does that
            if place < len(self._times) and self._times[place] == sample.time_s:
                self._wrenches[place] = sample.wrench
                return
            self._times.insert(place, sample.time_s)
            self._wrenches.insert(place, sample.wrench)
            return
        self._times.append(sample.time_s)
        self._wrenches.append(sample.wrench)

    def covers(self, time_s: float) -> bool:
        """Whether samples after that time have arrived, so that waiting longer changes nothing."""
        return bool(self._times) and self._times[-1] >= time_s

    def at(self, time_s: float) -> NDArray[np.float64] | None:
        """(6,) wrench at a frame's capture time, or None where no sample is near enough on one of its sides.

        Raises:
            ClockError: a frame earlier than the last one, or later by over ten seconds.
        """
        _require_going_on("frame", time_s, self._frame_s, 0.0, FRAME_LEAP_S)
        self._frame_s = time_s
        right = bisect_left(self._times, time_s)
        left = bisect_right(self._times, time_s) - 1
        if left < 0 or right >= len(self._times):
            return None
        del self._times[:left], self._wrenches[:left]  # frames come in order: earlier samples are not needed again
        left, right = 0, right - left
        before, after = self._times[left], self._times[right]
        if time_s - before > self.slop_s or after - time_s > self.slop_s:
            return None
        share = 0.0 if after == before else (time_s - before) / (after - before)
        return (1 - share) * self._wrenches[left] + share * self._wrenches[right]


def _require_going_on(what: str, time_s: float, last: float | None, backwards_s: float, leap_s: float) -> None:
    """Refuse a clock that gives no number, or steps back or forward by more than it may."""
    if not np.isfinite(time_s):
        raise ClockError(f"{what} at {time_s} s: its clock gives no number")
    if last is not None and not -backwards_s <= time_s - last <= leap_s:
        raise ClockError(
            f"{what} at {time_s:.3f} s follows one at {last:.3f} s: its clock jumped by {time_s - last:+.3f} s (at "
            f"most {leap_s:g} s forward); what is written stays, start again to go on"
        )
