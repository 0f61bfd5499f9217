"""Worker processes that share the work of a command and never outlive it.

Workers are forked, so they start with the libraries that the command has loaded. They end with their parent,
however it ends: Linux sends them SIGKILL (prctl PR_SET_PDEATHSIG), elsewhere a thread of theirs waits for the parent.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress

from cad.errors import EndcapError
from cad.pools import close_result_writer
from fab.exports.whole_folder import ENDING_SIGNALS

PR_SET_PDEATHSIG = 1  # S: linux/prctl.h
# Of memory for each process: four of 16 GB, which systems report as 15.5. One more takes 1 GB in `make molds` at
# D=250 T=25, and holds three after ten large sizes of the survey (M).
PROCESS_BYTES = 7 << 29


# mallopt's numbers (S: glibc's malloc.h) and values: what is freed stays with the process, and only arrays of more than
# 32 MB, the largest threshold that glibc takes, come from the system each time. A run spends a third less time there.
KEEP_FREED = {-1: (1 << 31) - 1, -2: 1 << 26, -3: 1 << 25}  # M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD


class WorkerLostError(EndcapError):
    """A worker process ended before its work was done."""


def usable_cores() -> int:
    """Number of cores that this process may use; all of the computer where the system does not report it."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory_bytes() -> int:
    """Memory of this computer, bytes."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def processes_with_room() -> int:
    """Number of processes that cores and memory allow, at least one."""
    return max(1, min(usable_cores(), memory_bytes() // PROCESS_BYTES))


@contextmanager
def worker_pool(count: int) -> Iterator[Executor]:
    """Pool of workers, all started at once; on any error they are killed before the error is raised further.

    A context that removes their files (:func:`fab.exports.whole_folder.whole_folder`) must therefore enclose this one.

    Args:
        count: of processes.

    Raises:
        WorkerLostError: a worker was killed, probably for lack of memory.
    """
    keep_freed_memory()
    context = multiprocessing.get_context("fork")
    others = set(multiprocessing.active_children())
    with ProcessPoolExecutor(count, context, _start_worker, (os.getpid(),)) as pool:
        for _ in range(count):
            pool.submit(os.getpid)
        close_result_writer(pool)
        try:
            yield pool
        except BaseException as error:
            for child in set(multiprocessing.active_children()) - others:
                child.kill()
            pool.shutdown(wait=True, cancel_futures=True)
            if isinstance(error, BrokenProcessPool):
                raise WorkerLostError(
                    "a worker process was killed (out of memory?): nothing was written; close other programs, then run "
                    "again"
                ) from error
            raise


def keep_freed_memory() -> None:
    """Let this process and those forked from it keep freed memory for their next arrays, where the C library can."""
    if sys.platform == "linux":
        with suppress(AttributeError):  # a C library without this function
            mallopt = ctypes.CDLL(None).mallopt
            for parameter, value in KEEP_FREED.items():
                mallopt(parameter, value)


def end_with_parent(parent: int) -> None:
    """Make this process end as soon as its parent does.

    Args:
        parent: process id of the parent, taken before the fork: it may have ended since.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        process = multiprocessing.parent_process()
        assert process is not None

        def watch() -> None:
            process.join()
            os._exit(1)

        threading.Thread(target=watch, daemon=True).start()
    if os.getppid() != parent:
        os._exit(1)


def _start_worker(parent: int) -> None:
    for number in ENDING_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # nohup
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends Ctrl-C to all; the command ends its workers itself
    end_with_parent(parent)
