"""Messages of the commands: logger ``endcap``, plain lines on standard error (standard library only).

    LOG.error(...)     reason why a command ends    LOG.warning(...)   condition that the user should check
    LOG.info(...)      progress, one line each      transient(...)     progress on one line of a terminal

Results are not messages: :func:`show` prints them on standard output. ``endcap --quiet ...`` suppresses progress. A
program that uses the toolkit can replace the handler.
"""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

LOG = logging.getLogger("endcap")


class _StandardError(logging.Handler):
    """Handler of lines without a prefix; it looks up the stream each time, because tests and programs replace it."""

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError, ValueError):  # the reader has closed the stream
            print(self.format(record), file=sys.stderr, flush=True)


def set_level(level: int) -> None:
    """Set the least level that is printed: ``logging.WARNING`` for ``--quiet``, else ``logging.INFO``."""
    LOG.setLevel(level)


def show(text: str) -> None:
    """Print a result and flush. After its reader has closed (``... | head``) the work continues without output.

    Args:
        text: one line or several.
    """
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)  # a terminal in Latin-1
    except BrokenPipeError:  # the rest of the buffer would fail again at the end of the process
        with suppress(OSError, ValueError):  # a stream without a descriptor
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def transient(text: str = "", done: bool = False) -> None:
    """Print progress over the last such line; does nothing without a terminal, or where progress is suppressed.

    Args:
        text: text that replaces the line.
        done: whether the line remains and the next text begins a new one.
    """
    if LOG.isEnabledFor(logging.INFO) and sys.stderr.isatty():
        print(f"\r\033[K{text}", end="\n" if done else "", file=sys.stderr, flush=True)


@contextmanager
def announced(text: str, after_s: float, say: Callable[[str], object] = LOG.info) -> Iterator[None]:
    """Announce the work inside the context if it takes long.

    Args:
        text: name of the work.
        after_s: duration before the announcement, s; shorter work is not announced.
        say: function that receives the text, in another thread.
    """
    notice = threading.Timer(after_s, say, [text])
    notice.daemon = True
    notice.start()
    try:
        yield
    finally:
        notice.cancel()


if not LOG.handlers:
    LOG.addHandler(_StandardError())
    LOG.setLevel(logging.INFO)
    LOG.propagate = False
