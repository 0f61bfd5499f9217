"""How long `make molds` takes on more cores than this computer has: computed, not measured.

    python bench/bench_molds_cores.py            D=130 T=8
    python bench/bench_molds_cores.py 150 9      yours

The command's work is done once in one process on one core, and each job is timed when it is handed over. Then the same
jobs are divided, in the same order, among as many processes as the command would start, on 1 to 12 cores as quick as
this one, on a computer with memory enough. What is left out: memory that cores share, and cores that share one
(hyperthreads). Where two cores are measured (bench/molds.csv), the ratio of both is the error of this computation.

Writes bench/molds_cores.csv: cores, processes, seconds.
"""

from __future__ import annotations

import csv
import pickle
import sys
import tempfile
import time
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.bench_molds_where import variant_on_one_core
from bench.one_line import in_one_line
from fab import molds, workers

TABLE = Path(__file__).with_name("molds_cores.csv")
CORES = (1, 2, 3, 4, 6, 8, 12)


@dataclass
class Work:
    """What one run did.

    Attributes:
        job_s: processor seconds of each job, its way to the worker and back included.
        acts: what the command's own process did: ("run", seconds), ("submit", job), ("wait", job).
    """

    job_s: list[float] = field(default_factory=list)
    acts: list[tuple[str, float]] = field(default_factory=list)


class Timed(Executor):
    """Runs each job at once, in this process, and keeps its processor seconds."""

    def __init__(self, work: Work) -> None:
        self.work, self._since = work, 0.0  # the start of Python is the command's, too

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run it, between the pickles in which a worker would get and return it."""
        self.own()
        start = time.process_time()
        pickle.dumps((fn, args, kwargs))
        value = fn(*args, **kwargs)
        pickle.dumps(value)
        job = len(self.work.job_s)
        self.work.job_s.append(time.process_time() - start)
        self.work.acts.append(("submit", job))
        self._since = time.process_time()
        return Given(self, job, value)

    def own(self) -> None:
        """Keep what this process did since it was last asked."""
        now = time.process_time()
        self.work.acts.append(("run", now - self._since))
        self._since = now


class Given(Future[Any]):
    """A job that is done; asked for its value, it notes that the command waits for it here."""

    def __init__(self, timed: Timed, job: int, value: Any) -> None:
        super().__init__()
        self._timed, self._job = timed, job
        self.set_result(value)

    def result(self, timeout: float | None = None) -> Any:
        """The value."""
        self._timed.own()
        self._timed.work.acts.append(("wait", self._job))
        return super().result(timeout)


def wall_s(work: Work, cores: int, workers: int) -> float:
    """Seconds until the command's own process is done, jobs taken in order by the first worker that is free.

    Where more processes run than there are cores, all of them run slower alike.

    Args:
        work: what there is to do. cores: that share it. workers: processes beside the command's own.
    """
    acts, queue, running, done = iter(work.acts), list[int](), dict[int, float](), set[int]()
    now, own_s, waits = 0.0, 0.0, -1
    while True:
        while own_s <= 0 and (waits < 0 or waits in done):
            waits = -1
            if (act := next(acts, None)) is None:
                return now
            kind, value = act
            if kind == "run":
                own_s = value
            elif kind == "submit":
                queue.append(int(value))
            else:
                waits = int(value)
        while queue and len(running) < workers:
            job = queue.pop(0)
            running[job] = work.job_s[job]
        left = [*running.values(), *([own_s] if own_s > 0 else [])]
        rate = min(1.0, cores / len(left))
        step = min(left)
        now, own_s = now + step / rate, own_s - step
        running = {job: seconds - step for job, seconds in running.items()}
        done |= {job for job, seconds in running.items() if seconds <= 1e-12}
        running = {job: seconds for job, seconds in running.items() if job not in done}


def main() -> None:
    """Do the work once, compute, write."""
    variant, work = variant_on_one_core(__doc__, "bench_molds_cores.py"), Work()
    timed = Timed(work)
    molds.load_libraries(print)
    with tempfile.TemporaryDirectory(prefix="molds-") as folder:
        molds.make_molds(variant, Path(folder), timed, print)
    timed.own()
    own = sum(value for kind, value in work.acts if kind == "run")
    print(f"processor seconds: {own:.1f} of the command's own process, {sum(work.job_s):.1f} of its jobs")
    with TABLE.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(("cores", "processes", "wall_s"))
        for cores in CORES:
            with (
                mock.patch.object(workers, "usable_cores", lambda n=cores: n),
                mock.patch.object(workers, "memory_bytes", lambda: 1 << 50),
            ):
                count = molds.worker_count()
            seconds = wall_s(work, cores, count)
            print(f"{cores:2d} cores, {count + 1} processes: {seconds:5.1f} s")
            writer.writerow((cores, count + 1, f"{seconds:.1f}"))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
