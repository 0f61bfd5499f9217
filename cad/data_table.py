"""Data files: CSV with one row a record; whatever is wrong is named by file, line and row."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from cad.errors import EndcapError, FileError

Record = TypeVar("Record")
FORM = "fill every column, numbers as plain decimals, or remove the row"


def read_table(path: Path, make: Callable[[dict[str, str]], Record], *key: str) -> dict[str, Record]:
    """Read a table, in its order.

    Args:
        path: CSV file whose first line names the columns.
        make: makes a record of a row; raises ``ValueError`` for a value that cannot be read.
        key: columns that together name a row, ``name`` without any; no two rows may have the same.

    Raises:
        FileError: a missing or unreadable file, a missing column, or a bad row, named by its line.
    """
    records: dict[str, Record] = {}
    columns = key or ("name",)
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream)
            for row in reader:
                names = [row.get(column) or "" for column in columns]
                where = f"{path.name} line {reader.line_num} ({' '.join(filter(None, names)) or 'without a name'})"
                if None in row or None in row.values() or not all(names):
                    raise FileError(f"{where}: has not one value for each column of the first line: {FORM}")
                if (name := " ".join(names)) in records:
                    raise FileError(f"{where}: is there twice: remove one of the two rows")
                records[name] = _record(where, path.name, row, make)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path.name}: cannot be read as a table ({error}): restore it") from error
    return records


def _record(where: str, file: str, row: dict[str, str], make: Callable[[dict[str, str]], Record]) -> Record:
    try:
        return make(row)
    except KeyError as error:
        raise FileError(f"{file}: the first line has no column {error}: restore it") from error
    except (ValueError, EndcapError) as error:
        raise FileError(f"{where}: {error}: {FORM}") from error


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
