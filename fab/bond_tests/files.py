"""Reader of load-displacement records that testing machines export as CSV (Instron Bluehill and similar).

A file has any rows of parameters and results, then one row of column names, then numbers to the end. Names are English
or German; units stand in the same row (``Load (N)``, ``Load [N]``, ``Load / N``, ``Load_N``, ``Kraft in N``) or in the
row below (``(N)``, ``N``). Empty lines are ignored. Columns are separated by comma, semicolon or tab; a decimal comma
is read where the columns are not separated by commas. A row whose first cell is ``Failure``, ``Failure type`` or
``Failure mode``, alone or with a colon, marks how the specimen failed (``Failure type : material``,
``Failure,material``); a failure load or criterion is ignored like the other rows. Values are converted to millimetres,
newtons and seconds.
"""

from __future__ import annotations

import codecs
import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cad.errors import FileError

NAMES = {
    "time_s": ("time", "test time", "zeit", "prüfzeit"),
    "displacement_mm": (
        "extension",
        "displacement",
        "crosshead",
        "position",
        "stroke",
        "travel",
        "weg",
        "traversenweg",
        "verschiebung",
        "verlängerung",
    ),
    "load_n": ("load", "force", "kraft", "prüfkraft", "standardkraft"),
}
UNITS = {
    "time_s": {"s": 1.0, "sec": 1.0, "min": 60.0, "ms": 1e-3},
    "displacement_mm": {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4},
    "load_n": {"n": 1.0, "kn": 1000.0, "lbf": 4.4482216152605, "kgf": 9.80665},
}
FAILURES = ("adhesive", "cohesive", "material", "mixed")
UNIT_CELL = re.compile(r"[(\[]([^()\[\]]*)[)\]]")
UNIT_WORDS = "|".join(sorted({word for known in UNITS.values() for word in known}))
UNIT_END = re.compile(rf"(?:\s*/\s*|_|\s+in\s+)({UNIT_WORDS})$", re.IGNORECASE)  # "Load / N", "Load_N", "Kraft in N"
FAILURE_CELL = re.compile(r"failure(?:\s+(?:type|mode))?\s*(?::\s*(.*))?")
LEAST_ROWS = 20
GAP = "a gap in the record; test again"
TEXT = "only rows of numbers may follow the column names: delete rows of text among or below them"
GAP_RATIO = 8.0  # a step over this many median steps is a gap in the record
BACK_MM = 0.5  # largest backward motion of the crosshead: its play
FLAT_SHARE = 0.2  # largest negative load, as a share of the largest load: zero drift and a swinging grip


@dataclass(frozen=True)
class Record:
    """Record of one specimen.

    Attributes:
        path: its file.
        displacement_mm: (n,) crosshead displacement from the first row, mm.
        load_n: (n,) load, positive in tension, N.
        time_s: (n,) time of the machine, s, or None where the file has none.
        failure: one of :data:`FAILURES`, or an empty string where the failure is not marked.
    """

    path: Path
    displacement_mm: np.ndarray
    load_n: np.ndarray
    time_s: np.ndarray | None
    failure: str


def read_record(path: Path) -> Record:
    """Read and check one file.

    Args:
        path: of a CSV file.

    Raises:
        FileError: no columns of displacement and load, an unknown unit, a gap, a reversed sign, a row of text among or
            below the numbers; the message names file and line.
    """
    rows = _rows(path)
    failure = _failure(path, rows)
    head, columns, first = _columns(path, rows)
    values, lines = _numbers(path, rows, head, columns, first)
    data = {name: values[:, k] * factor for k, (name, (_, factor)) in enumerate(columns.items())}
    _require_steady(path, data, lines)
    _require_tension(path, data, lines)
    start = data["displacement_mm"][0]
    return Record(path, data["displacement_mm"] - start, data["load_n"], data.get("time_s"), failure)


def _rows(path: Path) -> list[list[str]]:
    """Cells of every line, with decimal points."""
    lines = _text(path).splitlines()
    mark = max(";\t,", key=lambda sign: sum(line.count(sign) > 0 for line in lines)) if lines else ","
    if sum(";" in line for line in lines) * 2 > len(lines):
        mark = ";"
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=mark)]
    if mark != ",":
        rows = [[re.sub(r"^([+-]?\d+),(\d+)", r"\1.\2", cell) for cell in row] for row in rows]
    return rows


def _text(path: Path) -> str:
    """Text of a file in UTF-8, or in UTF-16 or the Windows code page, which programs under Windows write."""
    try:
        data = path.read_bytes()
        if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return data.decode("utf-16")
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError:
            return data.decode("cp1252")
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: cannot be read as text ({error}): export it as CSV, UTF-8") from error


def _failure(path: Path, rows: list[list[str]]) -> str:
    """Marked kind of failure; an empty string where no row marks it."""
    for number, row in enumerate(rows, start=1):
        found = FAILURE_CELL.fullmatch(row[0].lower()) if row else None
        kind = (found[1] or (row[1].lower() if len(row) > 1 else "")) if found else ""
        if kind:
            if kind not in FAILURES:
                raise FileError(f"{path}:{number}: failure={kind} is not one of {', '.join(FAILURES)}: correct the row")
            return kind
    return ""


def _columns(path: Path, rows: list[list[str]]) -> tuple[int, dict[str, tuple[int, float]], int]:
    """Row of the names, columns with their factors to mm, N and s, and first row of the numbers."""
    for number, row in enumerate(rows):
        places = {name: _place(row, words) for name, words in NAMES.items()}
        if places["displacement_mm"] is None or places["load_n"] is None:
            continue
        after = next((k for k in range(number + 1, len(rows)) if any(rows[k])), len(rows))
        below = rows[after] if after < len(rows) else []
        units_below = bool(below) and all(_number(cell) is None for cell in below)
        columns = {}
        for name, place in places.items():
            if place is not None:
                line = after + 1 if units_below else number + 1
                cell = below[place] if units_below and place < len(below) else row[place]
                columns[name] = (place, _factor(path, line, name, row[place], cell))
        return number, columns, after + 1 if units_below else after
    raise FileError(
        f"{path}: no row names a displacement ({', '.join(NAMES['displacement_mm'])}) and a load "
        f"({', '.join(NAMES['load_n'])}): export the raw data with column names"
    )


def _place(row: list[str], words: tuple[str, ...]) -> int | None:
    """Index of the first cell that is one of the names, without its unit; None where no cell is."""
    for k, cell in enumerate(row):
        plain = UNIT_END.sub("", UNIT_CELL.sub("", cell).strip()).lower()
        if any(plain == word or plain.endswith(f" {word}") for word in words):
            return k
    return None


def _factor(path: Path, line: int, name: str, title: str, cell: str) -> float:
    """Factor from the unit of a column to mm, N or s."""
    units = UNIT_CELL.findall(cell)  # the last: "Displacement (Strain 1) (mm)" names the gauge first
    end = UNIT_END.search(cell)
    word = (units[-1] if units else end[1] if end else cell).strip().lower()
    known = UNITS[name]
    if word not in known:
        raise FileError(
            f"{path}:{line}: unit {word!r} of column {title!r} is not one of {', '.join(known)}: export "
            f"{name.split('_')[0]} in one of them"
        )
    return known[word]


def _numbers(
    path: Path, rows: list[list[str]], head: int, columns: dict[str, tuple[int, float]], first: int
) -> tuple[np.ndarray, list[int]]:
    """Numbers (n, columns) in the file's own units, and the line of each row."""
    values, lines = [], []
    for number in range(first, len(rows)):
        if not any(rows[number]):
            continue
        row = []
        for place, _ in columns.values():
            cell = rows[number][place] if place < len(rows[number]) else ""
            value = _number(cell)
            if value is None:
                title = rows[head][place]
                raise FileError(f"{path}:{number + 1}: {title}={cell!r} is no number: {_remedy(cell, rows[number])}")
            row.append(value)
        values.append(row)
        lines.append(number + 1)
    if len(values) < LEAST_ROWS:
        raise FileError(f"{path}: {len(values)} rows of numbers, at least {LEAST_ROWS} are needed: export the raw data")
    return np.array(values), lines


def _remedy(cell: str, row: list[str]) -> str:
    """Cause and remedy of a cell that is no number.

    Args:
        cell: its text.
        row: all cells of its line.
    """
    is_word = any(sign.isalpha() for sign in cell) and cell.lower() != "nan"
    if is_word or all(_number(other) is None for other in row):
        return TEXT
    return "export a decimal point, nothing between thousands" if "," in cell else GAP


def _number(cell: str) -> float | None:
    """Finite number in a cell; None for anything else."""
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _require_steady(path: Path, data: dict[str, np.ndarray], lines: list[int]) -> None:
    """Refuse gaps and backward steps of displacement and, where the file has it, of time."""
    for name in ("time_s", "displacement_mm"):
        if name not in data:
            continue
        steps = np.diff(data[name])
        back = BACK_MM if name == "displacement_mm" else 0.0
        low = np.maximum.accumulate(data[name])[:-1] - data[name][1:]
        if name == "displacement_mm" and data[name][-1] < data[name][0]:
            raise FileError(
                f"{path}:{lines[-1]}: displacement ends at {data[name][-1]:g} mm, below its start: its sign is "
                "reversed; export extension positive in tension"
            )
        if (low > back).any():
            at = int(np.argmax(low > back)) + 1
            raise FileError(f"{path}:{lines[at]}: {name} runs backwards: rows are out of order or two tests are joined")
        usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
        if usual and (steps > GAP_RATIO * usual).any():
            at = int(np.argmax(steps > GAP_RATIO * usual)) + 1
            raise FileError(
                f"{path}:{lines[at]}: {name} jumps by {steps[at - 1]:g} where {usual:g} is usual: a gap in the record; "
                "export every row"
            )


def _require_tension(path: Path, data: dict[str, np.ndarray], lines: list[int]) -> None:
    """Refuse a load that is negative, or never positive."""
    load = data["load_n"]
    low, high = float(load.min()), float(load.max())
    if -low > FLAT_SHARE * max(high, 0.0) and low < 0:
        raise FileError(
            f"{path}:{lines[int(load.argmin())]}: load of {low:g} N against at most {high:g} N: the sign is reversed; "
            "export load positive in tension"
        )
    if high <= 0:
        raise FileError(f"{path}: the load is never above 0 N: balance the load cell and export it again")
