"""How a cap is doing: rate, delay, drops, faults, dots, drift; over the last seconds and since the start."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from sensing.live.reading import CapReading
from sensing.sources.newest import Health

WINDOW = 600  # readings looked back on
RATE_S = 2.0


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


@dataclass
class CapStats:
    """Collects for one cap; written by one thread."""

    cap: str
    frames: int = 0
    last: CapReading | None = None
    _latency_ms: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _ready_s: deque[float] = field(default_factory=lambda: deque(maxlen=WINDOW))
    _stages: deque[dict[str, float]] = field(default_factory=lambda: deque(maxlen=WINDOW))

    def add(self, reading: CapReading) -> None:
        """Take one reading."""
        self.frames += 1
        self.last = reading
        self._latency_ms.append(reading.latency_ms)
        self._ready_s.append(reading.ready_s)
        self._stages.append(dict(reading.stage_ms))

    def health(self, source: Health, message: str, faults: int) -> CapHealth:
        """State now, from this and from what source and pipeline say."""
        now, last = time.monotonic(), self.last
        latency, stages = list(self._latency_ms), list(self._stages)
        recent = [t for t in list(self._ready_s) if now - t < RATE_S]
        dots = (0, 0) if last is None else last.dots
        names = dict.fromkeys(name for stage in stages[-60:] for name in stage)
        medians = {name: float(np.median([s[name] for s in stages if name in s])) for name in names}
        return CapHealth(
            cap=self.cap,
            status="zeroing" if message.startswith("zeroing") else source.status,
            message=source.message or message,
            frames=self.frames,
            dropped=source.dropped,
            faults=faults + source.corrupt,
            rate_hz=len(recent) / RATE_S,
            age_s=float("nan") if last is None else now - last.captured_s,
            p50_ms=float(np.median(latency)) if latency else float("nan"),
            p99_ms=float(np.percentile(latency, 99)) if latency else float("nan"),
            work_ms=float(np.median([sum(s.values()) for s in stages])) if stages else float("nan"),
            stage_ms=medians,
            dots=dots[0],
            dots_known=dots[1],
            drift="" if last is None or last.drift is None else last.drift.cause,
            reopened=source.reopened,
        )
