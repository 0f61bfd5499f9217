"""Remove files of exports/ that a command makes again, and list the rest: make clean, make clean-all SURE=yes.

A file is removed if the record of its folder (manifest.json, slice.json and the like) lists it with the SHA-256 that it
still has. Recordings, data sets, weights, notes, G-code and changed files are on no such list, so they stay.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from cad.errors import FileError
from cad.messages import LOG, show
from cad.typed_folder import EXPORTS
from cad.whole_file import lock_if_free, remove_partial
from fab.cache import Cache
from fab.exports.whole_folder import file_sha256, listed_files, sweep

RECORDS = ("manifest.json", "slice.json", "sheet.json", "coupons.json", "led_ring.json", "robot_model.json")
KEPT = {Path(EXPORTS) / "README.md"}  # under version control
LINES = 12  # of what stays


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m fab.clean", description=__doc__)
    parser.add_argument("--all", action="store_true", help="the rest of exports/ too: recordings, data, weights, yours")
    parser.add_argument("--sure", action="store_true", help="really")
    parser.add_argument("--exports", type=Path, default=Path(EXPORTS), help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    try:
        return _clean_all(options.exports, options.sure) if options.all else _clean(options.exports)
    except OSError as error:  # not ours to remove, a disk that can only be read
        LOG.error(f"make clean: {error.filename}: {error.strerror}: it stays, and what would have come after it")
        return 2
    except KeyboardInterrupt:
        LOG.error("make clean: interrupted; what it has not removed yet stays")
        return 130


def _clean(exports: Path) -> int:
    """Remove files that a command makes again, and list the rest; return the exit status."""
    count = remove_made(exports)
    Cache().clear()
    show(f"make clean: {count} files removed from {exports}")
    _print_staying(exports, "to delete these too: make clean-all SURE=yes")
    return 0


def _clean_all(exports: Path, is_sure: bool) -> int:
    """Remove everything, or list it if the user is not sure; return the exit status."""
    if not is_sure:
        show(f"make clean-all: would delete everything in {exports}, also what no command makes again:")
        _print_staying(exports, "to delete it: make clean-all SURE=yes")
        return 2
    for path in sorted(exports.iterdir()) if exports.is_dir() else []:
        if path not in KEPT:
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    return 0


def remove_made(exports: Path) -> int:
    """Remove every unchanged file that a record lists, the records, and the folders that are then empty.

    A folder that a running command has locked stays as it is.

    Args:
        exports: folder of export folders.

    Returns:
        Number of files removed.
    """
    count = 0
    remove_partial(exports)
    for record in _records(exports):
        with lock_if_free(record.parent) as is_free:
            if not is_free:
                continue
            try:
                removed = _remove_listed(record)
            except FileError as error:
                LOG.error(f"make clean: {error}")
                continue
        for folder in {path.parent for path in removed}:
            _remove_emptied(folder, exports)
        count += len(removed)
    return count


def _remove_listed(record: Path) -> list[Path]:
    """Remove the unchanged files that a record lists, then the record unless a file was changed; return those removed.

    A record without remaining files is removed only if it is that of a design: another program's may look alike.

    Raises:
        FileError: the record cannot be read.
    """
    folder = record.parent
    sweep(folder, record.name)
    listed = listed_files(folder, record.name)
    removed = []
    for name, digest in listed.items():
        path = folder / name
        if path.is_file() and not path.is_symlink() and file_sha256(path) == digest:
            path.unlink()
            removed.append(path)
    changed = any((folder / name).exists() for name in listed)
    if listed and not changed and (removed or _is_of_a_design(record)):
        record.unlink()
        removed.append(record)
    return removed


def _is_of_a_design(record: Path) -> bool:
    """Whether a readable record has what ``make molds`` writes into its manifest."""
    return json.loads(record.read_text(encoding="utf-8")).keys() >= {"digest", "parameters"}


def _remove_emptied(folder: Path, exports: Path) -> None:
    """Remove a folder of removed files, and the folders above it, as long as they are empty and unlocked."""
    for path in (folder, *folder.parents):
        if path == exports or not path.exists():
            return
        with lock_if_free(path) as is_free:
            if not is_free or any(path.iterdir()):
                return
            path.rmdir()


def _records(exports: Path) -> list[Path]:
    """Records of all export folders, without the hidden folders of running commands."""
    found = (path for name in RECORDS for path in exports.rglob(name) if path.is_file())
    return sorted(p for p in found if not any(part.startswith(".") for part in p.relative_to(exports).parts))


def _print_staying(exports: Path, remedy: str) -> None:
    """Print a line with the size of each remaining entry of the folder."""
    entries = [path for path in sorted(exports.iterdir()) if path not in KEPT] if exports.is_dir() else []
    for path in entries[:LINES]:
        files = [file for file in path.rglob("*") if file.is_file()] if path.is_dir() else [path]
        size = sum(file.lstat().st_size for file in files) / 1e6
        what = f"{path.name}/ ({len(files)} files)" if path.is_dir() else path.name
        show(f"  stays: {what}, {size:.1f} MB")
    if len(entries) > LINES:
        show(f"  stays: {len(entries) - LINES} more")
    if entries:
        show(f"  {remedy}")


if __name__ == "__main__":
    sys.exit(main())
