"""Dimensions of bought parts: table ``bought.csv``, one row per dimension (millimetres; standard library only).

Columns: ``part``, ``dimension``, ``value_mm``, ``provenance`` (letter of docs/provenance.md) and ``note``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import positive, read_table
from cad.errors import ParameterError

TABLE = Path(__file__).with_name("bought.csv")


@dataclass(frozen=True)
class Dimension:
    """One row of the table.

    Attributes:
        part: name of the bought part.
        dimension: name of the dimension; with ``part`` it identifies the row.
        value_mm: the dimension, mm.
    """

    part: str
    dimension: str
    value_mm: float


@cache
def bought_table() -> dict[tuple[str, str], float]:
    """All rows: ``(part, dimension)`` -> value in mm.

    Raises:
        FileError: the table is missing or unreadable; the message names the line.
    """
    rows = read_table(TABLE, _dimension, "part", "dimension")
    return {(row.part, row.dimension): row.value_mm for row in rows.values()}


def _dimension(row: dict[str, str]) -> Dimension:
    return Dimension(row["part"], row["dimension"], positive(row, "value_mm"))


def bought_mm(part: str, dimension: str) -> float:
    """One dimension of a bought part in mm, for example ``bought_mm("nut_m3", "across_flats")``.

    Raises:
        ParameterError: there is no such row; the message lists all rows.
    """
    table = bought_table()
    if (part, dimension) not in table:
        known = ", ".join(f"{p}.{d}" for p, d in table)
        raise ParameterError(
            f"{part}.{dimension} is not in cad/bought.csv: known are {known}; add a row", name=part, value=dimension
        )
    return table[part, dimension]
