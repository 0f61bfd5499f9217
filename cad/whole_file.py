"""Files and new folders that appear whole or not at all: the one place that renames (standard library only).

A folder that exists and keeps what is the user's in it is the work of :mod:`fab.exports.whole_folder`.

Notes:
    A folder is filled under a hidden name beside the final one. The process holds a lock (flock) on it, and the system
    frees the lock when the process ends, however it ends: unlocked hidden folders are swept at the next start.
"""

from __future__ import annotations

import errno
import glob
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from cad.errors import FileError

MEDIUM_FULL = (errno.ENOSPC, errno.EDQUOT)
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
        space = "free some space, or " if error.errno in MEDIUM_FULL else ""
        raise FileError(f"{path}: {error.strerror or error}: {space}{fix}") from error


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


def require_place(path: Path) -> None:
    """Say at once, before long work, whether a file can be written.

    Args:
        path: where it will be.

    Raises:
        FileError: a folder is there, or its folder is not there or cannot be written.
    """
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        probe_folder(path.parent)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: name a file in a folder that may be written") from error


def probe_folder(folder: Path) -> None:
    """Write a few bytes into a folder and take them away.

    Raises:
        OSError: it is not there, full or cannot be written.
    """
    probe = folder / f".probe-{secrets.token_hex(4)}"
    try:
        probe.write_bytes(bytes(4096))
    finally:
        probe.unlink(missing_ok=True)


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
    path.parent.mkdir(parents=True, exist_ok=True)
    remove_partial(path.parent, path.name)
    part, lock = locked_folder(path)
    try:
        yield part
        os.replace(part, path)
    finally:
        shutil.rmtree(part, ignore_errors=True)
        os.close(lock)


def locked_folder(final: Path) -> tuple[Path, int]:
    """A new hidden folder beside the final one, and the file descriptor that holds its lock.

    Raises:
        OSError: it cannot be made.
    """
    while True:
        partial = final.with_name(f".{final.name}.partial-{secrets.token_hex(4)}")
        partial.mkdir()
        lock = _try_lock(partial)
        if lock is not None and partial.exists():  # another process may have swept it before it was locked
            return partial, lock


def remove_partial(parent: Path, name: str | None = None) -> None:
    """Remove the hidden folders of runs that were killed before they were done.

    Args:
        parent: where they lie. name: of the folder that they would have become; all by default.
    """
    for path in sorted(parent.glob(f".{'*' if name is None else glob.escape(name)}.partial-*")):
        with lock_if_free(path) as is_free:
            if is_free:
                shutil.rmtree(path, ignore_errors=True)


@contextmanager
def lock_if_free(folder: Path) -> Iterator[bool]:
    """Lock a folder unless a living process holds it; yield whether the lock was taken, which lasts to the exit."""
    lock = _try_lock(folder)
    try:
        yield lock is not None
    finally:
        if lock is not None:
            os.close(lock)


def hold_lock(path: Path) -> IO[str]:
    """An open lock file that this process alone holds until it is closed.

    What stands there is neither followed nor emptied: a link could lead to any file of the user's.

    Raises:
        BlockingIOError: another process holds it. OSError: it cannot be written, or is a link.
    """
    import fcntl

    flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK  # a pipe there is an error, not a wait
    if path.is_symlink():
        raise OSError(errno.ELOOP, f"its {path.name} is a link")
    stream = os.fdopen(os.open(path, flags, READABLE), "w")
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        stream.close()
        raise
    return stream


def _try_lock(folder: Path) -> int | None:
    """Descriptor that holds the lock of a folder; ``None`` where another process holds it, or the folder has gone."""
    import fcntl  # not on every system; files alone need none of it

    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except (FileNotFoundError, NotADirectoryError):
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        return None
    return descriptor
