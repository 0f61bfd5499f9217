"""A run's small matrices get one BLAS thread: threads that wait for one another cost more than they compute."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

WORK = """
import threadpoolctl
from sensing.live.run import reduce_pauses
reduce_pauses()
print(sorted({pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"}))
"""


def test_blas_has_one_thread_in_a_run(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    root = Path(__file__).resolve().parents[3]
    run = subprocess.run([sys.executable, "-c", WORK], cwd=root, capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[1]"
