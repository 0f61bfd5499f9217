"""Filaments: rows of ``filaments.csv``, by the name of a part's material."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import number, positive, read_table
from cad.errors import ParameterError

FILAMENT_TABLE = Path(__file__).with_name("filaments.csv")


@dataclass(frozen=True)
class Retraction:
    """How a soft filament is drawn back, which a hard gear would otherwise grind: the same piece passes it many times.

    Attributes:
        length_mm: most that is drawn back; a printer with less keeps its own.
        speed_mm_s: of drawing it back and of pushing it forward.
        travel_mm: shortest move without printing for which it is drawn back; within infill it never is.
    """

    length_mm: float
    speed_mm_s: float
    travel_mm: float

    def prusa(self, printer_mm: float) -> dict[str, str]:
        """Settings by the keys of PrusaSlicer.

        Args:
            printer_mm: what the printer draws back of a stiff filament.
        """
        return {
            "filament_retract_length": f"{min(self.length_mm, printer_mm):g}",
            "filament_retract_speed": f"{self.speed_mm_s:g}",
            "filament_deretract_speed": f"{self.speed_mm_s:g}",
            "filament_retract_before_travel": f"{self.travel_mm:g}",
            "only_retract_when_crossing_perimeters": "1",
        }

    def orca(self, printer_mm: float) -> dict[str, str | list[str]]:
        """The same for OrcaSlicer and Bambu Studio."""
        return {
            "filament_retraction_length": [f"{min(self.length_mm, printer_mm):g}"],
            "filament_retraction_speed": [f"{self.speed_mm_s:g}"],
            "filament_deretraction_speed": [f"{self.speed_mm_s:g}"],
            "filament_retraction_minimum_travel": [f"{self.travel_mm:g}"],
            "reduce_infill_retraction": "1",
        }


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
        retraction: its own, for a soft filament; ``None`` where the printer's does.
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
    retraction: Retraction | None
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
        _retraction(row),
        row["provenance"],
    )


def _retraction(row: dict[str, str]) -> Retraction | None:
    """The three columns that belong together: all are filled, or none."""
    columns = ("retract_mm", "retract_mm_s", "retract_travel_mm")
    if not any(row[column] for column in columns):
        return None
    length, speed, travel = (positive(row, column) for column in columns)
    return Retraction(length, speed, travel)


def _percent(row: dict[str, str], column: str) -> int:
    value = number(row, column)
    if not 0 <= value <= 100:
        raise ValueError(f"{column}={row[column]!r} outside 0..100")
    return int(value)
