"""The mesh of a part: of its solid, or by the booleans that made the solid, from the meshes of its operands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import manifold3d
import trimesh

from cad.part import Part
from fab.meshing.mesh import TOLERANCE_MM, from_manifold, mesh_sha256, tessellate, to_manifold
from fab.meshing.repair import without_crossings

if TYPE_CHECKING:
    from build123d import Solid

TOOL_ANGLE_RAD = 0.2  # tools have few faces: their tapered fillets get the facets that keep a joint's gap


class PartMeshes:
    """Meshes of the parts of one design; operands that parts share are meshed once.

    Attributes:
        uncrossed: SHA-256 (:func:`fab.meshing.mesh.mesh_sha256`) of the meshes that were searched for crossings, and
            have none.
    """

    def __init__(self, tolerance_mm: float = TOLERANCE_MM) -> None:
        self.uncrossed: set[str] = set()
        self._tolerance_mm = tolerance_mm
        self._operands: dict[int, tuple[Solid, manifold3d.Manifold]] = {}

    def of(self, part: Part) -> trimesh.Trimesh:
        """The closed mesh of a part, free of crossings where they can be repaired.

        Raises:
            GeometryError: a solid's mesh stays open.
        """
        if part.recipe is None:
            return tessellate(part.solid, self._tolerance_mm)
        body = self._operand(part.recipe.body)
        for tool in part.recipe.common:
            body = body ^ self._operand(tool, TOOL_ANGLE_RAD)
        if part.recipe.less:
            tools = [self._operand(tool, TOOL_ANGLE_RAD) for tool in part.recipe.less]
            body = manifold3d.Manifold.batch_boolean([body, *tools], manifold3d.OpType.Subtract)
        mesh = from_manifold(body)
        if part.role == "cast":  # it takes the gyroid's imprint first
            return mesh
        repaired = without_crossings(mesh)
        if repaired is mesh:
            self.uncrossed.add(mesh_sha256(mesh))
        return repaired

    def _operand(self, solid: Solid, angle_rad: float | None = None) -> manifold3d.Manifold:
        """An operand's mesh; the solid is kept with it, so that its identity stays its own."""
        if id(solid) not in self._operands:
            angle = {} if angle_rad is None else {"angle_rad": angle_rad}
            self._operands[id(solid)] = (solid, to_manifold(tessellate(solid, self._tolerance_mm, **angle)))
        return self._operands[id(solid)][1]
