"""Atomic writing of a command's folder: it appears complete or not at all, and the user's own files in it remain.

A command fills a hidden folder next to the final one. Its record (``manifest.json``, ``slice.json`` and the like) lists
every file with its SHA-256, so that a later run replaces exactly the files of the earlier one: files that the user
added remain, and a listed file that the user has changed is not overwritten, but raises an error.

Standard library only, because `make clean` reads the records without the environment.

Notes:
    A new folder gets its name by one rename. Where the folder exists, the hidden one is renamed to ``.NAME.ready-*``
    after all checks, and its files are moved one by one, the record last; if the process is killed meanwhile, the next
    start completes the moves. Hidden folders are locked (:mod:`cad.whole_file`).
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from cad.errors import FileError
from cad.whole_file import MEDIUM_FULL, lock_if_free, locked_folder, remove_partial

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)  # ignored while files are moved


@contextmanager
def whole_folder(final: Path, record: str, check_interrupt: Callable[[], None] = lambda: None) -> Iterator[Path]:
    """Yield a folder to fill, whose files are moved to ``final`` at the end, or removed after an exception.

    Args:
        final: final folder of the files; the user's own files in it remain.
        record: name of the JSON file that lists the others (:func:`write_record`); it must be in the folder.
        check_interrupt: called after all files are written and before any appears; if it raises, nothing is published.

    Raises:
        FileError: the folder cannot be written, the disk is full, or a file to be replaced is the user's; the earlier
            content of ``final`` is unchanged.
    """
    with _as_file_error(final):
        final = final.resolve()
        final.parent.mkdir(parents=True, exist_ok=True)
        sweep(final, record)
        require_ours(final, record)
        partial, lock = locked_folder(final)
    try:
        with _as_file_error(final):
            yield partial
            check_interrupt()
            with _uninterrupted():
                _publish(partial, final, record)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
        os.close(lock)


def write_record(folder: Path, name: str, content: Mapping[str, Any]) -> None:
    """Write a folder's record: ``content``, and under ``files`` the SHA-256 of every other file in the folder.

    Args:
        folder: the recorded folder.
        name: name of the record's file in it.
        content: other content of the record, plain JSON.
    """
    files = {path: file_sha256(folder / path) for path in _files_in(folder) if path != name}
    (folder / name).write_text(json.dumps({**content, "files": files}, indent=1) + "\n", encoding="utf-8")


def listed_files(folder: Path, record: str) -> dict[str, str]:
    """Files that a record lists, path inside the folder -> SHA-256; empty where there is no record.

    Raises:
        FileError: the record cannot be read, or names a path outside its folder.
    """
    path = folder / record
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        lists = [content.get("files", {}), *(part.get("files", {}) for part in content.get("parts", []))]
        files = {str(name): str(digest) for files in lists for name, digest in files.items()}
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise FileError(
            f"{path}: cannot be read as the list of files written before ({error}): move {folder} elsewhere"
        ) from error
    for name in files:
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts or not name:
            raise FileError(f"{path}: lists {name!r}, which is outside its folder: move {folder} elsewhere")
    return files


def require_ours(final: Path, record: str) -> dict[str, str]:
    """Files that an earlier run wrote to a folder and that this run may replace, path -> SHA-256.

    Raises:
        FileError: the user has changed one of them, or the path is not a folder.
    """
    if final.exists() and not final.is_dir():
        raise FileError(f"{final}: is a file where a folder belongs: rename it, or name another place with exports=DIR")
    listed = {name: digest for name, digest in listed_files(final, record).items() if (final / name).exists()}
    for name, digest in listed.items():
        if file_sha256(final / name) != digest:
            raise FileError(
                f"{final / name}: changed since it was written (SHA-256 differs from {record}): rename it to keep it, "
                "or delete it, then run again; nothing was replaced"
            )
    return listed


def sweep(final: Path, record: str) -> None:
    """Clean up after killed runs next to a folder: remove partial folders, and move the files of ready ones."""
    remove_partial(final.parent)
    for path in sorted(final.parent.glob(f".{final.name}.ready-*")):
        with lock_if_free(path) as is_free:
            if is_free:
                _move_in(path, final, record)


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, as hex digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _publish(partial: Path, final: Path, record: str) -> None:
    """Give a filled folder its final name, or move its files into the existing folder."""
    try:
        partial.rename(final)  # possible if ``final`` is missing or an empty folder
        return
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
    other = os.open(final, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(other, fcntl.LOCK_EX)  # serialises two runs that end at the same time
        listed = require_ours(final, record)
        for name in _files_in(partial):
            if name not in listed and name != record and (final / name).exists():
                raise FileError(f"{final / name}: not listed in {record}, so it is yours: rename it, then run again")
        ready = partial.with_name(partial.name.replace(".partial-", ".ready-"))
        partial.rename(ready)
        _move_in(ready, final, record)
    finally:
        os.close(other)


def _move_in(ready: Path, final: Path, record: str) -> None:
    """Move a checked folder's files into place, the record last; after a kill, a repeated call continues."""
    final.mkdir(exist_ok=True)
    if (ready / record).exists():
        for name in listed_files(final, record).keys() - listed_files(ready, record).keys():
            (final / name).unlink(missing_ok=True)
        for name in sorted(_files_in(ready), key=lambda name: name == record):
            (final / name).parent.mkdir(parents=True, exist_ok=True)
            (ready / name).replace(final / name)
    shutil.rmtree(ready)


def _files_in(folder: Path) -> list[str]:
    """Paths of all files in a folder, relative to it."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Context in which the ending signals are ignored; moving the files takes a few milliseconds."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, lambda *_: None) for number in ENDING_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _as_file_error(final: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        full, reason = error.errno in MEDIUM_FULL, error.strerror or str(error)
        if _is_elsewhere(error.filename, final):
            remedy = "free some space there" if full else "make it readable, or install the toolkit again"
            raise FileError(f"{error.filename}: {reason}: {remedy}") from error
        remedy = "free some space or " if full else ""
        raise FileError(f"{final}: {reason}: {remedy}name another folder with exports=DIR") from error


def _is_elsewhere(name: object, final: Path) -> bool:
    """Whether an error's file is neither next to a folder nor above it: another exports folder does not help then."""
    if not isinstance(name, (str, os.PathLike)):
        return False
    path, exports = Path(name).resolve(), final.resolve().parent
    return not path.is_relative_to(exports) and not exports.is_relative_to(path)
