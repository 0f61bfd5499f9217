"""Commands as a user pastes them: with the Python that runs now, as another may lack the libraries."""

from __future__ import annotations

import shlex
import shutil
import sys
from pathlib import Path

from cad.lens import camera_setting


def typed_python() -> str:
    """``python`` where the shell finds the running one under that name, else its path.

    The path is that from the present folder where it lies below it: ``.venv/bin/python`` in a checkout.
    """
    running, found = Path(sys.executable), shutil.which("python")
    if found and Path(found).parent == running.parent and Path(found).resolve() == running.resolve():
        return "python"
    return str(running.relative_to(Path.cwd()) if running.is_relative_to(Path.cwd()) else running)


def typed_command(module: str, *words: str) -> str:
    """A program of this toolkit, whole and quoted; with another camera module than the released one, its setting, too.

    Args:
        module: as in ``sensing.live``.
        words: its options.
    """
    return camera_setting() + shlex.join((typed_python(), "-m", module, *words))
