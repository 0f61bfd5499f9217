"""Dimensions of bought parts: one table, ``bought.csv``, one row a dimension (millimetres; standard library only).

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
    """One row.

    Attributes:
        part, dimension: together its name.
        value_mm: of the dimension.
    """

    part: str
    dimension: str
    value_mm: float


@cache
def bought_table() -> dict[tuple[str, str], float]:
    """All rows: ``(part, dimension)`` -> millimetres.

    Raises:
        FileError: a missing or unreadable table, naming the line.
    """
    rows = read_table(TABLE, _dimension, "part", "dimension")
    return {(row.part, row.dimension): row.value_mm for row in rows.values()}


def _dimension(row: dict[str, str]) -> Dimension:
    return Dimension(row["part"], row["dimension"], positive(row, "value_mm"))


def bought_mm(part: str, dimension: str) -> float:
    """One dimension of a bought part in mm, for example ``bought_mm("nut_m3", "across_flats")``.

    Raises:
        ParameterError: no such row; the message lists what the part has.
    """
    table = bought_table()
    if (part, dimension) not in table:
        known = ", ".join(f"{p}.{d}" for p, d in table)
        raise ParameterError(
            f"{part}.{dimension} is not in cad/bought.csv: known are {known}; add a row", name=part, value=dimension
        )
    return table[part, dimension]
