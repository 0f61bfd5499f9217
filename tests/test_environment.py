"""The tests run alike whatever the shell of the person who types `make test` has set."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from run_cache import FOLDER

from sensing.wrench.weight_files import weights_folder

HERE = Path(__file__)


def test_probe() -> None:
    """What each test sees; the one below runs it in such a shell."""
    assert "ENDCAP_CAMERA" not in os.environ
    assert weights_folder().is_relative_to(os.environ[FOLDER])


def test_no_setting_of_this_user_reaches_a_test(tmp_path: Path) -> None:
    theirs = {"ENDCAP_CAMERA": "ELP-USBFHD01M-L170", "XDG_DATA_HOME": str(tmp_path)}
    shell = {name: value for name, value in os.environ.items() if name != FOLDER} | theirs
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", f"{HERE}::{test_probe.__name__}"]
    run = subprocess.run(command, env=shell, cwd=HERE.parents[1], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout
