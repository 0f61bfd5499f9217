"""Safe end of process pools whose workers may be killed (standard library only)."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor


def close_result_writer(pool: ProcessPoolExecutor) -> None:
    """Close this process's write end of the results pipe, to which only workers write.

    A worker that is killed while it writes a result leaves it incomplete. The pool's thread then waits for the rest as
    long as any process has the write end open, that is for ever if this process has it. Workers have their own already.

    Args:
        pool: pool whose workers have all been started; it cannot start another one afterwards.
    """
    pool._result_queue._writer.close()  # type: ignore[attr-defined]  # the pool has no public method for it
