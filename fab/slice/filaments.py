"""Filaments: rows of ``filaments.csv``, by the name of a part's material."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import number, positive, read_table
from cad.errors import ParameterError

FILAMENT_TABLE = Path(__file__).with_name("filaments.csv")


@dataclass(frozen=True)
class Filament:
    """One row of the filament table; prices in US dollars.

    Attributes:
        name: name of the row, as options and manifests give it.
        type: family that slicers know: PLA, PETG, TPU.
        density_g_cm3: density.
        price_usd_kg: price of a kilogram.
        nozzle_c: temperature of the nozzle, degrees Celsius.
        bed_c: temperature of the bed, degrees Celsius.
        max_flow_mm3_s: largest flow of molten filament.
        fan_percent: speed of the fan that cools the part from the fourth layer on, over bridges too.
        provenance: letter and source of the row's numbers.
    """

    name: str
    type: str
    density_g_cm3: float
    price_usd_kg: float
    nozzle_c: int
    bed_c: int
    max_flow_mm3_s: float
    fan_percent: int
    provenance: str


@cache
def filaments() -> dict[str, Filament]:
    """The filament table, name -> filament.

    Raises:
        FileError: a missing or unreadable table, naming the line.
    """
    return read_table(FILAMENT_TABLE, _filament)


def filament(name: str) -> Filament:
    """One filament by the name of a part's material.

    Args:
        name: of the material.

    Raises:
        ParameterError: an unknown name; the message lists those in the table.
    """
    table = filaments()
    if name not in table:
        names = ", ".join(table)
        raise ParameterError(
            f"material={name!r} is not in fab/slice/{FILAMENT_TABLE.name}: choose one of {names}, or add a row",
            name="material",
            value=name,
        )
    return table[name]


def _filament(row: dict[str, str]) -> Filament:
    return Filament(
        row["name"],
        row["type"],
        positive(row, "density_g_cm3"),
        positive(row, "price_usd_kg"),
        int(positive(row, "nozzle_c")),
        int(positive(row, "bed_c")),
        positive(row, "max_flow_mm3_s"),
        _percent(row, "fan_percent"),
        row["provenance"],
    )


def _percent(row: dict[str, str], column: str) -> int:
    value = number(row, column)
    if not 0 <= value <= 100:
        raise ValueError(f"{column}={row[column]!r} outside 0..100")
    return int(value)
