"""Mass, cost and printing time of an endcap of any size in closed form: estimates (E) before anything is made.

Plastic of a mold part: a skin over its whole surface, infill within; surface and volume from its revolved profile
(Pappus), seams between segments included. Skins and ratios were fitted to one sliced size, D=150 T=9, the hours to
eight (errors: docs/design_page.md); only the geometry changes with the size. `make slice` measures.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad.lens import camera_module
from cad.materials import Silicone
from cad.mold.layout import MoldLayout
from cad.silicone_kits import silicone_usd_kg
from fab.design_page.outline import Profile, parts
from fab.recipe import closed_cast_mm3, overflow_of, recipe
from fab.slice.filaments import filament
from fab.slice.footprints import footprints
from fab.slice.printers import printer

MOLD = {  # part: skin (mm), infill, cut faces, each the size of the profile
    "bowl": (1.43, 0.10, 6),
    "collar": (1.08, 0.10, 6),
    "core": (0.98, 0.08, 12),
    "hanger": (0.97, 0.10, 0),
}
START_H = 9.9  # E: what of the hours does not grow with the size: first layers, slow short lines, holes, small pieces
RATE_G_H = 19.8  # E: with START_H within 1.2 % of eight sliced sizes, D=124 to 214; one rate alone: -16 to +10 %
HARDWARE = {"base": 0.60, "arm_adapter": 0.20}  # E: of the outline's volume that is plastic
CAMERA_AND_RING_G = 35.0  # E
SPACER_G = 12.0  # E: PETG
SMALL_USD = 30.0  # E: ring, screws, inserts, cable


@dataclass(frozen=True)
class Estimate:
    """Estimates for one endcap.

    Attributes:
        endcap_g: mass of the finished endcap.
        mold_g: plastic of the mold.
        hours: printing time of everything.
        usd: cost of all material of one endcap and its mold.
        bed: the widest part against the printer's bed, as text.
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
    mold = sum(_plastic_mm3(revolved[name].profiles[0], *how) for name, how in MOLD.items())
    pla, petg, tpu = filament("PLA"), filament("PETG"), filament("TPU 95A")
    mold_g = mold / 1000 * pla.density_g_cm3
    hardware = {name: ratio * _volume_mm3(revolved[name].profiles[0]) for name, ratio in HARDWARE.items()}
    base_g, hardware_g = (v / 1000 * pla.density_g_cm3 for v in (hardware["base"], sum(hardware.values())))
    flange, zone = (_volume_mm3(profile) for profile in revolved["interface"].profiles)
    tpu_g = (flange + params.gyroid * zone) / 1000 * tpu.density_g_cm3
    cast = recipe(closed_cast_mm3(params), overflow_of(layout), row.name)
    spools = ((mold_g + hardware_g, pla), (SPACER_G, petg), (tpu_g, tpu))
    plastic_usd = sum(grams / 1000 * spool.price_usd_kg for grams, spool in spools)
    silicone_usd = (cast.part_a_g + cast.part_b_g) / 1000 * silicone_usd_kg(row.name)
    return Estimate(
        cast.expected_g + tpu_g + base_g + SPACER_G + CAMERA_AND_RING_G,
        mold_g,
        START_H + (mold_g + hardware_g + tpu_g + SPACER_G) / RATE_G_H,
        plastic_usd + silicone_usd + camera_module().price_usd + SMALL_USD,
        _bed(layout, printer_name),
    )


def _bed(layout: MoldLayout, printer_name: str) -> str:
    """Text on the widest part, in its best rotation, against the printer's bed."""
    where, sizes = printer(printer_name), footprints(layout)
    large = [name for name, points in sizes.items() if not where.takes(points)]
    widest = max(large or sizes, key=lambda name: float(np.ptp(sizes[name][:, 0])))
    width, depth = np.ptp(sizes[widest], axis=0)[:2]
    verdict = "too large: make molds names the largest D" if large else "all parts fit"
    return f"{widest} {width:.0f} x {depth:.0f} mm, bed {where.width_mm:g} x {where.depth_mm:g} mm: {verdict}"


def _plastic_mm3(profile: Profile, skin_mm: float, infill: float, cuts: int) -> float:
    """Volume of a part's plastic: skin and infill, mm3.

    Args:
        profile: outline.
        skin_mm: thickness of the skin.
        infill: fraction of the rest.
        cuts: cut faces, each the size of the profile.
    """
    volume = _volume_mm3(profile)
    skin = min(volume, skin_mm * (_surface_mm2(profile) + cuts * abs(_area_mm2(profile))))
    return skin + infill * (volume - skin)


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
