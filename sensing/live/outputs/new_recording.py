"""The file of a new recording: never one that is there already."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

from cad.errors import FileError
from cad.whole_file import require_place


def require_new(path: Path) -> None:
    """Refuse before long work what :func:`create` would refuse after it.

    Raises:
        FileError: the file exists, or its place cannot be written.
    """
    if path.exists():
        raise _taken(path)
    require_place(path)


def create(path: Path) -> BinaryIO:
    """Make the file and open it.

    Raises:
        FileError: it exists, or cannot be made.
    """
    try:
        return path.open("xb")
    except FileExistsError:
        raise _taken(path) from None
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: give a folder that exists and may be written") from None


def _taken(path: Path) -> FileError:
    return FileError(f"{path}: is there already: choose another name for the recording")
