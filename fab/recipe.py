"""Recipe of a cast: masses of the silicone's parts, timeline, and expected mass. Volumes in mm^3, masses in grams.

The volume is that of the shell's mesh: the body as cast, dents and gyroid taken off. Source of the silicones:
``cad/materials.csv``; surplus and times below are our estimates (E).
The pour exceeds the cast by the largest leak through the bowl's joints (:mod:`cad.leak`), the volume of the dam's gap,
of the flange's edge and of the vents, and the error of pouring by hand; the wells fill last. If less leaks, the rest
rises through the wells and stays as a film on the level hanger. Further room between the bolt flanges, behind the dam's
gap, is neglected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from cad.errors import FileError
from cad.feasible import DAM_MARGIN_MM
from cad.interface import edge_room_mm3, zone_volume_mm3
from cad.leak import leak_ratio, solid_shell_mm3
from cad.materials import DEFAULT_SILICONE, Silicone, mix_parts, silicone
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.check import Check

SURPLUS = 0.15  # E: share over the cast; most of it stays in the cup and on the stick
LEAST_LEFT_MM3 = 15e3  # E: film of 0.4 mm in a scraped cup of 0.6 l (330 cm2), and the stick
HAND_G = 1.0  # E: error of stopping a thin stream by hand, with the cup on the scale
SHOWN_RATIO = 0.5  # E: share of a well's depth that is clearly visible
FILM_MM = 1.0  # E: on the hanger; at the sharp edge of a level plate silicone (21 mN/m) stands up to 1.8 mm high
SCALE_G = 0.1  # smallest step of a kitchen scale that weighs to 0.1 g
LOW_MASS_RATIO = 0.98  # E: below this share the mold was not full, or air is trapped
DEGAS = "degas until the foam has fallen"
MIX_MIN, EASY_KG, MIX_MIN_PER_KG = 3.0, 0.5, 1.0  # E: scraping sides and bottom; longer for more than half a kilogram
DEGAS_MIN, LEAST_DEGAS_MIN = 5.0, 3.0  # E: until the foam has fallen, at 29 inHg
POUR_MIN = 5.0  # E: thin stream onto one spot, at the least
POUR_PA_ML = 7000 / 60  # E: viscosity x flow of such a stream: 200 ml a minute of 35 Pa s; it runs under its weight
SPARE_MIN = 1.0  # E: of the pot life, kept free by degassing
SHOWN_MIN = 0.5
CLOSE_MIN = 7.0  # E: lowering the upper half slowly, six bolts crosswise
RELEASE_AGENT = "Ease Release 200"  # P


@dataclass(frozen=True)
class TimelineStep:
    """One step before the pot life ends; minutes since the two parts were combined."""

    start_min: float
    end_min: float
    what: str


@dataclass(frozen=True)
class Overflow:
    """Volumes of the silicone beyond the cast, mm^3.

    Attributes:
        leak: largest, through the bowl's joints before the silicone sets.
        gap: between dam and piston.
        edge: between the interface's flange and the collar; silicone reaches the vents through its notches.
        vents: of the hanger, below the wells.
        wells: of the hanger, full.
        film: on top of the hanger.
        dam: over the equator seam while the mold closes, before the dam runs over.
    """

    leak: float
    gap: float
    edge: float
    vents: float
    wells: float
    film: float
    dam: float

    @property
    def room(self) -> float:
        """Volume that stays inside the closed mold."""
        return self.gap + self.edge + self.vents + self.wells


@dataclass(frozen=True)
class Recipe:
    """Recipe of one cast.

    Attributes:
        silicone: row of the table.
        cast_volume_mm3: of the finished shell.
        surplus: share mixed over it.
        overflow: volumes of the silicone beyond the cast.
        part_a_g, part_b_g: to be weighed, rounded up to a tenth of a gram.
        expected_g: mass of the cast, TPU not counted.
        lightest_g: least mass of a sound cast.
        air_mm3_per_g: volume of air for each missing gram.
        timeline: steps after the two parts were combined.
    """

    silicone: Silicone
    cast_volume_mm3: float
    surplus: float
    overflow: Overflow
    part_a_g: float
    part_b_g: float
    expected_g: float
    lightest_g: float
    air_mm3_per_g: float
    timeline: tuple[TimelineStep, ...]

    @property
    def hand_mm3(self) -> float:
        """Error of pouring by hand, mm^3."""
        return HAND_G * self.air_mm3_per_g

    @property
    def beyond_mm3(self) -> float:
        """Volume poured beyond the cast, mm^3: it reaches the wells after leak and short pour."""
        return _beyond_mm3(self.overflow, self.air_mm3_per_g)

    @property
    def poured_g(self) -> float:
        """Mass to pour into the bowl."""
        return self.expected_g + self.beyond_mm3 * self.silicone.density_g_cm3 / 1000

    @property
    def left_g(self) -> float:
        """Mass that is not poured: it stays in the cup and on the stick."""
        return self.part_a_g + self.part_b_g - self.poured_g

    @property
    def heaviest_g(self) -> float:
        """Largest possible mass of the cast: all that is poured, the error of pouring and a step of the scale."""
        return self.poured_g + HAND_G + SCALE_G

    @property
    def is_degassed(self) -> bool:
        """Whether the pot life leaves time to degas."""
        return any(step.what == DEGAS for step in self.timeline)

    @property
    def pot_life_to_spare_min(self) -> float:
        """Time from the closed mold until the silicone thickens."""
        return self.silicone.pot_life_min - self.timeline[-1].end_min

    def record(self) -> dict[str, Any]:
        """The recipe as JSON."""
        kept = asdict(self)
        places = {f"{key}_mm3": value for key, value in kept.pop("overflow").items()}
        record = {key: value for key, value in kept.items() if key not in ("silicone", "timeline")}
        record |= {"poured_g": self.poured_g, "heaviest_g": self.heaviest_g, "beyond_mm3": self.beyond_mm3, **places}
        rounded = {key: round(value, 3) for key, value in record.items()}
        steps = [asdict(step) for step in self.timeline]
        return {"material": self.silicone.name, "mix_ratio": self.silicone.mix_ratio, **rounded, "timeline": steps}


def recipe(cast_volume_mm3: float, overflow: Overflow, material: str = DEFAULT_SILICONE) -> Recipe:
    """Recipe for one cast: ``SURPLUS`` over the cast's own mass is mixed, more where that pours too little.

    Args:
        cast_volume_mm3: volume of the shell's mesh.
        overflow: volumes of the silicone beyond the cast (:func:`overflow_of`).
        material: a name in ``cad/materials.csv``.

    Raises:
        ParameterError: an unknown material.
        FileError: a table with a bad row.
    """
    row = silicone(material)
    expected = cast_volume_mm3 * row.density_g_cm3 / 1000
    part_a, part_b = mix_parts(row.mix_ratio)
    beyond = _beyond_mm3(overflow, 1000 / row.density_g_cm3)
    surplus = max(SURPLUS, (beyond + LEAST_LEFT_MM3) / cast_volume_mm3)
    total = expected * (1 + surplus)
    return Recipe(
        row,
        cast_volume_mm3,
        surplus,
        overflow,
        _up(total * part_a / (part_a + part_b)),
        _up(total * part_b / (part_a + part_b)),
        expected,
        expected * LOW_MASS_RATIO,
        1000 / row.density_g_cm3,
        timeline(row, cast_volume_mm3, surplus),
    )


def timeline(row: Silicone, cast_volume_mm3: float, surplus: float = SURPLUS) -> tuple[TimelineStep, ...]:
    """Steps after the two parts were combined; degassing has the time that the pot life leaves, or is left out.

    Args:
        row: the silicone.
        cast_volume_mm3: of the shell.
        surplus: share mixed over the cast's own mass.
    """
    mixed_g = cast_volume_mm3 * row.density_g_cm3 / 1000 * (1 + surplus)
    mix = _half_minutes_up(MIX_MIN + MIX_MIN_PER_KG * max(0.0, mixed_g / 1000 - EASY_KG))
    pour = _half_minutes_up(max(POUR_MIN, cast_volume_mm3 / 1000 * row.viscosity_pa_s / POUR_PA_ML / 60))
    left = (row.pot_life_min - SPARE_MIN - mix - pour - CLOSE_MIN) // SHOWN_MIN * SHOWN_MIN
    steps, clock = [], 0.0
    for minutes, what in (
        (mix, "mix, scraping sides and bottom"),
        (min(left, DEGAS_MIN) if left >= LEAST_DEGAS_MIN else 0.0, DEGAS),
        (pour, "pour in a thin stream onto one spot of the bowl"),
        (CLOSE_MIN, "lower the upper half, close the six bolts crosswise"),
    ):
        if minutes:
            steps.append(TimelineStep(clock, clock + minutes, what))
            clock += minutes
    return tuple(steps)


def _half_minutes_up(minutes: float) -> float:
    return -(-minutes // SHOWN_MIN) * SHOWN_MIN


def _beyond_mm3(places: Overflow, air_mm3_per_g: float) -> float:
    """Volume poured beyond the cast, mm^3: gap, edge and vents lie deeper than the wells, so they are full."""
    lost = places.leak + HAND_G * air_mm3_per_g
    return lost + places.gap + places.edge + places.vents + SHOWN_RATIO * places.wells


def millilitres(volume_mm3: float) -> str:
    """A small volume in ml to a tenth, or to its first significant digit: ``0.04``.

    Args:
        volume_mm3: mm3.
    """
    ml = volume_mm3 / 1000
    return f"{ml:.1f}" if ml >= 0.05 else f"{ml:.1g}"


def overflow_of(layout: MoldLayout) -> Overflow:
    """Volumes of the silicone beyond the cast in one mold.

    Args:
        layout: mold sizes.
    """
    from cad.hanger import VENT_RADIUS_MM, WELL_DEPTH_MM, WELL_RADIUS_MM

    count, params = len(layout.vent_azimuths_deg), layout.params
    inner, outer = layout.piston_radius_mm, layout.piston_radius_mm + layout.joint_clearance_mm
    return Overflow(
        leak=leak_ratio(params, silicone(layout.silicone), layout.joint_clearance_mm, layout.bowl_wall_mm, 1.0),
        gap=math.pi * (outer**2 - inner**2) * (layout.seam_height_mm - layout.dam_top_mm),
        edge=edge_room_mm3(params),
        vents=count * math.pi * VENT_RADIUS_MM**2 * (layout.hanger_thickness_mm - WELL_DEPTH_MM),
        wells=count * math.pi * WELL_RADIUS_MM**2 * WELL_DEPTH_MM,
        film=math.pi * (layout.hanger_radius_mm**2 - count * WELL_RADIUS_MM**2) * FILM_MM,
        dam=math.pi * params.inner_radius_mm**2 * DAM_MARGIN_MM,
    )


def overflow_checks(mix: Recipe) -> list[Check]:
    """Check that the pour fills the mold after the largest leak, and that the mold has room for it without a leak.

    Args:
        mix: the recipe.
    """
    places, most = mix.overflow, mix.beyond_mm3 + mix.hand_mm3
    least = mix.beyond_mm3 - mix.hand_mm3 - places.leak - places.gap - places.edge - places.vents
    return [
        Check("recipe.overflow_spare_mm3", places.vents + places.wells + places.film - most, low=0.0),
        Check("recipe.dam_spare_mm3", places.dam - most, low=0.0),
        Check("recipe.least_in_wells_mm3", least, low=0.0),
    ]


def closed_cast_mm3(params: EndcapParams) -> float:
    """Volume of the cast in closed form: the shell above the flange less the plastic in the gyroid's zone.

    Dents and fillet are neglected; the mesh of ``make molds`` has them.

    Args:
        params: the design.
    """
    return solid_shell_mm3(params) - params.gyroid * zone_volume_mm3(params)


def shell_volume_mm3(manifest: Mapping[str, Any]) -> float:
    """Volume of the cast shell, from the manifest, mm3.

    Args:
        manifest: of the export.

    Raises:
        FileError: the manifest has no shell.
    """
    for part in manifest["parts"]:
        if part["name"] == "shell":
            return float(part["volume_mm3"]["mesh"])
    raise FileError("manifest.json: has no part named shell: run make molds again")


def _up(grams: float) -> float:
    """Next tenth of a gram."""
    return -(-grams // SCALE_G) * SCALE_G
