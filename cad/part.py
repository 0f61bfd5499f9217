"""What every part module returns: a named solid with what the workshop must know about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from build123d import Solid

Role = Literal["printed", "cast", "bought"]


@dataclass(frozen=True)
class Part:
    """One part in the endcap frame (mm), in its assembled (or, for the mold, its casting) position.

    Attributes:
        name: stable name, also the stem of its files, for example ``cup_bowl_1``.
        role: how the part comes to be.
        material: what it is made of, for example ``PLA``.
        solid: one valid solid.
        color: RGB in 0..1, as shown on a screen, for pictures and assemblies.
        quantity: pieces needed for one endcap.
    """

    name: str
    role: Role
    material: str
    solid: Solid
    color: tuple[float, float, float]
    quantity: int = 1
