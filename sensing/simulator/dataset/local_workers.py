"""Runs jobs in processes of this machine; an interrupt ends all of them at once.

A terminal sends Ctrl-C to a command and to its workers alike. Workers ignore the signal, and the command ends them.
(A pool whose workers are interrupted while they hold the lock of its queue may never return.) A command that is
terminated or killed cannot end its workers, so each worker watches its parent process and exits with it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

from cad import threads
from cad.pools import close_result_writer

Result = TypeVar("Result")
LOOK_S = 0.2  # s, interval at which a pending Ctrl-C is looked for


def results(job: Callable[..., Result], arguments: Iterable[tuple[Any, ...]], workers: int) -> Iterator[Result]:
    """Results of ``job(*arguments)``, each when it is finished, in any order.

    Args:
        job: a function at the top level of a module.
        arguments: positional arguments of each call; at most two calls for each worker are drawn in advance.
        workers: number of processes, each with one thread for linear algebra.

    Raises:
        BrokenProcessPool: a worker was killed. Exceptions of a job are raised here, too.
    """
    waiting, running = iter(arguments), set[Future[Result]]()
    others = set(multiprocessing.active_children())
    with _one_thread_each(), _interrupted_between() as interrupted:
        pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), initializer=_follow_parent)
        try:
            with _children_ignoring_interrupts():
                for _ in range(workers):  # no worker is idle yet: each call starts one
                    pool.submit(os.getpid)
            close_result_writer(pool)
            while True:
                running |= {pool.submit(job, *each) for each in islice(waiting, 2 * workers - len(running))}
                if not running:
                    break
                done, running = wait(running, LOOK_S, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
                if interrupted:
                    raise KeyboardInterrupt
        except BaseException:
            for child in set(multiprocessing.active_children()) - others:
                child.kill()
            raise
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _interrupted_between() -> Iterator[list[int]]:
    """A list that Ctrl-C fills; it replaces the exception, which could be raised at any instruction.

    An exception raised while futures are locked, to wait for them or to submit another, leaves them locked, and the
    pool then waits for its own thread for ever.
    """
    seen: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # signals reach the main thread only
        yield seen
        return
    before = signal.signal(signal.SIGINT, lambda number, _: seen.append(number))
    try:
        yield seen
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _children_ignoring_interrupts() -> Iterator[None]:
    """Processes started in this context ignore SIGINT from their first instruction; this process handles it at the end.

    Until :func:`_follow_parent` runs, a worker imports modules for a second, and would end in a traceback.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # children inherit the mask
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _follow_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)  # at once, because no process is left to take the worker's result

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started in this context give linear algebra one thread, since every core has a worker already."""
    before = {name: os.environ.get(name) for name in threads.VARIABLES}
    os.environ.update(dict.fromkeys(threads.VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
