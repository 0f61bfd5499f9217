"""Dimensions of bought parts: one table, ``bought.csv``, one row a dimension (millimetres; standard library only).

Columns: ``part``, ``dimension``, ``value_mm``, ``provenance`` (letter of docs/provenance.md) and ``note``.
"""

from __future__ import annotations

import csv
from functools import cache
from importlib.resources import files

from cad.errors import ParameterError


@cache
def bought_table() -> dict[tuple[str, str], float]:
    """All rows: ``(part, dimension)`` -> millimetres."""
    with files("cad").joinpath("bought.csv").open(encoding="utf-8") as stream:
        return {(row["part"], row["dimension"]): float(row["value_mm"]) for row in csv.DictReader(stream)}


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
