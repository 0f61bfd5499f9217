"""The first run on somebody's computer: system libraries that are there are found."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(shutil.which("ldconfig", path="/usr/sbin:/sbin") is None, reason="no ldconfig on this computer")
def test_an_ordinary_user_of_debian_has_the_libraries_that_are_there():
    """Debian has /usr/sbin in the PATH of root alone. These tests need the libraries, so they are there."""
    env = {**os.environ, "PATH": "/usr/bin:/bin"}
    done = subprocess.run(["sh", "scripts/system_libraries.sh"], cwd=ROOT, env=env, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
