"""Python as it is typed in a command that a user pastes: the one that runs now, as another may lack the libraries."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path


def typed_python() -> str:
    """``python`` where the shell finds the running one under that name, else its path.

    The path is that from the present folder where it lies below it: ``.venv/bin/python`` in a checkout.
    """
    running, found = Path(sys.executable), shutil.which("python")
    if found and Path(found).parent == running.parent and Path(found).resolve() == running.resolve():
        return "python"
    return str(running.relative_to(Path.cwd()) if running.is_relative_to(Path.cwd()) else running)
