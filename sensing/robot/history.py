"""Samples in the order of their capture, and kept states from which the filter restarts for a late one.

A state depends on the samples before its time alone: neither on the order of their arrival nor on the number of
queries. A late sample takes the filter back to a kept state before it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection
from typing import Generic, Protocol, Self, TypeVar, cast

from sensing.robot.inertial import SLOWEST_S
from sensing.robot.settings import KnownContact
from sensing.tensegrity.samples import FootSample, InertialSample, LengthSample

AnySample = InertialSample | LengthSample | FootSample | KnownContact
Key = tuple[float, int, str]  # time, kind, name: the order in which samples are taken
KEEP_EVERY_S = 0.025  # time between kept states


class Copied(Protocol):
    """An object that can be copied."""

    def copy(self) -> Self:
        """An independent copy."""
        ...


T = TypeVar("T", bound=Copied)


def key_of(sample: AnySample) -> Key:
    """Position of a sample in the order."""
    match sample:
        case InertialSample():
            return sample.time_s, 0, sample.sensor
        case LengthSample():
            return sample.time_s, 1, ""
        case KnownContact():
            return sample.time_s, 2, sample.endcap
    return sample.time_s, 3, sample.endcap


class History(Generic[T]):
    """Recent samples and states.

    Args:
        first: state before any sample.
        take: function that moves a state, in place, by the samples of one time.
        length_s: largest age of a sample that is accepted, s.
    """

    def __init__(self, first: T, take: Callable[[T, float, list[AnySample]], None], length_s: float) -> None:
        self._take, self._length_s = take, length_s
        self._keys: list[Key] = []
        self._samples: list[AnySample] = []
        self._kept: list[tuple[float, T]] = [(float("-inf"), first)]
        self.newest_s = float("-inf")

    def put(self, sample: AnySample) -> bool:
        """Add a sample; False if it is too late or a duplicate."""
        key = key_of(sample)
        if key[0] < self.newest_s - self._length_s or key[0] <= self._kept[0][0]:
            return False
        at = bisect_left(self._keys, key)
        if at < len(self._keys) and self._keys[at] == key:
            return False
        self._keys.insert(at, key)
        self._samples.insert(at, sample)
        before_s = self._before(at, sample)
        while len(self._kept) > 1 and (self._kept[-1][0] >= key[0] or self._kept[-1][0] > before_s):
            self._kept.pop()
        if key[0] > self.newest_s:
            self.newest_s = key[0]
            self._forget()
        return True

    def coming(self, time_s: float, sensors: Collection[str]) -> list[InertialSample]:
        """The first inertial sample after a time of each sensor, if it is in time to be a mean over that time.

        Args:
            time_s: the time, s.
            sensors: names of the sensors.
        """
        found: dict[str, InertialSample] = {}
        for place in range(bisect_right(self._keys, (time_s, 9, "")), len(self._keys)):
            after_s, kind, name = self._keys[place]
            if len(found) == len(sensors) or after_s > time_s + SLOWEST_S:
                break
            if kind == 0 and name in sensors and name not in found:
                found[name] = cast(InertialSample, self._samples[place])
        return list(found.values())

    def _before(self, at: int, sample: AnySample) -> float:
        """Time of the sample before an inertial one of the same sensor, s: states after it lacked its mean."""
        if isinstance(sample, InertialSample):
            for place in range(at - 1, -1, -1):
                before_s, kind, name = self._keys[place]
                if before_s < sample.time_s - SLOWEST_S:
                    break
                if kind == 0 and name == sample.sensor:
                    return before_s
        return sample.time_s

    def at(self, time_s: float) -> T:
        """The state of the last sample at or before a time; callers copy it before they change it."""
        place = bisect_right(self._kept, time_s, key=lambda kept: kept[0]) - 1
        kept_s, state = self._kept[max(place, 0)]
        start = bisect_right(self._keys, (kept_s, 9, ""))
        stop = bisect_right(self._keys, (time_s, 9, ""))
        if start < stop:
            state = state.copy()
        while start < stop:
            now = self._keys[start][0]
            end = bisect_right(self._keys, (now, 9, ""), lo=start)
            self._take(state, now, self._samples[start:end])
            start = end
            if now >= self._kept[-1][0] + KEEP_EVERY_S:
                self._kept.append((now, state))
                state = state.copy()
        return state

    def _forget(self) -> None:
        """Drop samples and states that no sample which may still come can need."""
        oldest = self.newest_s - self._length_s
        if self._kept[-1][0] < oldest - KEEP_EVERY_S:
            self.at(oldest)
        place = bisect_right(self._kept, oldest, key=lambda kept: kept[0]) - 1
        if place > 0 and self._kept[0][0] < oldest - self._length_s:
            del self._kept[:place]
            drop = bisect_right(self._keys, (self._kept[0][0], 9, ""))
            del self._keys[:drop], self._samples[:drop]
