"""The simulator of an endcap: what ``endcap press`` runs."""

from __future__ import annotations

from typing import Any

from cad.materials import silicone
from endcap.endcap import Endcap
from sensing.simulator import levels
from sensing.simulator.solid.geometry import ShellGeometry


class Simulator(levels.Simulator):
    """A shell that can be pressed, with its dots (:class:`sensing.simulator.levels.Simulator`).

    Args:
        endcap: by default D130_T8 of the default silicone.
        density: of the mesh, :data:`sensing.simulator.solid.mesh.DENSITIES`.
        level: 1 (the full model) to 4.
        more: further options of the level.

    Raises:
        ParameterError: unknown level or density.
    """

    def __init__(self, endcap: Endcap | None = None, density: str = "data", level: int = 2, **more: Any) -> None:
        self.endcap = endcap or Endcap()
        geometry = ShellGeometry.from_params(self.endcap.params)
        super().__init__(geometry, silicone(self.endcap.silicone).neo_hooke(), density, level, **more)
