"""What every part module returns: a named solid with what the workshop must know about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from build123d import Solid

Role = Literal["printed", "cast", "bought"]


@dataclass(frozen=True)
class Recipe:
    """The booleans that made a solid, so that its mesh can be made by the same ones.

    A piece cut out of a body by the kernel has faces with ragged borders, across which the kernel's mesher leaves
    facets far off the surface (0.08 mm at a tolerance of 0.01). The body and the tools have none, so their meshes are
    true, and the booleans of the meshes keep them so.

    Attributes:
        body: what the piece is cut from.
        common: solids that the piece is inside of.
        less: solids that are taken off.
    """

    body: Solid
    common: tuple[Solid, ...] = ()
    less: tuple[Solid, ...] = ()


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
        recipe: how the solid was made, where its mesh is to be made from the same operands.
    """

    name: str
    role: Role
    material: str
    solid: Solid
    color: tuple[float, float, float]
    quantity: int = 1
    recipe: Recipe | None = None
