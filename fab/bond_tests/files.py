"""Read what a testing machine exports: load against crosshead displacement, as CSV (Instron Bluehill and alike).

A file has rows of anything (parameters, results), then one row of column names with the units in it (``Load (N)``,
``Load [N]``) or in the row below (``(N)``, ``N``), then numbers to the end; empty lines count nowhere. Comma, semicolon
or tab between columns; a decimal comma where the columns are not separated by commas. A row whose first cell is
``Failure``, ``Failure type`` or ``Failure mode``, alone or with a colon, marks how the specimen failed
(``Failure type : material``, ``Failure,material``); a failure load or criterion is a row of anything. Out come
millimetres, newtons and seconds.
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
    "time_s": ("time", "test time"),
    "displacement_mm": ("extension", "displacement", "crosshead", "position", "stroke", "travel"),
    "load_n": ("load", "force"),
}
UNITS = {
    "time_s": {"s": 1.0, "sec": 1.0, "min": 60.0, "ms": 1e-3},
    "displacement_mm": {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4},
    "load_n": {"n": 1.0, "kn": 1000.0, "lbf": 4.4482216152605, "kgf": 9.80665},
}
FAILURES = ("adhesive", "cohesive", "material", "mixed")
UNIT_CELL = re.compile(r"[(\[]([^()\[\]]*)[)\]]")
FAILURE_CELL = re.compile(r"failure(?:\s+(?:type|mode))?\s*(?::\s*(.*))?")
LEAST_ROWS = 20
GAP = "a gap in the record; test again"
GAP_RATIO = 8.0  # a step of this many usual steps is a gap in the record
BACK_MM = 0.5  # the crosshead does not go back further than its own play
FLAT_SHARE = 0.2  # of its largest load, what a record may go below zero: zero drift and a swinging grip


@dataclass(frozen=True)
class Record:
    """One specimen.

    Attributes:
        path: its file.
        displacement_mm, load_n: (n,) crosshead travel from its first row, and load in tension.
        time_s: (n,), or None where the file has none.
        failure: how it failed, one of :data:`FAILURES`, or an empty string where it is not marked.
    """

    path: Path
    displacement_mm: np.ndarray
    load_n: np.ndarray
    time_s: np.ndarray | None
    failure: str


def read_record(path: Path) -> Record:
    """Read and check one file.

    Raises:
        FileError: no columns of displacement and load, a wrong unit, a gap, a reversed sign; it names file and line.
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
    lines = _text(path).splitlines()
    mark = max(";\t,", key=lambda sign: sum(line.count(sign) > 0 for line in lines)) if lines else ","
    if sum(";" in line for line in lines) * 2 > len(lines):
        mark = ";"
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=mark)]
    if mark != ",":
        rows = [[re.sub(r"^([+-]?\d+),(\d+)", r"\1.\2", cell) for cell in row] for row in rows]
    return rows


def _text(path: Path) -> str:
    """The file as text; a Windows computer writes its own code page or UTF-16 where Unicode was not asked for."""
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
    for number, row in enumerate(rows, start=1):
        found = FAILURE_CELL.fullmatch(row[0].lower()) if row else None
        kind = (found[1] or (row[1].lower() if len(row) > 1 else "")) if found else ""
        if kind:
            if kind not in FAILURES:
                raise FileError(f"{path}:{number}: failure={kind} is not one of {', '.join(FAILURES)}: correct the row")
            return kind
    return ""


def _columns(path: Path, rows: list[list[str]]) -> tuple[int, dict[str, tuple[int, float]], int]:
    """Row of the names, columns with their factors to mm, N and s, and the first row of numbers."""
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
    for k, cell in enumerate(row):
        plain = UNIT_CELL.sub("", cell).strip().lower()
        if any(plain == word or plain.endswith(f" {word}") for word in words):
            return k
    return None


def _factor(path: Path, line: int, name: str, title: str, cell: str) -> float:
    units = UNIT_CELL.findall(cell)  # the last: "Displacement (Strain 1) (mm)" names the gauge first
    word = (units[-1] if units else cell).strip().lower()
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
                why = "export a decimal point, nothing between thousands" if "," in cell else GAP
                raise FileError(f"{path}:{number + 1}: {title}={cell!r} is no number: {why}")
            row.append(value)
        values.append(row)
        lines.append(number + 1)
    if len(values) < LEAST_ROWS:
        raise FileError(f"{path}: {len(values)} rows of numbers, at least {LEAST_ROWS} are needed: export the raw data")
    return np.array(values), lines


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _require_steady(path: Path, data: dict[str, np.ndarray], lines: list[int]) -> None:
    """No gap and no way back, neither in time, where the file has it, nor in displacement."""
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
    load = data["load_n"]
    low, high = float(load.min()), float(load.max())
    if -low > FLAT_SHARE * max(high, 0.0) and low < 0:
        raise FileError(
            f"{path}:{lines[int(load.argmin())]}: load of {low:g} N against at most {high:g} N: the sign is reversed; "
            "export load positive in tension"
        )
    if high <= 0:
        raise FileError(f"{path}: the load is never above 0 N: balance the load cell and export it again")
