"""Parameters of an endcap and all sizes that follow from them (standard library only: the project's bottom layer).

All modules use the endcap frame: origin at the centre of the mating plane (where the TPU interface meets the rigid
base), z along the axis of revolution toward the tip of the dome, millimetres. The silicone is a spherical shell
whose centre lies ``centre_height_mm`` above the mating plane; below the centre it narrows again, so that the shell is
wider at its equator than at its rim.

Scaling: the sensing hardware (camera, LED ring, nuts, screws) has the same size in all designs. Base, screw circle and
arm pattern depend on the diameter alone, so that shells of different wall or silicone fit the same base. At D=130 they
coincide with the released sensor (M, GEO02 to GEO11).

Provenance letters in comments are those of docs/provenance.md: P paper, M measured, S standard, E our estimate.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from typing import Any

from cad import feasible, pattern, scaling
from cad.plain_numbers import plain


@dataclass(frozen=True)
class EndcapParams:
    """Parameters of the endcap of outer diameter D and wall thickness T.

    Attributes:
        diameter_mm: outer diameter D of the silicone sphere, mm.
        wall_mm: thickness T of the silicone wall, measured along the radius, mm.
        dot_rings: number of dots in each ring, from the tip to the last ring before the equator (:mod:`cad.pattern`).
        dot_mm: diameter of a dot, mm.
        gyroid: volume fraction of TPU in the gyroid zone.

    Raises:
        cad.errors.ParameterError: (D, T), the dots or the gyroid lie outside the region that can be made
            (:mod:`cad.feasible`, :mod:`cad.pattern`); the message names the value, the limit, the reason and the
            nearest valid choice.
    """

    diameter_mm: float
    wall_mm: float
    dot_rings: tuple[int, ...] = pattern.RELEASED_RINGS
    dot_mm: float = pattern.RELEASED_DOT_MM
    gyroid: float = pattern.RELEASED_GYROID

    def __post_init__(self) -> None:
        for name in ("diameter_mm", "wall_mm"):
            object.__setattr__(self, name, feasible.positive_number(name, getattr(self, name)))
        object.__setattr__(self, "dot_rings", pattern.whole_counts(self.dot_rings))
        feasible.require_feasible(self.diameter_mm, self.wall_mm)
        for name, example in (("dot_mm", pattern.DOT_MM_EXAMPLE), ("gyroid", pattern.GYROID_EXAMPLE)):
            object.__setattr__(self, name, feasible.positive_number(name, getattr(self, name), example))
        pattern.require_pattern(self.inner_radius_mm, self.dot_rings, self.dot_mm)
        pattern.require_gyroid(self.gyroid)

    # --- identity ---------------------------------------------------------------------------------------------
    @property
    def label(self) -> str:
        """Name of the design and of its export folder, for example ``D130_T8``, ``D130_T8_gyroid0.12``."""
        options = [f"{name}{value}" for name, value in self.option_words.items()]
        return "_".join([f"D{plain(self.diameter_mm)}", f"T{plain(self.wall_mm)}", *options])

    @property
    def option_words(self) -> dict[str, str]:
        """Options other than D and T that differ from the released values: name -> text as typed."""
        return pattern.option_words(self.dot_rings, self.dot_mm, self.gyroid)

    @property
    def record(self) -> dict[str, Any]:
        """The parameters as plain JSON, without options that have the released values, so that older files agree."""
        options = {"dots": ("dot_rings", list(self.dot_rings)), "dot_mm": ("dot_mm", self.dot_mm)}
        options["gyroid"] = ("gyroid", self.gyroid)
        numbers = {"diameter_mm": self.diameter_mm, "wall_mm": self.wall_mm}
        return numbers | dict(options[name] for name in self.option_words)

    @property
    def digest(self) -> str:
        """SHA-256 of the parameters as canonical JSON, stored in weights and manifests."""
        text = json.dumps(self.record, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    # --- silicone sphere --------------------------------------------------------------------------------------
    @property
    def outer_radius_mm(self) -> float:
        """Radius R of the outer surface, D / 2."""
        return self.diameter_mm / 2

    @property
    def inner_radius_mm(self) -> float:
        """Radius of the inner surface, which the camera sees: R - T."""
        return self.outer_radius_mm - self.wall_mm

    @property
    def rim_radius_mm(self) -> float:
        """Radius at which the outer sphere meets the mating plane (52.47 at D=130)."""
        return scaling.rim_radius_mm(self.diameter_mm)

    @property
    def centre_height_mm(self) -> float:
        """Height of the sphere's centre above the mating plane (38.37 at D=130): the sphere passes through the rim."""
        return scaling.centre_height_mm(self.diameter_mm)

    @property
    def tip_height_mm(self) -> float:
        """Height of the outer tip of the dome above the mating plane."""
        return self.centre_height_mm + self.outer_radius_mm

    # --- TPU interface ----------------------------------------------------------------------------------------
    @property
    def screw_circle_radius_mm(self) -> float:
        """Radius of the ten M3 screws' circle (47.53 at D=130): a fixed inset from the rim, as the nut is fixed."""
        return self.rim_radius_mm - scaling.SCREW_INSET_MM

    @property
    def screw_azimuths_deg(self) -> tuple[float, ...]:
        """Azimuths of the ten M3 screws: 18 + 36 k degrees (M, GEO06)."""
        return tuple(18.0 + 36.0 * k for k in range(10))

    @property
    def bore_radius_mm(self) -> float:
        """Radius of the hole in the TPU flange, through which the mold core is removed and the camera sees the dome."""
        return self.screw_circle_radius_mm - scaling.BORE_INSET_MM

    @property
    def flange_thickness_mm(self) -> float:
        """Thickness of the TPU flange (E): 2.2 under the nut, 2.0 nut pocket, 1.8 roof; the silicone begins on it."""
        return scaling.FLANGE_THICKNESS_MM

    @property
    def interlock_depth_mm(self) -> float:
        """Depth of the gyroid zone inside the silicone wall (P, GEO25: 25 mm)."""
        return scaling.INTERLOCK_DEPTH_MM

    @property
    def interlock_top_mm(self) -> float:
        """Height above the mating plane at which the gyroid ends."""
        return self.flange_thickness_mm + self.interlock_depth_mm

    @property
    def skin_mm(self) -> float:
        """Silicone over the gyroid on each side: the depth of a dot's dent (0.6) and the 0.4 mm that still fill (E)."""
        return 1.0

    @property
    def dot_radius_mm(self) -> float:
        """Radius of a dot on the inner surface."""
        return self.dot_mm / 2

    @property
    def dent_depth_mm(self) -> float:
        """Depth of a dot's dent."""
        return pattern.dent_depth_mm(self.dot_mm)

    @property
    def opening_radius_mm(self) -> float:
        """Radius of the opening for the core: the bore, or the silicone on the flange where that is narrower."""
        return min(self.bore_radius_mm, self.inner_radius_at(self.flange_thickness_mm))

    # --- rigid base -------------------------------------------------------------------------------------------
    @property
    def base_sphere_radius_mm(self) -> float:
        """Radius of the base's sphere (67.5 at D=130): 2.5 mm outside the silicone to protect its rim (M, GEO02)."""
        return self.outer_radius_mm + 2.5

    @property
    def base_thickness_mm(self) -> float:
        """Thickness of the base below the mating plane (M, GEO04); fixed, as are camera and screws."""
        return 16.0

    @property
    def arm_circle_radius_mm(self) -> float:
        """Radius of the five M4 arm screws' circle (60.0 at D=130): lugs of radius 7.5 end at the base's sphere."""
        return self.base_sphere_radius_mm - 7.5

    @property
    def arm_azimuths_deg(self) -> tuple[float, ...]:
        """Azimuths of the five M4 arm screws: 180 + 72 k degrees (M, GEO10)."""
        return tuple((180.0 + 72.0 * k) % 360.0 for k in range(5))

    # --- camera -----------------------------------------------------------------------------------------------
    @property
    def camera_height_mm(self) -> float:
        """Height of the camera's entrance pupil above the mating plane; it does not scale with D."""
        return scaling.camera_height_mm()

    @property
    def view_rim_polar_deg(self) -> float:
        """Polar angle from the tip, about the sphere's centre, at which the inner surface leaves the 180 deg view."""
        return scaling.view_rim_polar_deg(self.diameter_mm, self.wall_mm)

    # --- surfaces ---------------------------------------------------------------------------------------------
    def outer_radius_at(self, height_mm: float) -> float:
        """Cylindrical radius of the outer sphere at a height above the mating plane."""
        return _section_radius(self.outer_radius_mm, height_mm - self.centre_height_mm)

    def inner_radius_at(self, height_mm: float) -> float:
        """Cylindrical radius of the inner sphere at a height above the mating plane."""
        return _section_radius(self.inner_radius_mm, height_mm - self.centre_height_mm)


def _section_radius(sphere_radius_mm: float, offset_mm: float) -> float:
    return math.sqrt(max(0.0, sphere_radius_mm**2 - offset_mm**2))
