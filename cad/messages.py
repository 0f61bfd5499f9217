"""Messages of the commands: ``logging`` under the name ``endcap``, as plain lines on standard error (standard library).

    LOG.error(...)     why a command ends       LOG.warning(...)   what a user should look at
    LOG.info(...)      progress, once a line    transient(...)     progress in one place, on a terminal only

Results are no messages: :func:`show` prints them on standard output. ``endcap --quiet ...`` leaves progress out. A
program of yours can take the handler off and add another.
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
    """Lines without a prefix; the stream is looked up for each, because tests and programs replace it."""

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError, ValueError):  # nobody reads any more
            print(self.format(record), file=sys.stderr, flush=True)


def set_level(level: int) -> None:
    """What is shown: from ``logging.WARNING`` for ``--quiet``, else from ``logging.INFO``."""
    LOG.setLevel(level)


def show(text: str) -> None:
    """Print a result at once. Where its reader has left (``... | head``) the work goes on, and the rest is not printed.

    Args:
        text: one line or several.
    """
    try:
        print(text, flush=True)
    except BrokenPipeError:  # what is still in the buffer would fail again at the end of the process
        with suppress(OSError, ValueError):  # a stream without a descriptor
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def transient(text: str = "", done: bool = False) -> None:
    """Progress that overwrites itself: nothing where standard error is not a terminal, or progress is left out.

    Args:
        text: replaces the line. done: whether the line stays.
    """
    if LOG.isEnabledFor(logging.INFO) and sys.stderr.isatty():
        print(f"\r\033[K{text}", end="\n" if done else "", file=sys.stderr, flush=True)


@contextmanager
def announced(text: str, after_s: float, say: Callable[[str], object] = LOG.info) -> Iterator[None]:
    """Say what the work inside is, once it takes long.

    Args:
        text: what. after_s: shorter work is not announced, s. say: is called, from another thread.
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
