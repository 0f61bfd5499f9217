"""Whether a silicone's numbers are in the units of their columns: data sheets have others (standard library only)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cad.materials import Silicone

# E: ranges of poured platinum silicones, wider than any of them; what lies outside is most likely in another unit.
UNITS = {
    "density_g_cm3": (0.9, 2.0, "g/cm3 (1000 kg/m3 are 1)"),
    "pot_life_min": (1.0, 600.0, "minutes"),
    "viscosity_pa_s": (0.5, 300.0, "Pa s (1000 cps are 1)"),
    "cure_h": (0.2, 100.0, "hours"),
    "modulus_100_mpa": (0.02, 6.0, "MPa (145 psi are 1)"),
    "elongation_percent": (50.0, 2000.0, "%"),
    "neo_hooke_c10_mpa": (0.003, 2.0, "MPa (145 psi are 1)"),
}
STRETCH_2 = 2 * (2 - 1 / 2**2)  # engineering stress over C10 of a neo-Hooke bar at twice its length
MOST_APART = 3.0  # E: of that stress and the data sheet's; laws that stiffen come to 1.6, Young's modulus for C10 to 6


def require_units(row: Silicone) -> None:
    """Refuse numbers that were most likely copied in another unit, or are another constant.

    Args:
        row: of the table of silicones.

    Raises:
        ValueError: they were.
    """
    for column, (low, high, unit) in UNITS.items():
        value = getattr(row, column)
        if not low <= value <= high:
            raise ValueError(f"{column}={value:g} outside {low:g}..{high:g} {unit}")
    stress_mpa = STRETCH_2 * row.neo_hooke_c10_mpa
    if not 1 / MOST_APART <= stress_mpa / row.modulus_100_mpa <= MOST_APART:
        raise ValueError(
            f"neo_hooke_c10_mpa={row.neo_hooke_c10_mpa:g} is {stress_mpa:.3g} MPa at twice the length, and "
            f"modulus_100_mpa={row.modulus_100_mpa:g}: C10 is half the shear modulus, a sixth of Young's"
        )
