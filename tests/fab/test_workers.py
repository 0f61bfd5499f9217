"""Workers that are killed in the middle of something, and how many there are."""

import os
import platform
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from fab import molds
from fab import workers as workers_module
from fab.workers import memory_bytes, usable_cores

ROOT = Path(__file__).resolve().parents[2]
CUT_RESULT = """
import os, struct, sys, time
from pathlib import Path
from fab.workers import worker_pool

def begin_a_result(mark):
    pipe = sys._getframe(1).f_locals["result_queue"]._writer
    os.write(pipe.fileno(), struct.pack("!i", 1000) + b"the first bytes of a thousand")
    Path(mark).touch()
    time.sleep(600)

mark = Path(sys.argv[1])
try:
    with worker_pool(2) as pool:
        pool.submit(begin_a_result, str(mark))
        while not mark.exists():
            time.sleep(0.05)
        raise KeyboardInterrupt
except KeyboardInterrupt:
    print("ended")
"""


FAULTS = """
import resource
import numpy as np
from fab.workers import keep_freed_memory

def pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        arrays = [np.ones(3 << 20) for _ in range(4)]  # 24 MB each, all freed before the next four
        del arrays
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

given_back = pages()
keep_freed_memory()
pages()
print(given_back > 4 * pages())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="a C library without mallopt")
def test_freed_memory_is_taken_again_without_the_system():
    run = subprocess.run([sys.executable, "-c", FAULTS], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (run.stdout, run.stderr) == ("True\n", "")


def test_an_interruption_while_a_worker_writes_its_result_ends(tmp_path):
    command = [sys.executable, "-c", CUT_RESULT, str(tmp_path / "begun")]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert (run.stdout, run.returncode) == ("ended\n", 0)


def test_cores_are_those_that_this_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5, 7}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    assert usable_cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    assert usable_cores() == 64


@pytest.mark.parametrize(
    ("cores", "memory_gb", "workers"),
    [
        (1, 64, 2),
        (2, 64, 2),
        (3, 64, 3),
        (64, 64, molds.MOST_WORKERS),
        (8, 15.5, 4),
        (8, 12, 3),
        (8, 7.6, 2),
        (8, 2, 2),
    ],
)
def test_molds_use_the_cores_that_there_are_as_far_as_memory_goes(monkeypatch, cores, memory_gb, workers):
    monkeypatch.setattr(workers_module, "usable_cores", lambda: cores)
    monkeypatch.setattr(workers_module, "memory_bytes", lambda: int(memory_gb * 2**30))
    assert molds.worker_count() == workers


def test_the_memory_of_this_computer_holds_this_program():
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # kB, on macOS bytes
    assert used * (1 if sys.platform == "darwin" else 1024) < memory_bytes() < 1 << 50
