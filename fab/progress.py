"""Progress of a command: one line for each step, with its seconds.

On a terminal the last line shows the current step; elsewhere (a file, a pipe, a log) one line is written when a step is
done.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from cad.messages import LOG, transient


class Progress:
    """Progress lines on standard error, separate from the result on standard output.

    Args:
        check_interrupt: called as each step begins; an exception that it raises ends the command.
    """

    def __init__(self, check_interrupt: Callable[[], None] = lambda: None) -> None:
        self._check_interrupt = check_interrupt
        self._start = time.monotonic()
        self._step: str | None = None
        self._since = self._start

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._finish()
        elif self._step is not None:
            transient()  # the step failed

    @property
    def seconds(self) -> float:
        """Time since the start, s."""
        return time.monotonic() - self._start

    def __call__(self, step: str) -> None:
        """Begin a step and end the one before it.

        Args:
            step: its name.
        """
        self._check_interrupt()
        self._finish()
        self._step, self._since = step, time.monotonic()
        transient(f"  ...    {step}")

    def done(self, seconds: float) -> None:
        """End a step that a worker did.

        Args:
            seconds: that the worker took.
        """
        self._finish(seconds)

    def _finish(self, seconds: float | None = None) -> None:
        if self._step is None:
            return
        transient()
        LOG.info(f"{time.monotonic() - self._since if seconds is None else seconds:6.1f} s {self._step}")
        self._step = None
