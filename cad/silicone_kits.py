"""Kits in which silicones are sold: order and price for bill, design page and study (standard library only).

Rows of ``silicone_kits.csv``, each the smallest kit of a silicone of ``materials.csv``; larger kits cost less by the
gram.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cad.data_table import positive, read_table

TABLE = Path(__file__).with_name("silicone_kits.csv")
LEAST_G = 50.0  # E: no kit is smaller; such an amount is in kilograms
UNKNOWN_USD_KG = 80.0  # E: of a silicone without a kit in the table, or without a price: as the dearest of the others


@dataclass(frozen=True)
class SiliconeKit:
    """One row.

    Attributes:
        name: of the silicone, as in ``cad/materials.csv``.
        order_as: what to order.
        amount_g: what one kit weighs, g.
        price_usd: of one kit; ``None`` where it is not known.
        provenance: letter of docs/provenance.md, and why.
    """

    name: str
    order_as: str
    amount_g: float
    price_usd: float | None
    provenance: str


@cache
def silicone_kits() -> dict[str, SiliconeKit]:
    """The table, name -> kit.

    Raises:
        FileError: a missing or unreadable table, naming the line.
    """
    return read_table(TABLE, _kit)


def silicone_usd_kg(name: str) -> float:
    """Price of a kilogram of a silicone in its smallest kit; an estimate where the table does not have it.

    Args:
        name: row of ``cad/materials.csv``.
    """
    kit = silicone_kits().get(name)
    return 1000.0 * kit.price_usd / kit.amount_g if kit and kit.price_usd else UNKNOWN_USD_KG


def _kit(row: dict[str, str]) -> SiliconeKit:
    price = positive(row, "price_usd") if row["price_usd"] else None
    amount_g = positive(row, "amount_g")
    if amount_g < LEAST_G:
        raise ValueError(f"amount_g={amount_g:g} is under {LEAST_G:g}: it is what one kit weighs, in g: 1 kg is 1000")
    return SiliconeKit(row["name"], row["order_as"], amount_g, price, row["provenance"])
