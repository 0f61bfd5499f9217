"""Part as a solid for both CAD libraries; importing this loads the CAD kernel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from build123d import Color, Solid

from cad.part import Part

if TYPE_CHECKING:
    import cadquery


class TwoKernelSolid(Solid):
    """A solid of build123d that CadQuery can use, too: both wrap one OpenCASCADE shape (mm, endcap frame)."""

    @classmethod
    def of(cls, part: Part) -> TwoKernelSolid:
        """The solid of a part, with its name and colour."""
        return cls(part.solid.wrapped, label=part.name, color=Color(*part.color))

    @property
    def cadquery(self) -> cadquery.Workplane:
        """The same shape on a CadQuery workplane."""
        import cadquery

        return cadquery.Workplane(obj=cadquery.Shape.cast(self.wrapped))
