"""Libraries in C read names of files as UTF-8 in every command, as Python does, under LC_ALL=C, too."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN = """
import locale
from fab.command import Command
command = Command("make it", "", "", "", {})
raise SystemExit(command.run([], lambda options, interrupts: print(locale.nl_langinfo(locale.CODESET)) or 0))
"""


@pytest.mark.parametrize("chosen", ["C", "POSIX"])
def test_names_are_utf_8_in_a_locale_without_umlauts(chosen):
    run = subprocess.run(
        [sys.executable, "-c", RUN], cwd=ROOT, env={**os.environ, "LC_ALL": chosen}, capture_output=True, text=True
    )
    assert (run.returncode, run.stdout.strip()) == (0, "UTF-8"), run.stderr
