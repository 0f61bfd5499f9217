"""Record that every part module returns: a named solid with the data for its manufacture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from build123d import Solid

Role = Literal["printed", "cast", "bought"]


@dataclass(frozen=True)
class Recipe:
    """Operands of the booleans that made a solid, so that its mesh can be made by the same booleans.

    A piece that the kernel cuts from a body has faces with irregular borders, across which the kernel's mesher leaves
    facets far from the surface (0.08 mm at a tolerance of 0.01). Body and tools have no such faces: their meshes are
    accurate, and the booleans of meshes preserve that.

    Attributes:
        body: solid from which the piece is cut.
        common: solids with which the body is intersected.
        less: solids that are subtracted.
    """

    body: Solid
    common: tuple[Solid, ...] = ()
    less: tuple[Solid, ...] = ()


@dataclass(frozen=True)
class Part:
    """One part in the endcap frame (mm), in its assembled position (mold: in its casting position).

    Attributes:
        name: stable name, also the stem of its files, for example ``cup_bowl_1``.
        role: how the part is obtained.
        material: its material, for example ``PLA``.
        solid: one valid solid.
        color: sRGB in 0..1, for pictures and assemblies.
        quantity: number of pieces for one endcap.
        recipe: operands of the solid, where its mesh is made from their meshes.
    """

    name: str
    role: Role
    material: str
    solid: Solid
    color: tuple[float, float, float]
    quantity: int = 1
    recipe: Recipe | None = None
