"""One endcap in a few lines of Python.

    from sensing.live.endcap import open_endcap

    with open_endcap("0") as endcap:                     # camera 0, zeroed at the start; "scene:0" without a camera
        for wrench in endcap.stream():
            print(wrench.time_s, wrench.force_n, endcap.touching)

Forces in N, torques in N m on the endcap at the origin of its frame, times on the monotonic clock.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from cad.errors import ParameterError
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG
from cad.pattern import RELEASED_DOT_MM
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.core.model import LiveModel
from sensing.live.core.reading import EndcapReading, predicted
from sensing.live.core.sink import QueuedSink
from sensing.live.core.stats import EndcapHealth
from sensing.live.core.warm_up import warm_up
from sensing.live.open_endcaps import open_endcaps
from sensing.records import Wrench
from sensing.tracking.zero import ZeroError

ROOM = 64  # readings that a slow reader may be behind before the oldest are lost


class Endcap:
    """A running endcap; use as a context manager.

    Args:
        endcap: with its source, not yet started.
    """

    def __init__(self, endcap: LiveEndcap) -> None:
        self._endcap, self._live = endcap, isinstance(endcap.feed, CameraFeed)
        self._readings = _Readings()
        self._engine = Engine([endcap], [self._readings])
        self._entered = False

    def __enter__(self) -> Endcap:
        if self._entered:
            raise ParameterError(f"{self._endcap.name} has run already: open it again", name="endcap")
        self._entered = True
        self._engine.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the camera and end all streams."""
        self._readings.close()  # first: a file may wait for its reader
        self._engine.close()

    def readings(self) -> Iterator[EndcapReading]:
        """Everything that each frame gives, in order, until the source ends or the endcap is closed.

        A file waits for whoever reads; of a camera the oldest of more than 64 that wait are lost.

        Raises:
            ParameterError: it was never started.
        """
        return (reading for reading in self._taken() if reading is not None)

    def _taken(self) -> Iterator[EndcapReading | None]:
        """The readings, and None while none comes."""
        if not self._entered:
            raise ParameterError(f"{self._endcap.name} does not run: use it as `with ... as endcap:`", name="endcap")
        self._readings.wait_for_reader(not self._live)
        try:
            while True:
                reading = self._readings.take(0.1)
                if reading is not None:
                    yield reading
                elif self._readings.closed or self._engine.wait(0.0):
                    while (reading := self._readings.take(0.0)) is not None:  # what came in between
                        yield reading
                    return
                else:
                    yield None
        finally:
            self._readings.wait_for_reader(False)

    def stream(self) -> Iterator[Wrench]:
        """Filtered wrenches, one a frame; of a camera the newest alone where the reader is slower.

        A frame that gives no number (the lamp is off, say) gives NaN and the reason among the wrench's flags. A camera
        that gives no frame any more (unplugged, silent) gives NaN once, its state among the flags.
        """
        said = not self._live  # a file that has ended holds its last numbers
        for reading in self._taken():
            if reading is None:
                if not said and self._endcap.stats.last is not None and not self.health.valid:
                    said = True
                    yield self.now()
            elif not (self._live and self._readings.waiting):
                said = not self._live
                yield reading.wrench

    def now(self) -> Wrench:
        """The newest wrench, predicted to this moment where its motion can be followed, held where it cannot.

        NaN, the state among its flags, while the endcap's numbers do not count: a camera that is silent or unplugged
        leaves nothing to hold.

        Raises:
            ParameterError: no frame has given a reading yet.
        """
        last = self._endcap.stats.last
        if last is None:
            raise ParameterError("no reading yet: wait for the first of stream() or readings()", name="now")
        health, wrench = self.health, predicted(last, time.monotonic())
        if health.valid:
            return wrench
        nothing = np.full(3, np.nan)
        return replace(
            wrench, force_n=nothing, torque_nm=nothing, covariance=np.full((6, 6), np.nan),
            flags=wrench.flags | {health.status},
        )  # fmt: skip

    def zero(self, confirmed: bool = False) -> None:
        """Take a new reference from the next frames: it must be untouched.

        Args:
            confirmed: take it although it is touched, or looks pressed.

        Raises:
            ZeroError: it is touched, or its camera is gone. A reference that looks pressed later, or whose camera goes
                meanwhile, is refused in ``health.message``.
        """
        refusal = self._endcap.zero(confirmed)
        if refusal:
            raise ZeroError(refusal)

    def undo_zero(self) -> None:
        """Go back to the reference before.

        Raises:
            ZeroError: there is none.
        """
        refusal = self._endcap.pipeline.request_undo()
        if refusal:
            raise ZeroError(refusal)

    @property
    def valid(self) -> bool:
        """Whether its numbers count now; ``health`` has the reason where they do not."""
        return self.health.valid

    @property
    def touching(self) -> bool | None:
        """Whether the last frame shows contact; None while that is not known."""
        last = self._endcap.stats.last
        return last.contact.touching if last is not None and last.contact.known and self.valid else None

    @property
    def health(self) -> EndcapHealth:
        """Rate, delay, dropped frames and faults."""
        return self._endcap.health


def open_endcap(
    source: str = "scene:0",
    zero: Path | str | None = None,
    *,
    diameter_mm: float = 130.0,
    wall_mm: float = 8.0,
    silicone: str = DEFAULT_SILICONE,
    dots: str = "",
    dot_mm: float = RELEASED_DOT_MM,
    rate_hz: float = 0.0,
    model: LiveModel | None = None,
) -> Endcap:
    """An endcap by the word for its source.

    Args:
        source: camera number, http address, video, folder of pictures, or ``scene:0`` to ``scene:5``.
        zero: reference file; None to take the first frames (for a file: the first picture).
        diameter_mm, wall_mm, dots, dot_mm: the design (:class:`sensing.live.core.endcap_config.EndcapConfig`).
        silicone: row of cad/materials.csv that it is cast of.
        rate_hz: frames a second asked of a camera, 0 for 30; pictures a second of a folder, 0 for one.
        model: what estimates the wrench; None for the one that ships.

    Raises:
        EndcapError: a source, file or design that cannot be used.
    """
    taken = None if zero is None else Path(zero)
    endcap = EndcapConfig(
        "endcap_0", source, taken, diameter_mm, wall_mm, rate_hz=rate_hz, silicone=silicone, dots=dots, dot_mm=dot_mm
    )
    models = None if model is None else lambda _: model
    opened = Endcap(open_endcaps(LiveConfig((endcap,)), models=models)[0])
    warm_up(LOG.info)
    return opened


class _Readings(QueuedSink):
    """A queue without a thread of its own: its iterator takes the readings."""

    def __init__(self) -> None:
        super().__init__(ROOM)
        self._waits = False

    def put(self, reading: EndcapReading) -> None:
        with self._changed:
            self._changed.wait_for(lambda: not (self._waits and self._full) or self._closing)
        super().put(reading)

    def wait_for_reader(self, waits: bool) -> None:
        """Whether a full queue waits for the reader instead of losing its oldest."""
        with self._changed:
            self._waits = waits
            self._changed.notify_all()

    @property
    def closed(self) -> bool:
        return self._closing

    @property
    def waiting(self) -> bool:
        """Whether there is a newer reading than the one taken last."""
        return bool(self._queue)

    def take(self, timeout_s: float) -> EndcapReading | None:
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._closing, timeout_s)
            self._changed.notify_all()
            return self._queue.popleft() if self._queue else None
