"""Whole and half model of one shell, each meshed when needed, with one inner surface for both (mm, endcap frame)."""

from __future__ import annotations

from cad.materials import HyperelasticLaw
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import MeshDensity
from sensing.simulator.solid.shell import PLAIN, ShellModel, shell_model
from sensing.simulator.solid.surface import (
    InnerSurface,
    SurfaceSampler,
    dot_directions,
    inner_surface,
    outline_directions,
)

MAX_SAMPLERS = 64  # azimuths whose samplers are kept


class ShellHalves:
    """Models of a shell; fields of either refer to :attr:`surface`, that of the half model.

    Args:
        geometry, law: the shell and its silicone.
        density: density of the mesh, a name of :data:`sensing.simulator.solid.mesh.DENSITIES` or own numbers.
        interlock: stiffness of its zone (:func:`shell_model`).

    Raises:
        ParameterError: unknown density, or an interlock out of range.
    """

    def __init__(
        self, geometry: ShellGeometry, law: HyperelasticLaw, density: MeshDensity | str, interlock: float = PLAIN
    ) -> None:
        self.geometry, self.law, self.density, self.interlock = geometry, law, density, interlock
        self._models: dict[bool, ShellModel] = {}
        self._surfaces: dict[bool, InnerSurface] = {}
        self._samplers: dict[float, SurfaceSampler] = {}
        self._outlines: dict[float, SurfaceSampler] = {}
        self.surface = self.surface_of(half=True)
        self.sampler(0.0)

    def model(self, half: bool) -> ShellModel:
        """The model of the half y >= 0 or of the whole shell."""
        if half not in self._models:
            self._models[half] = shell_model(self.geometry, self.law, self.density, half, interlock=self.interlock)
        return self._models[half]

    def surface_of(self, half: bool) -> InnerSurface:
        """Surface of the half or the whole model, always in the half model's numbering."""
        if half not in self._surfaces:
            found = inner_surface(self.model(half))
            self._surfaces[half] = found if half else found.renumbered(self._surfaces[True])
        return self._surfaces[half]

    def sampler(self, azimuth_deg: float) -> SurfaceSampler:
        """Sampler of the painted dots for a contact at an azimuth, degrees."""
        return self._kept(self._samplers, dot_directions(self.geometry), azimuth_deg)

    def outlines(self, azimuth_deg: float) -> SurfaceSampler:
        """Sampler of the rings round the dots for a contact at an azimuth, degrees."""
        return self._kept(self._outlines, outline_directions(self.geometry), azimuth_deg)

    def _kept(self, samplers: dict[float, SurfaceSampler], directions: Array, azimuth_deg: float) -> SurfaceSampler:
        if azimuth_deg not in samplers:
            if len(samplers) > MAX_SAMPLERS:
                kept = {azimuth: sampler for azimuth, sampler in samplers.items() if azimuth == 0.0}
                samplers.clear()
                samplers.update(kept)
            samplers[azimuth_deg] = self.surface.sampler(directions, azimuth_deg)
        return samplers[azimuth_deg]
