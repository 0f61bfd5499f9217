"""Data files: CSV with one row a record; whatever is wrong is named by file, line and row. Names of rows as files."""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from cad.errors import EndcapError, FileError

Record = TypeVar("Record")
FORM = "fill every column, numbers as plain decimals, or remove the row"
LOST_IN_FILES = re.compile(r"[^A-Za-z0-9._ -]")  # characters of a name that a file name has not
DIGEST_DIGITS = 8


def read_table(path: Path, make: Callable[[dict[str, str]], Record], *key: str) -> dict[str, Record]:
    """Read a table, in its order.

    Args:
        path: CSV file in UTF-8 whose first line names the columns; a byte order mark, as spreadsheets write it, is
            left out.
        make: makes a record of a row; raises ``ValueError`` for a value that cannot be read.
        key: columns that together name a row, ``name`` without any; no two rows may have the same, and no two names
            may differ in case, or in spaces, hyphens and underscores, alone: either is typed, and names files.

    Raises:
        FileError: a missing or unreadable file, a missing column, or a bad row, named by its line.
    """
    records: dict[str, Record] = {}
    spelled: dict[tuple[str, str], str] = {}
    columns = key or ("name",)
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            for row in reader:
                names = [row.get(column) or "" for column in columns]
                where = f"{path.name} line {reader.line_num} ({' '.join(filter(None, names)) or 'without a name'})"
                if None in row or None in row.values() or not all(names):
                    raise FileError(f"{where}: has not one value for each column of the first line: {FORM}")
                if (name := " ".join(names)) in records:
                    raise FileError(f"{where}: is there twice: remove one of the two rows")
                _require_one_spelling(where, dict(zip(columns, names, strict=True)), spelled)
                records[name] = _record(where, path.name, row, make)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path.name}: cannot be read as a table ({error}): restore it") from error
    return records


def _require_one_spelling(where: str, names: dict[str, str], spelled: dict[tuple[str, str], str]) -> None:
    """Refuse a name (column -> text) that rows above spell otherwise; ``spelled`` has theirs, and takes this row's."""
    for column, text in names.items():
        if (other := spelled.setdefault((column, _alike(text)), text)) != text:
            raise FileError(
                f"{where}: {column}={text!r} differs from {other!r}, in a row above it, in case or in spaces, hyphens "
                "and underscores alone: names are typed in any case, and folders have hyphens: rename one of the two"
            )


def _record(where: str, file: str, row: dict[str, str], make: Callable[[dict[str, str]], Record]) -> Record:
    try:
        return make(row)
    except KeyError as error:
        raise FileError(f"{file}: the first line has no column {error}: restore it") from error
    except (ValueError, EndcapError) as error:
        raise FileError(f"{where}: {error}: {FORM}") from error


def file_name(name: str) -> str:
    """The name of a row as part of a file name, another for every row of a table: ``Dragon-Skin-30``.

    A hyphen stands for spaces and underscores, in which alone no two names differ (:func:`read_table`). A name with
    other characters than those and ASCII letters, digits, dot and hyphen ends with digits of its SHA-256: without
    them, two names in another script would be one.

    Args:
        name: of the row.
    """
    kept = re.sub(r"[^A-Za-z0-9.-]+", "-", name)
    if not LOST_IN_FILES.search(name):
        return kept
    digest = hashlib.sha256(name.encode()).hexdigest()[:DIGEST_DIGITS]
    return f"{kept.strip('-')}-{digest}".lstrip("-")


def _alike(name: str) -> str:
    """A name without what does not count where it is typed, nor where it names a folder."""
    return re.sub(r"[ _-]+", "-", name).lower()


def positive(row: dict[str, str], column: str) -> float:
    """A positive number of a row.

    Raises:
        ValueError: it is none.
    """
    value = _finite(row[column])
    if not value > 0:
        raise ValueError(f"{column}={row[column]!r} is not a positive number")
    return value


def number(row: dict[str, str], column: str) -> float:
    """A finite number of a row.

    Raises:
        ValueError: it is none.
    """
    value = _finite(row[column])
    if math.isnan(value):
        raise ValueError(f"{column}={row[column]!r} is not a number")
    return value


def _finite(text: str) -> float:
    """The number; nan for everything else."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan
