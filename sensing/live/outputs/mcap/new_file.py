"""The file of a new recording: never one that is there already, and on the disk when it is done."""

from __future__ import annotations

import contextlib
import errno
import io
import os
from pathlib import Path
from typing import BinaryIO

from cad.errors import FileError
from cad.whole_file import require_place

UNABLE = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EACCES, errno.EPERM}  # of file systems that do not wait


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


def write_soon(stream: BinaryIO) -> None:
    """Have the system write to the disk what it holds of a file, without waiting: it may take half a minute by itself.

    Args:
        stream: flushed; one that is no file is left as it is.
    """
    with contextlib.suppress(OSError, AttributeError):  # AttributeError: a system without it
        os.posix_fadvise(stream.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def put_on_disk(stream: BinaryIO, path: Path) -> None:
    """Return when a file and its name are on the disk: a robot is switched off right after its recording.

    Args:
        stream: flushed; one that is no file is left as it is.
        path: of the file.

    Raises:
        OSError: the disk has failed, or is full after all.
    """
    try:
        os.fsync(stream.fileno())
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except io.UnsupportedOperation:
        return
    except OSError as error:
        if error.errno not in UNABLE:
            raise


def _taken(path: Path) -> FileError:
    return FileError(f"{path}: is there already: choose another name for the recording")
