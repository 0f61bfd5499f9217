"""How an endcap is doing: rate, delay, drops, faults, dots, drift; over the last seconds and since the start."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sensing.live.core.reading import EndcapReading
from sensing.live.core.state import Condition
from sensing.sources.newest import Health

WINDOW = 600  # readings looked back on
RATE_S = 2.0
DROPS_S = 5.0  # looked back on for the share of frames that is dropped
STAGES = 60  # readings whose stages are looked at
HOLD_S = 0.5  # times are looked up anew this often


@dataclass(frozen=True)
class EndcapHealth:
    """State of one endcap at one moment.

    Attributes:
        endcap: name.
        status: word of the state.
        valid: whether its numbers count now.
        level: 0 good, 1 look at it, 2 bad.
        message: what is wrong; empty when nothing is.
        frames: readings so far.
        dropped: frames nobody took in time.
        dropped_share: of the frames of the last seconds.
        faults: frames that could not be used.
        rate_hz: readings a second.
        age_s: since the capture of the last one.
        p50_ms, p99_ms: from capture to wrench.
        stage_ms: median of each stage.
        dots, dots_known: followed and known.
        drift: its cause.
        reopened: times the source came back.
        zeroed: when the reference was taken (ISO, UTC); empty without one.
        confirmable: the last request for one was refused because of a press.
        undoable: whether there is an earlier one.
    """

    endcap: str
    status: str
    valid: bool
    level: int
    message: str
    frames: int
    dropped: int
    dropped_share: float
    faults: int
    rate_hz: float
    age_s: float
    p50_ms: float
    p99_ms: float
    stage_ms: dict[str, float]
    dots: int
    dots_known: int
    drift: str
    reopened: int
    zeroed: str
    confirmable: bool
    undoable: bool


@dataclass(frozen=True)
class _Timing:
    """Figures over the last readings; costly, so looked up anew only now and then."""

    until_s: float
    p50_ms: float = float("nan")
    p99_ms: float = float("nan")
    stage_ms: dict[str, float] = field(default_factory=dict)
    dropped_share: float = 0.0


class EndcapStats:
    """Collects for one endcap; written by one thread."""

    def __init__(self, endcap: str) -> None:
        self.endcap = endcap
        self.frames = 0
        self.last: EndcapReading | None = None
        self._latency_ms = np.full(WINDOW, np.nan)  # rings: row frames % length
        self._ready_s = np.full(WINDOW, -np.inf)
        self._stages: deque[Mapping[str, float]] = deque(maxlen=STAGES)
        self._timing = _Timing(0.0)
        self._counts: deque[tuple[float, int, int]] = deque()  # time, readings and drops so far

    def add(self, reading: EndcapReading) -> None:
        """Take one reading."""
        row = self.frames % WINDOW
        self._latency_ms[row], self._ready_s[row] = reading.latency_ms, reading.ready_s
        self._stages.append(reading.stage_ms)
        self.frames += 1
        self.last = reading

    def health(
        self,
        source: Health,
        condition: Condition,
        faults: int,
        zeroed: str = "",
        confirmable: bool = False,
        undoable: bool = False,
        fresh: bool = False,
    ) -> EndcapHealth:
        """State now, from these statistics and the states of source, machine and pipeline.

        Args:
            source, condition, faults, zeroed, confirmable, undoable: of source, machine and pipeline.
            fresh: times of this moment, not of half a second ago.
        """
        now, last = time.monotonic(), self.last
        if fresh or now > self._timing.until_s:
            self._timing = self._look(now, source.dropped)
        timing = self._timing
        dots = (0, 0) if last is None else last.dots
        return EndcapHealth(
            endcap=self.endcap,
            status=condition.state.value,
            valid=condition.valid,
            level=condition.level,
            message=condition.message,
            frames=self.frames,
            dropped=source.dropped,
            dropped_share=timing.dropped_share,
            faults=faults,
            rate_hz=float(np.count_nonzero(self._ready_s > now - RATE_S) / RATE_S),
            age_s=float("nan") if last is None else now - last.captured_s,
            p50_ms=timing.p50_ms,
            p99_ms=timing.p99_ms,
            stage_ms=timing.stage_ms,
            dots=dots[0],
            dots_known=dots[1],
            drift="" if last is None else _drift(last),
            reopened=source.reopened,
            zeroed=zeroed,
            confirmable=confirmable,
            undoable=undoable,
        )

    def _look(self, now: float, dropped: int) -> _Timing:
        share = self._dropped_share(now, dropped)
        latency, stages = np.sort(self._latency_ms[: self.frames]), list(self._stages)
        if not stages or not latency.size:  # none yet, or the first is just being added
            return _Timing(now + HOLD_S, dropped_share=share)
        names = dict.fromkeys(name for stage in stages for name in stage)
        times = np.array([[stage.get(name, np.nan) for name in names] for stage in stages])
        medians = dict(zip(names, _medians(times).tolist(), strict=True))
        last = latency[min(len(latency) - 1, round(0.99 * len(latency)))]
        return _Timing(now + HOLD_S, float(_medians(latency[:, None])[0]), float(last), medians, share)

    def _dropped_share(self, now: float, dropped: int) -> float:
        """Share of the frames of the last :data:`DROPS_S` that nobody took in time."""
        self._counts.append((now, self.frames, dropped))
        while self._counts[0][0] < now - DROPS_S:
            self._counts.popleft()
        _, frames_before, dropped_before = self._counts[0]
        lost = dropped - dropped_before
        return lost / max(1, lost + self.frames - frames_before)


def _drift(reading: EndcapReading) -> str:
    """Cause of the drift since the reference; a sag under the own weight does not count as a touch."""
    if reading.drift is None:
        return ""
    cause: str = reading.drift.cause
    sags = bool(np.nan_to_num(reading.own_weight_g).any()) and cause == "contact" and not reading.contact.touching
    return "turned; own weight taken out" if sags else cause


def _medians(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of every column; NaN counts as absent (numpy's own takes ten times as long for so few)."""
    ordered, count = np.sort(rows, axis=0), np.count_nonzero(~np.isnan(rows), axis=0)
    columns = np.arange(rows.shape[1])
    return (ordered[(count - 1) // 2, columns] + ordered[count // 2, columns]) / 2
