"""Pools of worker processes whose workers may be killed (standard library only)."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor


def let_a_cut_result_end(pool: ProcessPoolExecutor) -> None:
    """Close this process's end for writing of the pipe of results, which only workers write to.

    A worker that is killed while it writes a result leaves half of one, and the pool's thread waits for the rest for as
    long as any process holds that end: for ever, where this process does. Workers have theirs already.

    Args:
        pool: all of its workers have been started; it cannot start another.
    """
    pool._result_queue._writer.close()  # type: ignore[attr-defined]  # the pool has no public way to
