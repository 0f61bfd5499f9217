"""Where an endcap's frames come from while it runs: a camera whose newest frame wins, or a file that loses none.

``take`` never waits. A frame comes with its capture time on this run's clock (``time.monotonic``): a camera's own, or,
for a file, the moment at which it is due when played at its own pace.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

from cad.errors import EndcapError, ParameterError
from sensing.records import Frame
from sensing.sources.newest import FrameSource, Health, LiveSource

ROOM = 4  # frames that a file may be ahead
SPEEDS = (0.0, 1000.0)


class Captured(NamedTuple):
    """A frame and its capture time on this run's clock (``time.monotonic``), s."""

    frame: Frame
    captured_s: float


class Feed(Protocol):
    """Interface through which the engine takes frames."""

    @property
    def health(self) -> Health:
        """How the source is doing."""
        ...

    @property
    def ended(self) -> bool:
        """Whether no frame will come any more."""
        ...

    def start(self, notify: Callable[[], None]) -> None:
        """Begin; ``notify`` is called from another thread whenever there may be something to take."""
        ...

    def take(self) -> Captured | None:
        """The next frame if there is one now."""
        ...

    def stop(self) -> None:
        """Ask its thread to end; does not wait."""
        ...

    def close(self, wait_s: float = 2.0) -> None:
        """Stop, and wait at most so long."""
        ...


class CameraFeed:
    """A source that is kept open; frames that nobody takes in time are dropped.

    Args:
        open_source: opens it anew.
        length: frames kept; 1 for the least delay.
    """

    def __init__(self, open_source: Callable[[], FrameSource], length: int = 1) -> None:
        self._open, self._length = open_source, length
        self._live: LiveSource | None = None

    @property
    def health(self) -> Health:
        """How the source is doing."""
        return Health() if self._live is None else self._live.health

    @property
    def ended(self) -> bool:
        """A camera may always come back."""
        return False

    def start(self, notify: Callable[[], None]) -> None:
        """Open the camera in a thread."""
        self._live = LiveSource(self._open, length=self._length, notify=notify)
        self._live.__enter__()

    def take(self) -> Captured | None:
        """The oldest frame kept."""
        frame = None if self._live is None else self._live.get(0)
        return None if frame is None else Captured(frame, frame.time_s)

    def stop(self) -> None:
        """Ask its thread to end; does not wait."""
        if self._live is not None:
            self._live.stop()

    def close(self, wait_s: float = 2.0) -> None:
        """Release the camera; a driver that hangs is abandoned after ``wait_s``."""
        if self._live is not None:
            self._live.close(wait_s)


def require_speed(speed: float) -> None:
    """Refuse a speed outside :data:`SPEEDS`.

    Raises:
        ParameterError: it is.
    """
    if not SPEEDS[0] <= speed <= SPEEDS[1]:
        raise ParameterError(f"speed={speed:g} outside 0..{SPEEDS[1]:g}: 1 is the file's own pace", name="speed")


class Pace:
    """When a recorded moment is due on this run's clock.

    Args:
        speed: 1 is the recording's own pace, 2 twice as fast, 0 at once.
    """

    def __init__(self, speed: float = 1.0) -> None:
        require_speed(speed)
        self._speed = speed
        self._begin: tuple[float, float] | None = None

    def due_s(self, time_s: float) -> float:
        """Due time, s, on this run's clock; the first moment is due now."""
        now_s = time.monotonic()
        if self._speed == 0:
            return now_s
        self._begin = self._begin or (now_s, time_s)
        return self._begin[0] + (time_s - self._begin[1]) / self._speed


class FileFeed:
    """A source that ends; it waits for a slow reader.

    Args:
        open_source: opens it.
        pace: that it is played at; None for its own.
    """

    def __init__(self, open_source: Callable[[], FrameSource], pace: Pace | None = None) -> None:
        self._open, self._pace = open_source, pace or Pace()
        self._ready: queue.Queue[Any] = queue.Queue(ROOM)  # of what :meth:`take` gives, or makes it from
        self._stop = threading.Event()
        self._health = Health()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._notify: Callable[[], None] = lambda: None

    @property
    def health(self) -> Health:
        """How the source is doing."""
        return self._health

    @property
    def ended(self) -> bool:
        """Whether the last frame has been taken."""
        return self._health.status == "ended" and self._ready.empty()

    @property
    def damage(self) -> str:
        """Part of the file that could not be read, one line; empty where there is none, and until its end."""
        return self._health.message if self._health.status == "ended" else ""

    def start(self, notify: Callable[[], None]) -> None:
        """Begin to read."""
        self._notify = notify
        self._thread.start()

    def first(self) -> Frame | None:
        """The first picture, read apart from those that are taken; None where there is none."""
        return next(iter(self._open()), None)

    def take(self) -> Captured | None:
        """The next frame that is due."""
        return self._next()

    def stop(self) -> None:
        """Ask its thread to end; does not wait."""
        self._stop.set()

    def close(self, wait_s: float = 2.0) -> None:
        """Stop reading."""
        self.stop()
        if self._thread.is_alive():
            self._thread.join(wait_s)

    def _run(self) -> None:
        message = ""
        try:
            message = self._pump()
        except EndcapError as error:
            message = str(error)
        except Exception as error:  # a broken file must not hide behind a dead thread
            message = f"{type(error).__name__}: {error}"
        self._health = replace(self._health, status="ended", message=message)
        self._notify()

    def _pump(self) -> str:
        """Queue all frames; returns the source's note at its end, one line, or ""."""
        source = self._open()
        for frame in source:
            due_s = self._pace.due_s(frame.time_s)
            if self._stop.wait(max(0.0, due_s - time.monotonic())) or not self._put(Captured(frame, due_s)):
                return ""
            self._running()
        return str(getattr(source, "note", ""))

    def _running(self) -> None:
        """One frame more lies ready."""
        self._health = replace(self._health, status="running", frames=self._health.frames + 1)
        self._notify()

    def _next(self) -> Any:
        """The oldest of what lies ready; None where nothing does."""
        try:
            return self._ready.get_nowait()
        except queue.Empty:
            return None

    def _put(self, item: Any, is_wanted: Callable[[], bool] = lambda: True) -> bool:
        """Wait for room and lay an item ready; False where it is no longer wanted."""
        while not self._stop.is_set() and is_wanted():
            try:
                self._ready.put(item, timeout=0.1)
                return True
            except queue.Full:
                self._notify()
        return False
