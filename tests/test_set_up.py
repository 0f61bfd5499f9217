"""The first run on somebody's computer: system libraries found, an environment that could not be made does not stay."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Answers what is asked before; "-m venv" leaves a python and ends, as without ensurepip.
HALF = """#!/bin/sh
[ "$1" = -m ] || exit 0
mkdir -p "$3/bin"
touch "$3/bin/python"
echo "ensurepip is not available" >&2
exit 1
"""


@pytest.mark.skipif(shutil.which("ldconfig", path="/usr/sbin:/sbin") is None, reason="no ldconfig on this computer")
def test_an_ordinary_user_of_debian_has_the_libraries_that_are_there():
    """Debian has /usr/sbin in the PATH of root alone. These tests need the libraries, so they are there."""
    env = {**os.environ, "PATH": "/usr/bin:/bin"}
    done = subprocess.run(["sh", "scripts/system_libraries.sh"], cwd=ROOT, env=env, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_a_half_made_environment_does_not_stay(tmp_path):
    shutil.copy(ROOT / "Makefile", tmp_path)
    shutil.copytree(ROOT / "scripts", tmp_path / "scripts")
    for name in ("pyproject.toml", "lock.txt"):
        shutil.copy(ROOT / name, tmp_path)
    python = tmp_path / "python"
    python.write_text(HALF)
    python.chmod(0o755)
    env = {k: v for k, v in os.environ.items() if not k.startswith(("MAKE", "MFLAGS"))}
    for _ in range(2):  # the second run must not take the first one's remains for an environment
        run = ["make", f"PYTHON={python}", "setup"]
        done = subprocess.run(run, cwd=tmp_path, env=env, capture_output=True, text=True)
        assert done.returncode == 2 and "ensurepip is not available" in done.stderr
        assert not (tmp_path / ".venv" / "bin" / "python").exists()
