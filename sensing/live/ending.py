"""How the program ends: the signals that end it, and a way out that no hung thread can block.

    end_at_once()                        # until there is something to close: leave, without a traceback
    with Stop() as stop:                 # from here on, a signal only requests the end
        ...
        stop.asked.wait(0.2)
    leave(status)

Signals: Ctrl-C (SIGINT), SIGTERM, and SIGHUP (the terminal was closed) unless ``nohup`` had it ignored.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from types import FrameType
from typing import Any, NoReturn

FLUSH_S = 0.25  # an unread pipe must not delay the end
LOST = 1  # exit status: the run ended, but an output is incomplete


def end_at_once() -> None:
    """A signal leaves the process: for the start, when there is nothing to close and libraries are being loaded."""
    for number in _signals():
        signal.signal(number, lambda number, _: os._exit(128 + number))


class Stop:
    """While the context is open, a signal sets :attr:`asked` and does nothing else (main thread only).

    Attributes:
        asked: set by the first signal.
    """

    def __init__(self) -> None:
        self.asked = threading.Event()
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Stop:
        if threading.current_thread() is threading.main_thread():  # only it may catch signals
            self._before = {number: signal.signal(number, self._note) for number in _signals()}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self.asked.set()


def leave(status: int) -> NoReturn:
    """Flush what was printed and end the process.

    Not through the interpreter's own end: a thread that wakes up in a camera's driver while the interpreter is torn
    down aborts the process (status 134).
    """
    threading.Thread(target=_after, args=(FLUSH_S, status), daemon=True).start()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            pass  # its reader has left, which is no loss
        except (OSError, ValueError):
            status = status or LOST
    os._exit(status)


def _after(seconds: float, status: int) -> None:
    threading.Event().wait(seconds)
    os._exit(status)


def _signals() -> list[int]:
    """SIGHUP only where it is not ignored, as ``nohup`` has it."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    with contextlib.suppress(AttributeError):
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            numbers.append(signal.SIGHUP)
    return list(numbers)
