"""How a cap is doing: rate, delay, drops, faults, dots, drift; over the last seconds and since the start."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median

from sensing.live.reading import CapReading
from sensing.sources.newest import Health

WINDOW = 600  # readings looked back on
RATE_S = 2.0
STAGES = 60  # readings whose stages are looked at
HOLD_S = 0.5  # times are looked up anew this often


@dataclass(frozen=True)
class CapHealth:
    """State of one cap at one moment.

    Attributes:
        cap: name. status: of the source, or ``zeroing``. message: what is wrong; empty when nothing is.
        frames: readings so far. dropped: frames nobody took in time. faults: frames that could not be used.
        rate_hz: readings a second. age_s: since the capture of the last one.
        p50_ms, p99_ms: from capture to wrench. work_ms: median time spent on a frame. stage_ms: median of each stage.
        dots, dots_known: followed and known. drift: its cause. reopened: times the source came back.
    """

    cap: str
    status: str
    message: str
    frames: int
    dropped: int
    faults: int
    rate_hz: float
    age_s: float
    p50_ms: float
    p99_ms: float
    work_ms: float
    stage_ms: dict[str, float]
    dots: int
    dots_known: int
    drift: str
    reopened: int


@dataclass(frozen=True)
class _Timing:
    """Figures over the last readings; costly, so looked up anew only now and then."""

    until_s: float
    p50_ms: float = float("nan")
    p99_ms: float = float("nan")
    work_ms: float = float("nan")
    stage_ms: dict[str, float] = field(default_factory=dict)


class CapStats:
    """Collects for one cap; written by one thread."""

    def __init__(self, cap: str) -> None:
        self.cap = cap
        self.frames = 0
        self.last: CapReading | None = None
        self._latency_ms: deque[float] = deque(maxlen=WINDOW)
        self._ready_s: deque[float] = deque(maxlen=WINDOW)
        self._stages: deque[Mapping[str, float]] = deque(maxlen=STAGES)
        self._timing = _Timing(0.0)

    def add(self, reading: CapReading) -> None:
        """Take one reading."""
        self.frames += 1
        self.last = reading
        self._latency_ms.append(reading.latency_ms)
        self._ready_s.append(reading.ready_s)
        self._stages.append(reading.stage_ms)

    def health(self, source: Health, message: str, faults: int, fresh: bool = False) -> CapHealth:
        """State now, from this and from what source and pipeline say.

        Args:
            source, message, faults: of source and pipeline. fresh: times of this moment, not of half a second ago.
        """
        now, last = time.monotonic(), self.last
        if fresh or now > self._timing.until_s:
            self._timing = self._look(now)
        timing, ready = self._timing, list(self._ready_s)
        dots = (0, 0) if last is None else last.dots
        return CapHealth(
            cap=self.cap,
            status="zeroing" if message.startswith("zeroing") else source.status,
            message=source.message or message,
            frames=self.frames,
            dropped=source.dropped,
            faults=faults + source.corrupt,
            rate_hz=(len(ready) - bisect_left(ready, now - RATE_S)) / RATE_S,
            age_s=float("nan") if last is None else now - last.captured_s,
            p50_ms=timing.p50_ms,
            p99_ms=timing.p99_ms,
            work_ms=timing.work_ms,
            stage_ms=timing.stage_ms,
            dots=dots[0],
            dots_known=dots[1],
            drift="" if last is None or last.drift is None else last.drift.cause,
            reopened=source.reopened,
        )

    def _look(self, now: float) -> _Timing:
        latency, stages = list(self._latency_ms), list(self._stages)
        if not stages:
            return _Timing(now + HOLD_S)
        names = dict.fromkeys(name for stage in stages for name in stage)
        medians = {name: median(s[name] for s in stages if name in s) for name in names}
        ordered = sorted(latency)
        last = ordered[min(len(ordered) - 1, round(0.99 * len(ordered)))]
        work = median(sum(s.values()) for s in stages)
        return _Timing(now + HOLD_S, median(ordered), last, work, medians)
