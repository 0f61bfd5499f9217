"""What an endcap of any size weighs, costs and takes to print, in closed form: estimates (E) before anything is made.

Plastic of a mold part: skins of its walls over its whole surface, infill within; surface and volume from its revolved
profile (Pappus), seams between segments included. The factor and the rate are fitted to sliced sizes
(docs/design_page.md says how near they come). `make slice` measures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cad.materials import Silicone
from cad.mold_layout import MoldLayout
from fab.design_page.outline import Profile, parts, shell_volume_mm3
from fab.slice.filaments import filament
from fab.slice.printers import MARGIN_MM, printer

SKIN_MM = 1.35  # three lines of 0.45
INFILL_RATIO = 0.10
SEAMS = {"bowl": 6, "collar": 6, "core": 18, "hanger": 0}  # cut faces, each the size of the profile
PLASTIC_FACTOR = 1.0  # E: fitted
RATE_G_H = 16.0  # E: fitted; with support, brims and slow outer walls
HARDWARE_RATIO = 0.55  # E: of the base's and the adapter's solid volume that is plastic
CAMERA_AND_RING_G = 35.0  # E
BOUGHT_USD = 75.0  # E: camera, ring, screws, inserts, cable
SILICONE_USD_KG = 80.0  # E: of the smallest kits


@dataclass(frozen=True)
class Estimate:
    """What it takes.

    Attributes:
        endcap_g: mass of the finished endcap.
        mold_g: plastic of the mold.
        hours: printing time of everything.
        usd: of everything that goes into one endcap and its mold.
        bed: how the printer's bed compares, in words.
    """

    endcap_g: float
    mold_g: float
    hours: float
    usd: float
    bed: str


def estimate(layout: MoldLayout, row: Silicone, printer_name: str) -> Estimate:
    """Estimate one endcap.

    Args:
        layout: the two numbers and the joint clearance.
        row: the silicone.
        printer_name: row of the printers' table.
    """
    params = layout.params
    revolved = {part.name: part for part in parts(layout)}
    mold = sum(_plastic_mm3(revolved[name].profiles[0], cuts) for name, cuts in SEAMS.items())
    pla, tpu = filament("PLA"), filament("TPU 95A")
    mold_g = PLASTIC_FACTOR * mold / 1000 * pla.density_g_cm3
    base = sum(_volume_mm3(revolved[name].profiles[0]) for name in ("base", "arm_adapter"))
    base_g = HARDWARE_RATIO * base / 1000 * pla.density_g_cm3
    flange, zone = (_volume_mm3(profile) for profile in revolved["interface"].profiles)
    tpu_g = (flange + 0.1 * zone) / 1000 * tpu.density_g_cm3
    silicone_g = shell_volume_mm3(params) / 1000 * row.density_g_cm3
    plastic_usd = ((mold_g + base_g) * pla.price_usd_kg + tpu_g * tpu.price_usd_kg) / 1000
    return Estimate(
        silicone_g + tpu_g + base_g / 2 + CAMERA_AND_RING_G,
        mold_g,
        (mold_g + base_g + 2 * tpu_g) / RATE_G_H,
        plastic_usd + 1.15 * silicone_g / 1000 * SILICONE_USD_KG + BOUGHT_USD,
        _bed(layout, printer_name),
    )


def _bed(layout: MoldLayout, printer_name: str) -> str:
    """The widest part against the bed; the adapter's arms and the base reach the farthest."""
    where = printer(printer_name)
    params = layout.params
    widest = 2 * (params.arm_circle_radius_mm + 7.5)
    room = min(where.width_mm, where.depth_mm) - 2 * MARGIN_MM
    verdict = "fits" if widest <= room else "too wide: make slice names a printer that takes it"
    return f"base {widest:.0f} mm across, bed {where.width_mm:g} x {where.depth_mm:g} mm: {verdict}"


def _plastic_mm3(profile: Profile, cuts: int) -> float:
    """Plastic of a part: skin and infill."""
    volume = _volume_mm3(profile)
    skin = min(volume, SKIN_MM * (_surface_mm2(profile) + cuts * abs(_area_mm2(profile))))
    return skin + INFILL_RATIO * (volume - skin)


def _edges(profile: Profile) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    return list(zip(profile, [*profile[1:], profile[0]], strict=True))


def _area_mm2(profile: Profile) -> float:
    return 0.5 * sum(x1 * z2 - x2 * z1 for (x1, z1), (x2, z2) in _edges(profile))


def _volume_mm3(profile: Profile) -> float:
    """Volume of the revolved profile (Pappus)."""
    moment = sum((x1 + x2) * (x1 * z2 - x2 * z1) for (x1, z1), (x2, z2) in _edges(profile)) / 6
    return abs(2 * math.pi * moment)


def _surface_mm2(profile: Profile) -> float:
    """Area of the revolved profile (Pappus)."""
    return sum(math.pi * (x1 + x2) * math.hypot(x2 - x1, z2 - z1) for (x1, z1), (x2, z2) in _edges(profile))
