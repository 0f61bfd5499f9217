"""Cache of results of earlier runs in the user's folder, by a digest of everything that they depend on.

The key of an entry is the SHA-256 of its parameters, of the code, tables and pages of cad and fab, and of the versions
of the libraries, so a change in any of them makes a new entry. Files are stored under their own SHA-256, which is
checked when they are read: a damaged file counts as missing and is made again. Standard library only.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import re
import shutil
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from cad.extras import DISTRIBUTION
from cad.user_folders import cache_folder
from cad.whole_file import put_file

ROOT = Path(__file__).resolve().parents[1]
LIMIT_BYTES = 2_000_000_000  # some 25 designs
SOURCES = ("cad", "fab")
SUFFIXES = (".py", ".csv", ".js", ".css", ".html")  # all sources of the exports, pages included


def user_folder() -> Path:
    """Folder of the cache: ``$XDG_CACHE_HOME/endcap-toolkit/molds``, by default under ``~/.cache``."""
    return cache_folder() / "molds"


@cache
def code_digest(root: Path = ROOT) -> str:
    """SHA-256 of the code, tables and pages that make a design, and of the versions of the libraries.

    Args:
        root: folder of the packages.
    """
    digest = hashlib.sha256()
    for path in sorted(p for name in SOURCES for p in (root / name).rglob("*") if p.suffix in SUFFIXES):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{path.relative_to(root).as_posix()} {content}\n".encode())
    for name, version in library_versions(root).items():
        digest.update(f"{name} {version}\n".encode())
    return digest.hexdigest()


def library_versions(root: Path = ROOT) -> dict[str, str]:
    """Installed versions of this toolkit, of the libraries required by the CAD side, and of Python.

    Args:
        root: folder of the packages.
    """
    names = sorted({DISTRIBUTION, *(re.split(r"[^A-Za-z0-9._-]", line)[0] for line in _required(root))})
    versions = {"python": f"{platform.python_version()} {platform.system()} {platform.machine()}"}
    for name in names:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "absent"
    return versions


def _required(root: Path) -> list[str]:
    """Requirements of the CAD side, from pyproject.toml in a checkout; a wheel does not contain that file."""
    if (root / "pyproject.toml").exists():
        wanted = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        return [*wanted["dependencies"], *wanted["optional-dependencies"]["cad"]]
    lines = metadata.requires(DISTRIBUTION) or []
    return [line for line in lines if "extra ==" not in line or re.search(r"extra == ['\"]cad['\"]", line)]


@dataclass(frozen=True)
class Cache:
    """Entries, each a set of files and values under one key.

    A cache that cannot be read or written counts as empty: no run fails because of it.

    Attributes:
        folder: of the cache.
        limit_bytes: largest size after a new entry; the least recently used entries are removed.
    """

    folder: Path = field(default_factory=user_folder)
    limit_bytes: int = LIMIT_BYTES

    def key(self, what: str, parameters: Mapping[str, Any]) -> str:
        """Digest of a name, its parameters, the code and the libraries.

        Args:
            what: name of the result.
            parameters: that it depends on.
        """
        content = {"what": what, "parameters": dict(parameters), "code": code_digest()}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def read(self, key: str) -> tuple[dict[str, bytes], dict[str, Any]] | None:
        """An entry's files, name -> content, and its values; ``None`` where there is none or a part of it is damaged.

        A damaged entry is removed.

        Args:
            key: of the entry.
        """
        path = self._entry(key)
        try:
            entry = json.loads(path.read_text(encoding="utf-8"))
            if entry["digest"] != _digest(entry["content"]):
                raise ValueError("damaged")
            files = {name: self._content(name, sha256) for name, sha256 in entry["content"]["files"].items()}
            values = dict(entry["content"]["values"])
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            with suppress(OSError):
                path.unlink()
            return None
        with suppress(OSError):  # a cache that this user may only read
            os.utime(path)
        return files, values

    def restore(self, key: str, folder: Path) -> dict[str, Any] | None:
        """Write an entry's files into a folder, once all of them have been read.

        Args:
            key: of the entry.
            folder: receives the files.

        Returns:
            The entry's values; ``None`` where there is no such entry or a part of it is damaged.

        Raises:
            OSError: the folder cannot be written; it then contains none of the files, and the entry stays.
        """
        if (entry := self.read(key)) is None:
            return None
        files, values = entry
        try:
            for name, data in files.items():
                (folder / name).write_bytes(data)
        except OSError:
            for name in files:
                (folder / name).unlink(missing_ok=True)
            raise
        return values

    def keep(self, key: str, files: Mapping[str, bytes], values: Mapping[str, Any]) -> None:
        """Store files and values under a key.

        Args:
            key: of the entry.
            files: name -> content.
            values: content that JSON can represent.
        """
        try:
            with self._alone():
                digests = {name: hashlib.sha256(data).hexdigest() for name, data in files.items()}
                for name, data in files.items():
                    blob = self._blob(digests[name])
                    if not (blob.exists() and blob.read_bytes() == data):  # replaces a damaged one
                        _write(blob, data)
                content = {"files": digests, "values": dict(values)}
                _write(self._entry(key), json.dumps({"digest": _digest(content), "content": content}).encode())
                self._trim()
        except OSError:
            return  # a full disk, or a home that cannot be written: the next run works without

    def store(self, key: str, folder: Path, names: Sequence[str], values: Mapping[str, Any]) -> None:
        """Store files of a folder, and values, under a key.

        Args:
            key: of the entry.
            folder: with the files.
            names: of the files in the folder.
            values: content that JSON can represent.
        """
        try:
            files = {name: (folder / name).read_bytes() for name in names}
        except OSError:
            return
        self.keep(key, files, values)

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Context of one process at a time: another one's trimming would remove files that no entry names yet."""
        self.folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(lock, fcntl.LOCK_EX)
            yield
        finally:
            os.close(lock)

    def _trim(self) -> None:
        """Remove the least recently used entries until the rest is small enough, and files that no entry names."""
        entries = sorted((self.folder / "entries").glob("*.json"), key=lambda path: path.stat().st_mtime, reverse=True)
        kept: dict[str, int] = {}
        for path in entries:
            try:
                named = set(json.loads(path.read_text(encoding="utf-8"))["content"]["files"].values())
                sizes = {sha256: self._blob(sha256).stat().st_size for sha256 in named}
            except (OSError, ValueError, KeyError, TypeError, AttributeError):
                sizes = {"": self.limit_bytes + 1}
            if sum({**kept, **sizes}.values()) > self.limit_bytes:
                path.unlink(missing_ok=True)
            else:
                kept |= sizes
        for blob in (self.folder / "files").glob("*"):
            if blob.name not in kept:
                blob.unlink(missing_ok=True)

    def clear(self) -> None:
        """Remove all entries."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _content(self, name: str, sha256: str) -> bytes:
        """Content of a file of an entry.

        Raises:
            ValueError: the file is damaged, or its name is a path to another folder.
            OSError: the file cannot be read.
        """
        data = self._blob(sha256).read_bytes()
        if hashlib.sha256(data).hexdigest() != sha256 or Path(name).name != name:
            self._blob(sha256).unlink()
            raise ValueError("damaged")
        return data

    def _entry(self, key: str) -> Path:
        return self.folder / "entries" / f"{key}.json"

    def _blob(self, sha256: str) -> Path:
        return self.folder / "files" / Path(sha256).name


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _write(path: Path, data: bytes) -> None:
    """Write under a temporary name, then rename."""
    path.parent.mkdir(parents=True, exist_ok=True)
    put_file(path, data)
