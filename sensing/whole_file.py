"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from cad.errors import FileError


def make_folder(path: Path) -> None:
    """Make a folder and those above it, where they are not there.

    Raises:
        FileError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: give a folder that can be made") from None


def replace_file(path: Path, data: bytes) -> None:
    """Write under a temporary name, then rename.

    Raises:
        FileError: the place cannot be written.
    """
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: give a folder that exists and may be written") from None
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
