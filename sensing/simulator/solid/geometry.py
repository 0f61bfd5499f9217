"""Geometry of the silicone shell in the simulator, in the endcap frame (mm; frame of :mod:`cad.params`).

The shell lies between two concentric spheres and ends on the plane on which it is clamped: the top of the TPU flange.
Model assumptions: the gyroid zone above the flange (25 mm of interlocked TPU and silicone) counts as plain silicone,
and the flange as rigid; dents of the dots (0.6 mm) are left out. The interlock is stiffer than silicone, so the real
shell shifts as a whole a little less than this one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cad import scaling
from cad.errors import ParameterError
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_RINGS

MIN_WALL_RATIO, MAX_WALL_RATIO = 0.02, 0.4  # T / R; thinner walls need shell elements, thicker bodies are no shells


@dataclass(frozen=True)
class ShellGeometry:
    """A clamped spherical shell; walls too thin to mold (T < 6.5 mm) are accepted, as they can be simulated.

    Attributes:
        outer_radius_mm: radius R of the outer surface, mm.
        wall_mm: thickness T along the radius, mm.
        centre_height_mm: height of the spheres' centre in the endcap frame, mm.
        clamp_height_mm: height of the plane on which the silicone is clamped, mm.
        view_rim_polar_deg: polar angle, degrees, at which the inner surface leaves the camera's view (for the dots).
        dot_rings, dot_mm: the dot pattern (:mod:`cad.pattern`); by default the released one.

    Raises:
        ParameterError: empty or crossing geometry.
    """

    outer_radius_mm: float
    wall_mm: float
    centre_height_mm: float
    clamp_height_mm: float
    view_rim_polar_deg: float
    dot_rings: tuple[int, ...] = RELEASED_RINGS
    dot_mm: float = RELEASED_DOT_MM

    def __post_init__(self) -> None:
        low, high = MIN_WALL_RATIO * self.outer_radius_mm, MAX_WALL_RATIO * self.outer_radius_mm
        if not (math.isfinite(self.wall_mm) and low <= self.wall_mm <= high):
            raise ParameterError(
                f"wall_mm={self.wall_mm:g} outside {low:g}..{high:g} (R/50 .. 2R/5) at R={self.outer_radius_mm:g}: "
                "the mesh and the contact law are meant for shells; choose a wall in that range",
                name="wall_mm",
                value=self.wall_mm,
            )
        offset = self.clamp_height_mm - self.centre_height_mm
        if not abs(offset) < 0.95 * self.inner_radius_mm:
            raise ParameterError(
                f"clamp_height_mm={self.clamp_height_mm:g} does not cut the inner sphere (centre at "
                f"{self.centre_height_mm:g}, radius {self.inner_radius_mm:g}): lower the wall or raise the clamp",
                name="clamp_height_mm",
                value=self.clamp_height_mm,
            )

    @property
    def dot_radius_mm(self) -> float:
        """Radius of a painted dot, mm."""
        return self.dot_mm / 2

    @property
    def inner_radius_mm(self) -> float:
        """Radius of the inner surface, which the camera sees, mm."""
        return self.outer_radius_mm - self.wall_mm

    @property
    def mid_radius_mm(self) -> float:
        """Radius of the middle surface, mm."""
        return self.outer_radius_mm - self.wall_mm / 2

    @property
    def centre_mm(self) -> tuple[float, float, float]:
        """Centre of both spheres in the endcap frame, mm."""
        return (0.0, 0.0, self.centre_height_mm)

    def clamp_polar_rad(self, radius_mm: float) -> float:
        """Polar angle from the tip, rad, at which a concentric sphere meets the clamp plane."""
        return math.acos((self.clamp_height_mm - self.centre_height_mm) / radius_mm)

    @staticmethod
    def from_params(params: EndcapParams) -> ShellGeometry:
        """Shell of a design that can be made, with its dots."""
        plain = shell_geometry(params.diameter_mm, params.wall_mm)
        return replace(plain, dot_rings=params.dot_rings, dot_mm=params.dot_mm)


def shell_geometry(diameter_mm: float, wall_mm: float) -> ShellGeometry:
    """Shell of diameter D and wall T, also for walls that :class:`cad.params.EndcapParams` refuses to make.

    Raises:
        ParameterError: a diameter whose sphere is smaller than its rim, or a wall that is no shell.
    """
    centre = scaling.centre_height_mm(diameter_mm) if math.isfinite(diameter_mm) and diameter_mm > 0 else math.nan
    if not math.isfinite(centre):
        raise ParameterError(
            f"diameter_mm={diameter_mm:g} below {2 * scaling.MIN_RIM_RADIUS_MM:.1f}: the sphere is smaller than the "
            "rim that the LED ring needs; choose a larger diameter",
            name="diameter_mm",
            value=diameter_mm,
        )
    if not wall_mm < diameter_mm / 2:  # checked before the view rim is divided by the inner radius
        raise ParameterError(
            f"wall_mm={wall_mm:g} leaves no cavity at D={diameter_mm:g}: choose a wall under {diameter_mm / 5:g}",
            name="wall_mm",
            value=wall_mm,
        )
    return ShellGeometry(
        outer_radius_mm=diameter_mm / 2,
        wall_mm=wall_mm,
        centre_height_mm=centre,
        clamp_height_mm=scaling.FLANGE_THICKNESS_MM,
        view_rim_polar_deg=scaling.view_rim_polar_deg(diameter_mm, wall_mm),
    )
