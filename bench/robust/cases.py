"""Runs one case of a fuzzer in a process of its own, forked from one that has loaded the libraries.

Bad are a traceback, an abort, a status that is none of the documented ones, no end in time, memory over 1 GB. Time in
which a case waits for a processor that others use is not counted as its own.
"""

from __future__ import annotations

import contextlib
import os
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from sensing.live.ending import end_at_once, leave

MOST_MB = 1000.0
ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
NOISE = ("Traceback", "Fatal Python", "Exception ignored", "terminate called", "FATAL", "Segmentation")


@dataclass(frozen=True)
class Outcome:
    """How a case ended.

    Attributes:
        status: of the exit; negative for a signal, None for one that had to be killed. seconds: it ran.
        end_s: from its signal to its end; NaN without one. most_mb: largest resident set. text: what it printed.
    """

    status: int | None
    seconds: float
    end_s: float
    most_mb: float
    text: str

    def fault(self, allowed: tuple[int, ...]) -> str:
        """What is bad about it; empty if nothing is."""
        if self.status is None:
            return f"hang of {self.seconds:.0f} s"
        if any(word in self.text for word in NOISE):
            return "traceback"
        if self.status not in allowed:
            return f"status {self.status}"
        return f"{self.most_mb:.0f} MB" if self.most_mb > MOST_MB else ""


def run_case(
    work: Callable[[], int],
    limit_s: float,
    end: tuple[int, float, bool] | None = None,
    stdout: str | None = None,
) -> Outcome:
    """One case.

    Args:
        work: returns an exit status. limit_s: then it is killed.
        end: signal, seconds until it is sent, and whether they count from the first line that it prints.
        stdout: path for standard output instead of the file that is read.
    """
    with tempfile.TemporaryFile() as printed:
        begin = time.monotonic()
        signal.pthread_sigmask(signal.SIG_BLOCK, ENDS)  # until the child has its handlers
        pid = os.fork()
        if pid == 0:
            _child(work, printed.fileno(), stdout)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDS)
        sent_s = float("nan")
        if end is not None:
            while end[2] and not os.fstat(printed.fileno()).st_size and time.monotonic() < begin + limit_s / 2:
                time.sleep(0.002)
            time.sleep(end[1])
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, end[0])
            sent_s = time.monotonic()
        status, most_mb = _wait(pid, begin + limit_s)
        now = time.monotonic()
        printed.seek(0)
        text = printed.read().decode("utf-8", "replace")
    return Outcome(status, now - begin, now - sent_s, most_mb, text)


def _child(work: Callable[[], int], printed: int, stdout: str | None) -> None:
    try:
        os.dup2(printed, 2)
        os.dup2(printed if stdout is None else os.open(stdout, os.O_WRONLY), 1)
        end_at_once()
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDS)
        status = work()
    except BaseException:
        import traceback

        os.write(2, traceback.format_exc().encode())
        status = 99
    leave(status)


def starved_s(pid: int) -> float:
    """For how long the thread of a process that was held up most has waited for a processor."""
    found = 0.0
    for task in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with contextlib.suppress(OSError):
            found = max(found, int(task.read_text().split()[1]) / 1e9)
    return found


def _wait(pid: int, until_s: float) -> tuple[int | None, float]:
    """(status, MB); None for a process that had to be killed."""
    killed = False
    while True:
        found, status, usage = os.wait4(pid, os.WNOHANG)
        if found:
            code = os.waitstatus_to_exitcode(status)
            return None if killed else code, usage.ru_maxrss / 1024
        if not killed and time.monotonic() > until_s and time.monotonic() > until_s + starved_s(pid):
            os.kill(pid, signal.SIGKILL)
            killed = True
        time.sleep(0.005)
