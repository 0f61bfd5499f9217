"""Progress of a command: a line a step with its seconds.

On a terminal the running step stands on the last line until it is done; elsewhere (a file, a pipe, a log) each step is
one plain line when it is done.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from cad.messages import LOG, transient


class Progress:
    """Lines on standard error, so that what a command prints as its result stays apart.

    Args:
        check_interrupt: called as each step begins; what it raises ends the command.
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
            transient()  # the step was not done

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.monotonic() - self._start

    def __call__(self, step: str) -> None:
        """Begin a step; the one before it is done."""
        self._check_interrupt()
        self._finish()
        self._step, self._since = step, time.monotonic()
        transient(f"  ...    {step}")

    def done(self, seconds: float) -> None:
        """The step is done, by a worker of its own that took so long."""
        self._finish(seconds)

    def _finish(self, seconds: float | None = None) -> None:
        if self._step is None:
            return
        transient()
        LOG.info(f"{time.monotonic() - self._since if seconds is None else seconds:6.1f} s {self._step}")
        self._step = None
