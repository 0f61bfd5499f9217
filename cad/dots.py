"""Pattern of the dots on the inner surface, which are bumps on the mold core, dents in the silicone, marks in images.

Standard library only, because ``sensing`` uses the same pattern. Directions are unit vectors from the sphere's
centre in the endcap frame; polar angles are measured from the tip of the dome (+z).

Source: the released pattern (M, CAM06), counted on unwrapped photos: 1, 6, 10, 12, 16, 18, 20, 20 dots at equal polar
steps, one dot of every ring on a common meridian. The two equal counts place the equator midway between rings 6 and 7;
the step is therefore 180/13 degrees, and counts beyond the equator mirror those before it. Other counts
(:mod:`cad.pattern`) follow the same rule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cad.params import EndcapParams
from cad.pattern import step_deg

MERIDIAN_DEG = 0.0  # azimuth on which every ring has a dot


@dataclass(frozen=True)
class Dot:
    """One dot.

    Attributes:
        ring: number of the ring, 0 at the tip.
        index: number within the ring, counted from the common meridian.
        polar_deg: angle from the tip about the sphere's centre, degrees.
        azimuth_deg: angle about the axis from x, degrees.
    """

    ring: int
    index: int
    polar_deg: float
    azimuth_deg: float

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit vector from the sphere's centre, in the endcap frame."""
        polar, azimuth = math.radians(self.polar_deg), math.radians(self.azimuth_deg)
        return (math.sin(polar) * math.cos(azimuth), math.sin(polar) * math.sin(azimuth), math.cos(polar))


def ring_count(params: EndcapParams, ring: int) -> int:
    """Number of dots in a ring; rings beyond the equator mirror the counts of ``params.dot_rings``."""
    counts = params.dot_rings
    return counts[ring] if ring < len(counts) else counts[2 * len(counts) - 1 - ring]


def dot_pattern(params: EndcapParams) -> tuple[Dot, ...]:
    """All dots of a design, ring by ring, as far as the camera sees a whole dot."""
    half_angle_deg = math.degrees(math.asin(params.dot_radius_mm / params.inner_radius_mm))
    step = step_deg(params.dot_rings)
    last = math.floor((params.view_rim_polar_deg - half_angle_deg) / step)
    return tuple(
        Dot(ring, index, ring * step, MERIDIAN_DEG + 360.0 * index / ring_count(params, ring))
        for ring in range(last + 1)
        for index in range(ring_count(params, ring))
    )


def dot_position_mm(params: EndcapParams, dot: Dot) -> tuple[float, float, float]:
    """Position of a dot's centre on the inner sphere, in the endcap frame, mm."""
    x, y, z = (params.inner_radius_mm * c for c in dot.direction)
    return (x, y, z + params.centre_height_mm)
