"""Records of screw joints and of the lines of the bill of materials (standard library only).

A part's module returns the joints of that part: the screws that pass it, their axes, what they clamp and what holds
them. Screw lengths are not stored here: :mod:`fab.bom` measures grip and engagement on the meshes and selects from the
standard's lengths. Millimetres, endcap frame.
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
        owner: part under which the bill of materials lists the screws.
        thread: row of ``bought.csv``, for example ``screw_m3``.
        standard: designation under which a shop sells the screw.
        step: stage of the work in which the screws are used, in words.
        places: (x, y) of the axes, mm.
        up: whether the screw points to +z.
        seat: part on which the head bears.
        through: parts that the shank passes, including the seat.
        anchor: part that holds the thread or the nut.
        holder: a nut captured in the anchor, the anchor's own plastic, a nut under the anchor, or
            an insert.
        washers: number of washers under the head; the same number lies under a loose nut.
        beyond: parts that lie beyond the anchor in use, which no screw tip may reach.
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
        item: thing to buy or make.
        quantity: number or amount, in ``unit``.
        unit: ``pc``, ``g`` or ``set``.
        owner: part or step that needs it.
        use: its purpose.
        price_usd: price of the amount that one endcap and its mold use; ``None`` where it is unknown.
        provenance: letter of docs/provenance.md.
        order_as: text for a shop's search field: standard or part number, pack.
        kind: ``made``, ``part``, ``silicone``, ``consumable`` or ``tool``.
        pack_usd: price of the ordered amount, a whole bag, spool or batch; ``None`` where it equals ``price_usd``.
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
        """Price of the ordered amount; ``None`` where it is unknown."""
        return self.price_usd if self.pack_usd is None else self.pack_usd
