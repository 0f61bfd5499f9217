"""Offset of the outlines of the explicit gyroid for which the print has the volume of the mesh.

A printed line has round sides: it holds as much as a sheet that is narrower by ROUNDING_MM. With outlines moved out by
half of that, a long sheet alone would be right. On the G-code of 19 interfaces (bench/slice_growth.csv: D 99.82 to 250,
T 6.5 to 25, 8 to 12 % of TPU; M, GYR07) the printed volume was then too large by the share

    e = BULK + CROSSING f - END_MM / z        f fraction of TPU, z thickness of the zone in mm

with 0.0034 left over (one sigma): it falls with what is lost where sheets end, and grows with where they meet. A
millimetre of growth changes the volume by the share PER_MM.
"""

from __future__ import annotations

from fab.slice.settings import ROUNDING_MM

BULK, CROSSING, END_MM = 0.0183, 0.299, 0.2945  # M, GYR07
PER_MM = 3.59  # M, GYR08: 9.233 % without growth, 10.004 % with 0.0215 mm (bench/slice.csv)


def growth_mm(zone_mm: float, fraction: float) -> float:
    """Outward offset of each outline, mm.

    Args:
        zone_mm: thickness of the gyroid's zone, from its inner to its outer surface, mm.
        fraction: of TPU in the zone.
    """
    excess = BULK + CROSSING * fraction - END_MM / zone_mm
    return ROUNDING_MM / 2 - excess / PER_MM
