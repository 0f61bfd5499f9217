"""Meshes of parts, from their solids or by the booleans of their recipes on the meshes of the operands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import manifold3d
import trimesh

from cad.part import Part, Recipe
from fab.meshing.mesh import TOLERANCE_MM, from_manifold, mesh_sha256, tessellate, to_manifold
from fab.meshing.repair import without_crossings
from fab.meshing.self_intersections import crossing_faces

if TYPE_CHECKING:
    from build123d import Solid

TOOL_ANGLE_RAD = 0.2  # finer for tools, whose tapered fillets must keep a joint's gap; they have few faces
FINER = (1.0, 0.8, 0.5)  # factors on the tolerance: facets of a bump and a joint that meet at a few degrees may cross


class PartMeshes:
    """Meshes of the parts of one design; shared operands are meshed once.

    Attributes:
        uncrossed: SHA-256 (:func:`fab.meshing.mesh.mesh_sha256`) of the meshes that were searched for crossing faces
            and have none.
    """

    def __init__(self, tolerance_mm: float = TOLERANCE_MM) -> None:
        self.uncrossed: set[str] = set()
        self._tolerance_mm = tolerance_mm
        self._operands: dict[tuple[int, float], tuple[Solid, manifold3d.Manifold]] = {}

    def of(self, part: Part) -> trimesh.Trimesh:
        """Closed mesh of a part, without crossing faces where repair or finer facets can remove them.

        Raises:
            GeometryError: a solid's mesh stays open.
        """
        if part.recipe is None:
            return tessellate(part.solid, self._tolerance_mm)
        mesh = self._combined(part.recipe, self._tolerance_mm)
        if part.role == "cast":  # the gyroid's imprint is subtracted first
            return mesh
        for share in FINER:
            mesh = mesh if share == 1 else self._combined(part.recipe, share * self._tolerance_mm)
            repaired = without_crossings(mesh)
            if repaired is mesh:
                self.uncrossed.add(mesh_sha256(mesh))
            if repaired is mesh or len(crossing_faces(repaired)) == 0:
                break
        return repaired

    def _combined(self, recipe: Recipe, tolerance_mm: float) -> trimesh.Trimesh:
        """Mesh by the booleans of a recipe on the meshes of its operands."""
        body = self._operand(recipe.body, tolerance_mm)
        for tool in recipe.common:
            body = body ^ self._operand(tool, tolerance_mm, TOOL_ANGLE_RAD)
        if recipe.less:
            tools = [self._operand(tool, tolerance_mm, TOOL_ANGLE_RAD) for tool in recipe.less]
            body = manifold3d.Manifold.batch_boolean([body, *tools], manifold3d.OpType.Subtract)
        return from_manifold(body)

    def _operand(self, solid: Solid, tolerance_mm: float, angle_rad: float | None = None) -> manifold3d.Manifold:
        """Cached body of an operand; the solid is stored with it, so that its ``id`` is not reused."""
        key = id(solid), tolerance_mm
        if key not in self._operands:
            angle = {} if angle_rad is None else {"angle_rad": angle_rad}
            self._operands[key] = (solid, to_manifold(tessellate(solid, tolerance_mm, **angle)))
        return self._operands[key][1]
