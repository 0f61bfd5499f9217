"""Files and new folders that appear whole or not at all: the one place that renames (standard library only).

A folder that exists and keeps what is the user's in it is the work of :mod:`fab.exports.whole_folder`.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cad.errors import FileError

READABLE = 0o644  # less what the user's umask takes
PRIVATE = 0o600


def replace_file(path: Path, data: bytes, fix: str = "give a folder that exists and may be written") -> None:
    """Write under a temporary name, then rename.

    Args:
        path: the file; an older one is replaced. data: its content. fix: last part of the message.

    Raises:
        FileError: the place cannot be written.
    """
    try:
        put_file(path, data)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: {fix}") from error


def put_file(path: Path, data: bytes, mode: int = READABLE, durable: bool = False) -> None:
    """The same for callers who have a message of their own.

    Args:
        path, data: the file and its content.
        mode: permissions, from its first byte on.
        durable: wait until the disk has it, before it takes its name.

    Raises:
        OSError: the place cannot be written; what stood there stands.
    """
    temporary = path.with_name(f".{path.name[:100]}.{secrets.token_hex(4)}.part")
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(data)
            stream.flush()
            if durable:
                os.fsync(stream.fileno())
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def make_folder(path: Path) -> None:
    """Make a folder and those above it, where they are not there.

    Raises:
        FileError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: give a folder that can be made") from error


@contextmanager
def drafted(path: Path) -> Iterator[Path]:
    """A name beside ``path``, with its suffix, for a library that writes by name; it becomes ``path`` at the end.

    Raises:
        OSError: the place cannot be written.
    """
    draft = path.with_name(f".part-{secrets.token_hex(4)}-{path.name[-100:]}")
    try:
        yield draft
        os.replace(draft, path)
    finally:
        draft.unlink(missing_ok=True)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """A folder to fill that takes the name of a new or empty one at the end; without a trace after an error.

    Raises:
        FileError: something is there. OSError: the place cannot be written.
    """
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise FileError(f"{path}: is there and not an empty folder: choose a new one")
    part = path.with_name(path.name + ".part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        yield part
        os.replace(part, path)
    finally:
        shutil.rmtree(part, ignore_errors=True)
