"""How large an endcap's forces are against those of D=130 T=8 in the default silicone, in whose newtons limits are.

    limit_n = 1.0 * load_scale(params.wall_mm, shear_mpa)

Notes:
    Forces of shells go with mu T^2 (docs/design.md), and so does the noise of their answers: a picture's noise in px is
    a part of R, and forces that move the skin by the same part of R go with mu T^2. In Ecoflex 00-30 a wall of 6.5 mm
    has 0.038: all that its weights know ends at 1.3 N. A wall of 25 mm in Smooth-Sil 950 has 9.8.
"""

from __future__ import annotations

from cad.identity import RELEASED_SILICONE, Identity

RELEASED_WALL_MM, RELEASED_RADIUS_MM = 8.0, 65.0  # E, GEO23; P, GEO01
RELEASED_SHEAR_MPA = 2 * float(RELEASED_SILICONE["c10_mpa"])  # with it limits were measured, whatever its row has now


def load_scale(wall_mm: float, shear_mpa: float) -> float:
    """Force that is to an endcap what 1 N is to D=130 T=8 in the default silicone, N.

    Args:
        wall_mm: thickness of its wall.
        shear_mpa: shear modulus of its silicone.
    """
    return shear_mpa * wall_mm**2 / (RELEASED_SHEAR_MPA * RELEASED_WALL_MM**2)


def recorded_shear_mpa(made_of: Identity | None) -> float:
    """Shear modulus of the silicone of an endcap, MPa; that of the default silicone where its file has none.

    Args:
        made_of: what the endcap is made of.
    """
    values = None if made_of is None else made_of.aspects.get("silicone")
    return 2 * float(values["c10_mpa"]) if values else RELEASED_SHEAR_MPA
