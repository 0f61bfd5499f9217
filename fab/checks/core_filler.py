"""Bodies that fill the joints between the core's pieces, so that the rest of the cavity is the cast (mm, endcap frame).

Silicone leaks into the joints and cures there as flash, which yields and is trimmed: only flash next to the core's
surface counts as cast.
"""

from __future__ import annotations

import math

import manifold3d
import numpy as np

from cad.dots import dot_pattern
from cad.mold.core import bump_sphere_centre_mm, bump_sphere_radius_mm
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams

FACETS = 256  # of a circle: 0.01 mm of chord error, far less than the depths that stay open
BUMP_FACETS = 48  # of a bump's circle: 0.01 mm of chord error at a dot of 4 mm
BUMP_RINGS = 8  # from a bump's foot to its summit: 0.001 mm of chord error


def core_filler(layout: MoldLayout, inside_mm: float) -> manifold3d.Manifold:
    """Body of the core without its bumps, offset inward.

    Args:
        layout: mold sizes.
        inside_mm: offset, the depth to which the joints stay open, mm.
    """
    params, slope = layout.params, np.tan(np.radians(layout.ramp_deg))
    radius, centre = params.inner_radius_mm - inside_mm, params.centre_height_mm
    start = max(layout.neck_radius_mm - inside_mm, 0.0)
    floor = params.flange_thickness_mm - 1.0
    heights = centre + radius * np.sin(np.linspace(np.arcsin((floor - centre) / radius), np.pi / 2, FACETS // 2))
    cone = start + np.maximum(0.0, heights - params.flange_thickness_mm) / slope
    sphere = np.sqrt(np.maximum(0.0, radius**2 - (heights - centre) ** 2))
    outline = np.column_stack([np.minimum(cone, sphere), heights])
    closed = [(0.0, heights[0]), *map(tuple, outline), (0.0, heights[-1])]
    return _turned_round(closed, FACETS)


def bump_fillers(params: EndcapParams, inside_mm: float) -> manifold3d.Manifold:
    """Bodies of the bumps, offset inward; their lower ends lie below the surface of :func:`core_filler`.

    Args:
        params: design of the endcap.
        inside_mm: offset, the depth to which the joints stay open, mm.
    """
    radius, centre = bump_sphere_radius_mm(params) - inside_mm, bump_sphere_centre_mm(params)
    foot = math.sqrt(params.inner_radius_mm**2 - params.dot_radius_mm**2) - 2 * inside_mm
    heights = centre + radius * np.sin(np.linspace(math.asin((foot - centre) / radius), math.pi / 2, BUMP_RINGS + 1))
    across = np.sqrt(np.maximum(0.0, radius**2 - (heights - centre) ** 2))
    one = _turned_round([(0.0, foot), *zip(across[:-1], heights[:-1], strict=True), (0.0, heights[-1])], BUMP_FACETS)
    turned = [one.rotate([0.0, dot.polar_deg, dot.azimuth_deg]) for dot in dot_pattern(params)]
    return manifold3d.Manifold.compose(turned).translate([0.0, 0.0, params.centre_height_mm])


def _turned_round(outline: list[tuple[float, float]], facets: int) -> manifold3d.Manifold:
    """Body of revolution about z of a closed outline (radius, height), mm."""
    section = manifold3d.CrossSection([np.array(outline)], manifold3d.FillRule.Positive)
    return manifold3d.Manifold.revolve(section, facets)
