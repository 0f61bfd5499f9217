"""Messages of the commands: ``logging`` under the name ``endcap``, as plain lines on standard error (standard library).

    LOG.error(...)     why a command ends       LOG.warning(...)   what a user should look at
    LOG.info(...)      progress, once a line    transient(...)     progress in one place, on a terminal only

Results go to standard output and are no messages. ``endcap --quiet ...`` leaves progress out. A program of yours can
take the handler off and add another.
"""

from __future__ import annotations

import logging
import sys
from contextlib import suppress

LOG = logging.getLogger("endcap")


class _StandardError(logging.Handler):
    """Lines without a prefix; the stream is looked up for each, because tests and programs replace it."""

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError, ValueError):  # nobody reads any more
            print(self.format(record), file=sys.stderr, flush=True)


def set_level(level: int) -> None:
    """What is shown: from ``logging.WARNING`` for ``--quiet``, else from ``logging.INFO``."""
    LOG.setLevel(level)


def transient(text: str = "", done: bool = False) -> None:
    """Progress that overwrites itself: nothing where standard error is not a terminal, or progress is left out.

    Args:
        text: replaces the line. done: whether the line stays.
    """
    if LOG.isEnabledFor(logging.INFO) and sys.stderr.isatty():
        print(f"\r\033[K{text}", end="\n" if done else "", file=sys.stderr, flush=True)


if not LOG.handlers:
    LOG.addHandler(_StandardError())
    LOG.setLevel(logging.INFO)
    LOG.propagate = False
