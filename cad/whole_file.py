"""Atomic writing of files and new folders: they appear complete or not at all (standard library only).

:mod:`fab.exports.whole_folder` writes into existing folders, in which the user's own files remain.

Notes:
    A folder is filled under a hidden name next to the final one. The process holds a lock (flock) on it, which the
    system releases whenever and however the process ends: unlocked hidden folders are removed at the next start.
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

MEDIUM_FULL = (errno.ENOSPC, errno.EDQUOT)  # error numbers of a full disk or quota
READABLE = 0o644  # permissions, before the user's umask
PRIVATE = 0o600  # permissions of files for the user alone


def replace_file(path: Path, data: bytes, fix: str = "give a folder that exists and may be written") -> None:
    """Write a file under a temporary name, then rename it.

    Args:
        path: the file; an existing one is replaced.
        data: its content.
        fix: remedy, the last part of the message.

    Raises:
        FileError: the file cannot be written.
    """
    try:
        put_file(path, data)
    except OSError as error:
        space = "free some space, or " if error.errno in MEDIUM_FULL else ""
        raise FileError(f"{path}: {error.strerror or error}: {space}{fix}") from error


def put_file(path: Path, data: bytes, mode: int = READABLE, durable: bool = False) -> None:
    """Write a file as :func:`replace_file` does, for callers with an error message of their own.

    Args:
        path: the file; an existing one is replaced.
        data: its content.
        mode: permissions, which hold from the first byte on.
        durable: whether the data is synchronised to the disk before the file is renamed.

    Raises:
        OSError: the file cannot be written; an existing one remains.
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
    """Make a folder and its missing parents.

    Raises:
        FileError: the folder cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: give a folder that can be made") from error


def require_place(path: Path) -> None:
    """Refuse a file that cannot be written, before long work begins.

    Args:
        path: path of the future file.

    Raises:
        FileError: the path is a folder, or its folder does not exist or cannot be written.
    """
    try:
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        probe_folder(path.parent)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: name a file in a folder that may be written") from error


def probe_folder(folder: Path) -> None:
    """Check that a folder can be written: write a few bytes into it and remove them.

    Raises:
        OSError: the folder does not exist, is full or cannot be written.
    """
    probe = folder / f".probe-{secrets.token_hex(4)}"
    try:
        probe.write_bytes(bytes(4096))
    finally:
        probe.unlink(missing_ok=True)


@contextmanager
def drafted(path: Path) -> Iterator[Path]:
    """Yield a temporary name with the suffix of ``path``, to which the file is renamed at the end.

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
    """Yield a hidden folder to fill, which is renamed to ``path`` at the end and removed after an error.

    Raises:
        FileError: the path is neither free nor an empty folder.
        OSError: the folder cannot be written.
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
    """Make a hidden folder next to the final one; returns it and the file descriptor that holds its lock.

    Raises:
        OSError: the folder cannot be made.
    """
    while True:
        partial = final.with_name(f".{final.name}.partial-{secrets.token_hex(4)}")
        partial.mkdir()
        try:
            lock = _try_lock(partial)
        except OSError:
            partial.rmdir()
            raise
        if lock is not None and partial.exists():  # another process may have removed it before it was locked
            return partial, lock


def remove_partial(parent: Path, name: str | None = None) -> None:
    """Remove the hidden folders of runs that were killed.

    Args:
        parent: folder that contains them.
        name: name of the final folder whose hidden ones are removed; by default, those of all.
    """
    for path in sorted(parent.glob(f".{'*' if name is None else glob.escape(name)}.partial-*")):
        with lock_if_free(path) as is_free:
            if is_free:
                shutil.rmtree(path, ignore_errors=True)


@contextmanager
def lock_if_free(folder: Path) -> Iterator[bool]:
    """Yield whether no running process has locked a folder; if so, this process holds the lock inside the context."""
    lock = _try_lock(folder)
    try:
        yield lock is not None
    finally:
        if lock is not None:
            os.close(lock)


def hold_lock(path: Path) -> IO[str]:
    """Open a lock file that this process alone holds until the file is closed.

    An existing file is not truncated and a link is not followed, because it could lead to any file of the user.

    Raises:
        BlockingIOError: another process holds the lock.
        OSError: the file cannot be written, or is a link.
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
    """Descriptor that holds the lock of a folder; ``None`` where another process holds it or the folder is missing.

    Raises:
        OSError: the file system has no locks, or the folder cannot be opened.
    """
    import fcntl  # missing on some systems, which can still write files

    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except (FileNotFoundError, NotADirectoryError):
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if error.errno not in (errno.EWOULDBLOCK, errno.EACCES):
            raise OSError(error.errno, "its file system has no locks", str(folder)) from error
        return None
    return descriptor
