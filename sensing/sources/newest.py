"""Between a source that runs at its own pace and a reader that may be slower: a short queue where the newest wins.

    NewestQueue     bounded; a full queue drops its oldest frame and counts it
    OnArrival       a thread that takes frames as they come, for a reader that takes all and may pause
    LiveSource      a thread that keeps a source open, and says what is wrong while it is not delivering

Times are seconds of ``time.monotonic``.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from cad.errors import EndcapError
from sensing.records import Frame

START_S = 4.0  # without a first frame for so long, a source counts as silent
WAITING = 64  # frames that wait for a reader that pauses; of more, the oldest are lost
Status = Literal["starting", "running", "silent", "unplugged", "ended"]


class SourceError(EndcapError):
    """A source that cannot be opened or stopped delivering."""


class FrameSource(Protocol):
    """Interface of a source for the thread: an iterator of frames that can be closed."""

    def __iter__(self) -> Iterator[Frame]:
        """Frames until the source ends; raises SourceError when it breaks."""
        ...


@dataclass(frozen=True)
class Health:
    """How a source is doing.

    Attributes:
        status: ``silent``: no whole frame comes; ``unplugged``: it broke and is being opened again.
        frames: frames received, whatever is in them: whoever decodes them judges that.
        dropped: frames that nobody took in time.
        reopened: times the source delivered again after it had broken.
        message: what is wrong, in one line; empty when nothing is.
    """

    status: Status = "starting"
    frames: int = 0
    dropped: int = 0
    reopened: int = 0
    message: str = ""


class NewestQueue:
    """A bounded queue of frames for one reader; putting never waits.

    Args:
        length: frames kept at most; 1 is right for a live view, 2 rides out a hiccup.
    """

    def __init__(self, length: int) -> None:
        self._frames: deque[Frame] = deque(maxlen=length)
        self._changed = threading.Condition()
        self._closed = False
        self.dropped = 0

    def put(self, frame: Frame) -> None:
        """Append a frame; a full queue loses its oldest."""
        with self._changed:
            self.dropped += len(self._frames) == self._frames.maxlen
            self._frames.append(frame)
            self._changed.notify()

    def get(self, timeout_s: float | None = None) -> Frame | None:
        """The oldest frame still kept; None after the timeout, or when closed and empty."""
        if timeout_s == 0 and not self._frames:  # a look costs no lock
            return None
        with self._changed:
            self._changed.wait_for(lambda: self._frames or self._closed, timeout_s)
            return self._frames.popleft() if self._frames else None

    def close(self) -> None:
        """No more frames will come; a waiting reader wakes up."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class OnArrival:
    """Frames that a thread takes as they come: a stamp of arrival is right however late the frame is read.

    Raises what the source raises, when its last frame has been read.

    Args:
        frames: of a camera.
    """

    def __init__(self, frames: Iterator[Frame]) -> None:
        self._frames, self._queue = frames, NewestQueue(WAITING)
        self._error: Exception | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __iter__(self) -> OnArrival:
        return self

    def __next__(self) -> Frame:
        frame = self._queue.get()
        if frame is not None:
            return frame
        raise StopIteration if self._error is None else self._error

    def close(self, wait_s: float = 2.0) -> None:
        """Release the camera; a read that hangs in a driver is abandoned after ``wait_s``."""
        self._stop.set()
        self._thread.join(wait_s)

    def _run(self) -> None:
        try:
            for frame in self._frames:
                if self._stop.is_set():
                    break
                self._queue.put(frame)
        except Exception as error:  # is for the reader
            self._error = error
        getattr(self._frames, "close", lambda: None)()  # generators release their device here
        self._queue.close()


class LiveSource:
    """Reads a source in a thread, reopens it when it breaks, and keeps only the newest frames.

    Use as a context manager. Sequence numbers go on through reopening, so a gap means dropped frames.

    Args:
        open_source: opens the source anew; may raise SourceError, which is retried.
        length: see :class:`NewestQueue`.
        silent_s: no frame for this long is a fault.
        retry_s: pause before opening again.
        notify: called after every frame, and at the end, from the source's thread; must not wait.
    """

    def __init__(
        self,
        open_source: Callable[[], FrameSource],
        length: int = 2,
        silent_s: float = 1.0,
        retry_s: float = 0.5,
        notify: Callable[[], None] = lambda: None,
    ) -> None:
        self._open, self._silent_s, self._retry_s, self._notify = open_source, silent_s, retry_s, notify
        self._queue = NewestQueue(length)
        self._health = Health()
        self._begin_s = self._last_s = time.monotonic()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> LiveSource:
        self._begin_s = time.monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def stop(self) -> None:
        """Ask the thread to end; does not wait."""
        self._stop.set()
        self._queue.close()

    def close(self, wait_s: float = 2.0) -> None:
        """Stop the thread; a read that hangs in a driver is left behind after ``wait_s`` (the thread is a daemon)."""
        self.stop()
        if self._thread.is_alive():
            self._thread.join(wait_s)

    def get(self, timeout_s: float | None = None) -> Frame | None:
        """The next frame, None after the timeout or at the end."""
        return self._queue.get(timeout_s)

    @property
    def health(self) -> Health:
        """State now; silence is measured by the clock, even while the driver hangs."""
        health, now = replace(self._health, dropped=self._queue.dropped), time.monotonic()
        if health.status == "starting" and now - self._begin_s > START_S:
            message = f"no whole picture in {now - self._begin_s:.0f} s: is the stream slow or cut, the camera busy?"
            return replace(health, status="silent", message=message)
        if health.status == "running" and now - self._last_s > self._silent_s:
            return replace(health, status="silent", message=f"no frame for {now - self._last_s:.1f} s: check the cable")
        return health

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                frames = iter(self._open())
                try:
                    self._pump(frames)
                finally:
                    getattr(frames, "close", lambda: None)()  # generators release their device here
                if self._stop.is_set():
                    break
                self._fault("the source ended")
            except EndcapError as error:
                self._fault(str(error))
            except Exception as error:  # a source must not end the thread: say what happened and open it again
                self._fault(f"{type(error).__name__}: {error}")
            self._stop.wait(self._retry_s)
        self._queue.close()
        self._notify()

    def _fault(self, message: str) -> None:
        self._health = replace(self._health, status="unplugged", message=message)

    def _pump(self, frames: Iterator[Frame]) -> None:
        for frame in frames:
            if self._stop.is_set():
                return
            self._last_s = time.monotonic()
            health, number = self._health, self._health.frames
            again = health.status == "unplugged" and number > 0
            self._health = replace(
                health, status="running", frames=number + 1, reopened=health.reopened + again, message=""
            )
            self._queue.put(frame if frame.sequence == number else replace(frame, sequence=number))
            self._notify()
