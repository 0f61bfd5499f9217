"""Upward push of the silicone on the upper half of the closed mold, which a weight balances until the bolts hold."""

from __future__ import annotations

import math

from cad.mold.layout import MoldLayout
from fab.recipe import SHOWN_RATIO, Recipe

STEP_KG = 0.5


def lift_g(layout: MoldLayout, mix: Recipe) -> float:
    """Mass that balances the push on the upper half; of it, the half's own weight is a part.

    Pressure depends on the depth alone: the silicone loads the bowl as if it filled it, and the cylinder above it, up
    to the wells. What this exceeds the silicone's own weight by, the upper half has to hold down.

    Args:
        layout: mold sizes.
        mix: recipe of the cast.

    Returns:
        Grams.
    """
    from cad.hanger import WELL_DEPTH_MM

    radius, level = layout.params.outer_radius_mm, layout.hanger_thickness_mm - SHOWN_RATIO * WELL_DEPTH_MM
    filled_mm3 = math.pi * radius**2 * (2 * radius / 3 + layout.seam_height_mm + level)
    return filled_mm3 * mix.silicone.density_g_cm3 / 1000 - mix.expected_g


def lift_kg(layout: MoldLayout, mix: Recipe) -> float:
    """Weight to lay on the hanger, kg, in steps of half a kilogram; it balances the push without the half's own weight.

    Args:
        layout: mold sizes.
        mix: recipe of the cast.
    """
    return math.ceil(lift_g(layout, mix) / 1000 / STEP_KG) * STEP_KG
