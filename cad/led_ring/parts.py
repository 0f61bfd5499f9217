"""Electronic parts of the LED ring: table ``led_parts.csv``, one row per part (standard library only).

``value`` is in the SI unit of column ``unit``; the length is measured from lead to lead, that is across a part with
leads on two sides; the last column states the source of the numbers, with the letters of docs/provenance.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import positive, read_table
from cad.errors import ParameterError

TABLE = Path(__file__).parents[1] / "led_parts.csv"


@dataclass(frozen=True)
class LedPart:
    """One kind of electronic part.

    Attributes:
        part: name in this project, for example ``r_set``.
        description: what the part is.
        maker: its manufacturer.
        part_number: the manufacturer's number, for the order.
        package: name of its package.
        value: rating in ``unit`` (SI).
        unit: SI unit of the value.
        length_mm: length of the envelope from lead to lead, mm.
        width_mm: width of the envelope, mm.
        height_mm: height of the envelope, mm.
        provenance: source of the numbers.
    """

    part: str
    description: str
    maker: str
    part_number: str
    package: str
    value: float
    unit: str
    length_mm: float
    width_mm: float
    height_mm: float
    provenance: str


@cache
def led_parts() -> dict[str, LedPart]:
    """All rows: name -> part.

    Raises:
        FileError: the table is missing or unreadable; the message names the line.
    """
    return read_table(TABLE, _part, "part")


def _part(row: dict[str, str]) -> LedPart:
    length, width, height = (positive(row, name) for name in ("length_mm", "width_mm", "height_mm"))
    return LedPart(
        row["part"],
        row["description"],
        row["maker"],
        row["part_number"],
        row["package"],
        positive(row, "value"),
        row["unit"],
        length,
        width,
        height,
        row["provenance"],
    )


def led_part(name: str) -> LedPart:
    """The part of the table with a name.

    Raises:
        ParameterError: there is no such part.
    """
    if name not in led_parts():
        raise ParameterError(
            f"part={name} is not in cad/led_parts.csv: it has {', '.join(led_parts())}", name="part", value=name
        )
    return led_parts()[name]
