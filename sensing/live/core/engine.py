"""The loop of a run: it takes the newest frame of every endcap, processes it and passes the reading to all outputs.

One thread processes all endcaps, or each of ``workers`` threads some of them; sources and outputs have threads of their
own. An endcap that fails reports the error and continues with its next frame; the others are not affected. An output
that raises is removed.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from cad.errors import EndcapError, ParameterError
from sensing.live.core.feed import Captured, Feed
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.core.sink import Sink, reason_of
from sensing.live.core.state import Event, Machine
from sensing.live.core.stats import EndcapHealth, EndcapStats
from sensing.records import Frame

IDLE_S = 0.1  # longest sleep of the loop, so that a lost wake-up costs no more
SILENT_S = 5.0  # a request for a reference waits for the next frame of a silent camera; slow ones give a frame in it

_SOURCE_EVENTS: dict[str, Event] = {"silent": Event.SILENCE, "unplugged": Event.LOST, "ended": Event.ENDED}


@dataclass
class LiveEndcap:
    """An endcap with its source and its state.

    Attributes:
        feed: frames of its source.
        pipeline: frame to reading.
        stats: rates and times of the last frames.
        machine: state of the endcap.
        frame: the newest one taken, whether or not it gave a reading: shown while there is no reference.
    """

    feed: Feed
    pipeline: EndcapPipeline
    stats: EndcapStats = field(init=False)
    machine: Machine = field(default_factory=Machine, init=False)
    frame: Frame | None = field(default=None, init=False)
    _busy: bool = field(default=False, init=False)
    _taken_s: float = field(default_factory=time.monotonic, init=False)

    def __post_init__(self) -> None:
        self.stats = EndcapStats(self.name)

    @property
    def name(self) -> str:
        """Name of the endcap."""
        return self.pipeline.endcap.name

    @property
    def health(self) -> EndcapHealth:
        """State now."""
        return self.look()

    def look(self, fresh: bool = False) -> EndcapHealth:
        """State now; with ``fresh`` the times are computed anew, which are otherwise up to half a second old."""
        source = self.feed.health
        event = _SOURCE_EVENTS.get(source.status)
        if event is Event.ENDED and (not self.feed.ended or self._busy):  # in this order: a frame being taken is either
            event = None  # the file has been read, but not all of its frames have been worked on
        if event is not None:
            self.machine.happened(event, source.message)
        condition = replace(self.machine.condition, note=self.pipeline.note)
        zero = self.pipeline.zero
        return self.stats.health(
            source, condition, self.pipeline.faults, "" if zero is None else zero.date, self.pipeline.confirmable,
            self.pipeline.undoable, fresh,
        )  # fmt: skip

    def take(self) -> Captured | None:
        """The next frame, or None; a source that fails changes the state."""
        self._busy = True
        item = None
        try:
            item = self.feed.take()
        except Exception as error:  # such as a reference of a recording that cannot be used
            self._failed(error)
        self._busy = item is not None
        if item is not None:
            self._taken_s = time.monotonic()
        elif self.pipeline.taker.collecting and self._gone:
            self.pipeline.refuse_zero_without_frames()
        return item

    def zero(self, confirmed: bool = False) -> str:
        """Take a new reference, unless the camera is gone; returns the reason of a refusal, or "" (any thread).

        Args:
            confirmed: take it although the endcap is touched, or looks pressed.
        """
        return self.pipeline.refuse_zero_without_frames() if self._gone else self.pipeline.request_zero(confirmed)

    @property
    def _gone(self) -> bool:
        """Whether a camera that has given a reference is gone, or has been silent for longer than a slow one is."""
        status = self.feed.health.status
        silent = status == "silent" and time.monotonic() - self._taken_s > SILENT_S
        return self.pipeline.zero is not None and (status == "unplugged" or silent)

    def process(self, item: Captured) -> EndcapReading | None:
        """Process one frame; an error changes the state and gives None."""
        self.frame = item.frame
        reading = None
        try:
            reading = self.pipeline.update(item.frame, item.captured_s)
        except Exception as error:  # a bug in one endcap must not stop the robot's other five
            self._failed(error)
        else:
            if self.pipeline.outcome is not None:
                self.machine.happened(*self.pipeline.outcome)
            if reading is not None:
                self.stats.add(reading)
        self._busy = False
        return reading

    def _failed(self, error: Exception) -> None:
        self.pipeline.faults += 1
        reason = str(error) if isinstance(error, EndcapError) else f"{type(error).__name__}: {error}"
        self.machine.happened(Event.ERROR, reason)


class Engine:
    """All endcaps of a run; use as a context manager.

    Args:
        endcaps: at least one.
        sinks: outputs that take every reading.
        workers: number of threads that process frames.

    Attributes:
        endcaps: as given.
        threads: threads that process frames.
        failures: one line for every output that raised.

    Raises:
        ParameterError: no endcap, or workers outside 1..number of endcaps.
    """

    def __init__(self, endcaps: Sequence[LiveEndcap], sinks: Sequence[Sink] = (), workers: int = 1) -> None:
        if not 1 <= workers <= len(endcaps):
            raise ParameterError(f"workers={workers} outside 1..{len(endcaps)} endcaps", name="workers", value=workers)
        self.endcaps = list(endcaps)
        self.failures: list[str] = []
        self._sinks = tuple((type(sink).__name__, sink) for sink in sinks)
        self._changing = threading.Lock()  # of the outputs: both the page and the loop add and remove some
        self._stop = threading.Event()
        shares = [self.endcaps[k::workers] for k in range(workers)]
        self._wakes = [threading.Event() for _ in shares]
        self.threads = [
            threading.Thread(target=self._work, args=(share, wake), daemon=True)
            for share, wake in zip(shares, self._wakes, strict=True)
        ]

    def __enter__(self) -> Engine:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Open the sources and process their frames."""
        for index, endcap in enumerate(self.endcaps):
            endcap.feed.start(self._wakes[index % len(self._wakes)].set)
        for thread in self.threads:
            thread.start()

    def halt(self, wait_s: float = 5.0) -> None:
        """Stop all threads, and wait at most ``wait_s`` for those that process frames; no reading comes afterwards."""
        self._stop.set()
        for wake in self._wakes:
            wake.set()
        for endcap in self.endcaps:
            endcap.feed.stop()
            endcap.pipeline.stop()
        _join(self.threads, wait_s)

    def close(self, wait_s: float = 5.0) -> None:
        """Halt and release the sources within ``wait_s`` in all; a thread that hangs in a driver is abandoned."""
        end_s = time.monotonic() + wait_s
        self.halt(wait_s)
        for endcap in self.endcaps:
            endcap.feed.close(max(0.0, end_s - time.monotonic()))
            endcap.pipeline.close(max(0.0, end_s - time.monotonic()))

    def add_sink(self, sink: Sink, name: str = "") -> None:
        """Add an output, from the next reading on; ``name`` stands in the line about its failure."""
        with self._changing:
            self._sinks = (*self._sinks, (name or type(sink).__name__, sink))

    def remove_sink(self, sink: Sink) -> None:
        """Remove an output."""
        with self._changing:
            self._sinks = tuple(pair for pair in self._sinks if pair[1] is not sink)

    def sink_failed(self, sink: Sink, error: Exception) -> None:
        """Remove an output that raised, and store the reason; only its first error is kept."""
        with self._changing:
            self.failures += [f"{name}: stopped ({reason_of(error)})" for name, each in self._sinks if each is sink]
            self._sinks = tuple(pair for pair in self._sinks if pair[1] is not sink)

    def wait(self, timeout_s: float) -> bool:
        """True as soon as all sources have ended, False after the timeout."""
        _join(self.threads, timeout_s)
        return not any(thread.is_alive() for thread in self.threads)

    def health(self, fresh: bool = False) -> list[EndcapHealth]:
        """State of every endcap (see :meth:`LiveEndcap.look`)."""
        return [endcap.look(fresh) for endcap in self.endcaps]

    def _work(self, endcaps: list[LiveEndcap], wake: threading.Event) -> None:
        while not self._stop.is_set():
            wake.clear()
            taken = [(item, endcap) for endcap in endcaps if (item := endcap.take()) is not None]
            for item, endcap in sorted(taken, key=lambda pair: pair[0].captured_s):  # the oldest picture first
                reading = endcap.process(item)
                if reading is not None:
                    self._put_out(reading)
            if taken:
                continue
            if all(endcap.feed.ended for endcap in endcaps):
                return
            wake.wait(IDLE_S)

    def _put_out(self, reading: EndcapReading) -> None:
        for _, sink in self._sinks:
            try:
                sink.put(reading)
            except Exception as error:  # an output must not end the loop of six endcaps
                self.sink_failed(sink, error)


def _join(threads: Sequence[threading.Thread], wait_s: float) -> None:
    """Wait for threads, at most ``wait_s`` for all of them."""
    end_s = time.monotonic() + wait_s
    for thread in threads:
        if thread.is_alive():
            thread.join(max(0.0, end_s - time.monotonic()))
