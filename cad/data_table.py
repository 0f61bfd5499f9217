"""Reader of CSV tables with one record per row; errors name file, line and row. Also turns row names into file names.

Standard library only.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from cad.errors import EndcapError, FileError

Record = TypeVar("Record")
FORM = "fill every column, numbers as plain decimals, or remove the row"
LOST_IN_FILES = re.compile(r"[^A-Za-z0-9._ -]")  # characters of a name that a file name does not keep
DIGEST_DIGITS = 8  # hexadecimal digits of SHA-256 that make a file name unique


def read_table(path: Path, make: Callable[[dict[str, str]], Record], *key: str) -> dict[str, Record]:
    """Read a table; the records keep the order of its rows.

    Args:
        path: CSV file in UTF-8 whose first line names the columns; the byte order mark that spreadsheets write is
            ignored.
        make: makes a record from a row; raises ``ValueError`` for a value that cannot be read.
        key: columns that together identify a row; by default ``name``. No two rows may have the same key, and no two
            names may differ only in case, or only in spaces, hyphens and underscores, since users type them and files
            are named after them.

        Returns:
            Key of the row -> record.

    Raises:
        FileError: the file is missing or unreadable, a column is missing, or a row is bad; the message names its line.
    """
    records: dict[str, Record] = {}
    spelled: dict[tuple[str, str], str] = {}
    columns = key or ("name",)
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.DictReader(stream)
            _require_columns(path.name, reader.fieldnames or ())
            for row in reader:
                names = [row.get(column) or "" for column in columns]
                where = f"{path.name} line {reader.line_num} ({' '.join(filter(None, names)) or 'without a name'})"
                if None in row or None in row.values() or not all(names):
                    raise FileError(f"{where}: has not one value for each column of the first line: {FORM}")
                if (name := " ".join(names)) in records:
                    raise FileError(f"{where}: is there twice: remove one of the two rows")
                if any(text != text.strip() for text in names):
                    raise FileError(f"{where}: has spaces before or after its name: remove them")
                _require_one_spelling(where, dict(zip(columns, names, strict=True)), spelled)
                records[name] = _record(where, path.name, row, make)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path.name}: cannot be read as a table ({error}): restore it") from error
    if not records:
        raise FileError(f"{path.name}: has no row: restore it")
    return records


def _require_columns(file: str, columns: Sequence[str]) -> None:
    """Refuse a first line in which a spreadsheet has lost the columns, or that names one of them twice."""
    if len(columns) == 1 and (";" in columns[0] or "\t" in columns[0]):
        raise FileError(
            f"{file}: has semicolons or tabs between its columns: save it with commas, and decimals with points"
        )
    for column in columns:
        if columns.count(column) > 1:
            raise FileError(f"{file}: the first line has the column {column!r} twice: remove one of the two")


def _require_one_spelling(where: str, names: dict[str, str], spelled: dict[tuple[str, str], str]) -> None:
    """Refuse a name that a row above spells differently, and record this row's spelling.

    Args:
        where: file, line and row, for the message.
        names: column -> text of this row.
        spelled: (column, normalised text) -> text in the rows above; receives this row's.
    """
    for column, text in names.items():
        if (other := spelled.setdefault((column, _normalised(text)), text)) != text:
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
    """Name of a row as part of a file name, unique within a table: ``Dragon-Skin-30``.

    A hyphen replaces spaces and underscores; no two names of a table differ in these alone (:func:`read_table`). Where
    a name has characters other than these and ASCII letters, digits, dot and hyphen, digits of its SHA-256 are
    appended, because two names in another script would otherwise give the same file name.

    Args:
        name: name of the row.
    """
    kept = re.sub(r"[^A-Za-z0-9.-]+", "-", name)
    if not LOST_IN_FILES.search(name):
        return kept
    digest = hashlib.sha256(name.encode()).hexdigest()[:DIGEST_DIGITS]
    return f"{kept.strip('-')}-{digest}".lstrip("-")


def _normalised(name: str) -> str:
    """Normalised name: without the differences that are ignored in typed names and lost in folder names."""
    return re.sub(r"[ _-]+", "-", name).lower()


def positive(row: dict[str, str], column: str) -> float:
    """Read a positive number from a row.

    Raises:
        ValueError: the cell does not hold a positive number.
    """
    value = _finite(row[column])
    if not value > 0:
        raise ValueError(f"{column}={row[column]!r} is not a positive number")
    return value


def number(row: dict[str, str], column: str) -> float:
    """Read a finite number from a row.

    Raises:
        ValueError: the cell does not hold a finite number.
    """
    value = _finite(row[column])
    if math.isnan(value):
        raise ValueError(f"{column}={row[column]!r} is not a number")
    return value


def _finite(text: str) -> float:
    """The finite number that a text holds in plain decimals; nan for any other text."""
    if "_" in text or not text.isascii():  # 1_8 and digits of other scripts, which float takes
        return math.nan
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan
