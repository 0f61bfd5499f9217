"""Infill and walls of one volume of a part, in the keys of PrusaSlicer and of OrcaSlicer or Bambu Studio."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Region:
    """Infill and walls of one volume of a part.

    Attributes:
        walls: number of perimeters.
        top_layers, bottom_layers: number of solid layers.
        density_percent: of the infill.
        pattern: of the infill.
        anchor_mm: longest piece of infill that may run along a wall; ``None`` leaves the slicer's default.
        solid_below_mm2: islands smaller than this are filled solid; ``None`` leaves the slicer's default.
    """

    walls: int
    top_layers: int
    bottom_layers: int
    density_percent: float
    pattern: str = "gyroid"
    anchor_mm: float | None = None
    solid_below_mm2: float | None = None

    def prusa(self) -> dict[str, str]:
        """Settings by the keys of PrusaSlicer."""
        words = {
            "perimeters": str(self.walls),
            "top_solid_layers": str(self.top_layers),
            "bottom_solid_layers": str(self.bottom_layers),
            "fill_density": f"{self.density_percent:g}%",
            "fill_pattern": self.pattern,
        }
        if self.anchor_mm is not None:
            words |= {"infill_anchor": f"{self.anchor_mm:g}", "infill_anchor_max": f"{self.anchor_mm:g}"}
        if self.solid_below_mm2 is not None:
            words["solid_infill_below_area"] = f"{self.solid_below_mm2:g}"
        return words

    def orca(self) -> dict[str, str]:
        """The same for OrcaSlicer and Bambu Studio."""
        return {ORCA_NAMES[key]: ORCA_PATTERNS.get(value, value) for key, value in self.prusa().items()}


ORCA_NAMES = {
    "perimeters": "wall_loops",
    "top_solid_layers": "top_shell_layers",
    "bottom_solid_layers": "bottom_shell_layers",
    "fill_density": "sparse_infill_density",
    "fill_pattern": "sparse_infill_pattern",
    "infill_anchor": "infill_anchor",
    "infill_anchor_max": "infill_anchor_max",
    "solid_infill_below_area": "minimum_sparse_infill_area",
}
ORCA_PATTERNS = {"rectilinear": "zig-zag"}
