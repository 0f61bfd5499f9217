"""What the processes of one test run share: the first that needs a thing makes it, the others read it."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from cad.whole_file import replace_file

FOLDER = "ENDCAP_TESTS_CACHE"  # environment variable; tests/conftest.py makes the folder and removes it
Made = TypeVar("Made")


def shared(name: str, make: Callable[[], Made]) -> Made:
    """What ``make`` gave in whichever process came first.

    Args:
        name: of the file; it stands for all that ``make`` depends on.
    """
    path = Path(os.environ[FOLDER]) / f"{name}.pickle"
    if not path.exists():
        replace_file(path, pickle.dumps(make()))
    return pickle.loads(path.read_bytes())  # of this run only, in a folder of its own
