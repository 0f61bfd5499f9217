"""The command ``make molds`` as a process of its own, at the smallest of the tests' designs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SMALL = ("D=100", "T=8")


def start(*words: str, cache: Path | None = None) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "fab.molds", *words],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(cache or "/nonexistent")},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_until_signals_are_handled(process: subprocess.Popen[str]) -> None:
    """Return once the command ends by its own rules: on a busy computer Python alone may take seconds to begin."""
    for _ in range(1200):
        caught = next(line for line in Path(f"/proc/{process.pid}/status").read_text().splitlines() if "SigCgt" in line)
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        assert process.poll() is None
        time.sleep(0.1)
    raise AssertionError("SIGTERM is never handled")


def left_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*"))
