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


def read_table(path: Path, make: Callable[[dict[str, str]], Record], key: str = "name") -> dict[str, Record]:
    """Read a table, in its order.

    Args:
        path: CSV file whose first line names the columns.
        make: makes a record of a row; raises ``ValueError`` for a value that cannot be read.
        key: column that names a row; no two rows may have the same.

    Raises:
        FileError: a missing or unreadable file, a missing column, or a bad row, named by its line.
    """
    records: dict[str, Record] = {}
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream)
            for row in reader:
                where = f"{path.name} line {reader.line_num} ({row.get(key) or 'without a name'})"
                if None in row or None in row.values() or not row.get(key):
                    raise FileError(f"{where}: has not one value for each column of the first line: {FORM}")
                if row[key] in records:
                    raise FileError(f"{where}: is there twice: remove one of the two rows")
                records[row[key]] = _record(where, path.name, row, make)
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
    try:
        value = float(row[column])
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{column}={row[column]!r} is not a positive number")
    return value
