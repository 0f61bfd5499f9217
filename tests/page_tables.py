"""Numbers of the pages beside those of the benches' tables that they are taken from."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from typing import NamedTuple

from test_architecture import ROOT

Row = dict[str, str]


class Rounded(NamedTuple):
    """A number as a page writes it, and the one that it should be."""

    written: str
    value: float

    @property
    def is_right(self) -> bool:
        """Whether the page's number is the value to the decimals that it has; the table's own rounding counts."""
        decimals = len(self.written.partition(".")[2])
        return abs(float(self.written) - self.value) <= 0.501 * 10.0**-decimals + 1e-4 * abs(self.value)


def table(name: str) -> list[Row]:
    """Rows of a table of bench."""
    with (ROOT / "bench" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def page_rows(page: str, head: str, after: str = "") -> list[list[str]]:
    """Entries of the rows under the one that begins with ``head``, of the first table of a page after some words."""
    text = (ROOT / page).read_text(encoding="utf-8")
    text = text[text.index(after) :]
    lines = text[text.index(f"\n{head}") + 1 :].split("\n\n")[0].splitlines()
    return [[entry.strip() for entry in line.strip("|").split("|")] for line in lines[2:] if line.startswith("|")]


def numbers(text: str) -> list[str]:
    """Every number of a text, without its sign."""
    return re.findall(r"\d+(?:\.\d+)?", text)


def wrong(pairs: list[Rounded]) -> list[Rounded]:
    """Those that a page does not have right."""
    return [pair for pair in pairs if not pair.is_right]


def said(page: str, pattern: str) -> tuple[str, ...]:
    """What the groups of a pattern are in a page, whose lines may break anywhere."""
    found = re.search(pattern, " ".join((ROOT / page).read_text(encoding="utf-8").split()))
    assert found is not None, f"{page} does not say {pattern}"
    return found.groups()


def spread(values: Iterable[float]) -> tuple[float, float]:
    """Least and most."""
    values = list(values)
    return min(values), max(values)


def rounded(written: Iterable[str], values: Iterable[float]) -> list[Rounded]:
    """What a page writes beside what it should."""
    return [Rounded(*pair) for pair in zip(written, values, strict=True)]


def rows_of(rows: Iterable[Row], **named: str) -> list[Row]:
    """Rows that have these entries."""
    return [row for row in rows if all(row[name] == value for name, value in named.items())]


def floats(rows: Iterable[Row], name: str) -> list[float]:
    """A column as numbers."""
    return [float(row[name]) for row in rows]


def cell_of(rows: list[Row], **named: str) -> Row:
    """The one row that has these entries."""
    (row,) = rows_of(rows, **named)
    return row
