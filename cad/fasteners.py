"""Screws, nuts and what else is bought, as the parts ask for them (standard library only).

A made part returns its own lines: which screws go through it, where they stand, what they clamp, what holds them. The
lengths are not written here: :mod:`fab.bom` measures grip and engagement on the meshes and chooses from the standard's
lengths. Millimetres, endcap frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Holder = Literal["captured nut", "plastic", "loose nut", "insert"]


@dataclass(frozen=True)
class ScrewJoint:
    """A group of equal screws.

    Attributes:
        name: stable name, for example ``base_to_interface``.
        owner: part whose line of the bill this is.
        thread: row of ``bought.csv``, for example ``screw_m3``.
        standard: what to ask for in the shop.
        step: when it is used, in words.
        places: (x, y) of the axes.
        up: whether the screw points to +z.
        seat: part on which the head bears.
        through: parts that the shank passes, the seat's included.
        anchor: part that holds the thread or the nut.
        holder: a nut captured in the anchor, the anchor's own plastic, a nut under the anchor, or an insert.
        washers: under the head, and as many under a loose nut.
        beyond: parts that lie beyond the anchor when it is in use, and that no tip may reach.
    """

    name: str
    owner: str
    thread: str
    standard: str
    step: str
    places: tuple[tuple[float, float], ...]
    up: bool
    seat: str
    through: tuple[str, ...]
    anchor: str
    holder: Holder
    washers: int = 0
    beyond: tuple[str, ...] = ()


@dataclass(frozen=True)
class BomLine:
    """One line of the bill of materials.

    Attributes:
        item: what to buy or make.
        quantity: how many, or how much.
        unit: ``pc``, ``g`` or ``set``.
        owner: part or step that asks for it.
        use: what it is for.
        price_usd: of what one endcap and its mold take of it; ``None`` where we do not know.
        provenance: letter of docs/provenance.md.
        order_as: what to type into a shop's search field: standard or part number, pack.
        kind: ``made``, ``part``, ``silicone``, ``consumable`` or ``tool``.
        pack_usd: of what is ordered for it: a whole bag, spool or batch; ``None`` where that is ``price_usd``.
    """

    item: str
    quantity: float
    unit: str
    owner: str
    use: str
    price_usd: float | None = None
    provenance: str = "E"
    order_as: str = ""
    kind: str = "part"
    pack_usd: float | None = None

    @property
    def paid_usd(self) -> float | None:
        """What is paid for the line; ``None`` where we do not know."""
        return self.price_usd if self.pack_usd is None else self.pack_usd
