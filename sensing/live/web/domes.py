"""How deep a force presses an endcap and how large its contact patch gets, for the dome that the page draws.

From the solved presses of the design (:mod:`sensing.design.pressed`), in the page's own process, when a viewer first
asks: nothing of this enters a wrench.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from cad.errors import EndcapError
from cad.params import EndcapParams


def dome_curves(designs: list[tuple[float, float, str]]) -> list[list[dict[str, Any]]]:
    """Of every endcap, pressed against a plane: one curve a tilt; none for a design that no press is known of.

    Args:
        designs: (diameter, wall, silicone) of each endcap, mm.

    Returns:
        ``tilt_deg`` of the plane, ``force_n`` along its normal, ``depth_mm`` and ``patch_mm2``, rising, each from 0.
    """
    return [_curves(*design) for design in designs]


@lru_cache(maxsize=8)
def _curves(diameter_mm: float, wall_mm: float, silicone: str) -> list[dict[str, Any]]:
    from sensing.design.pressed import Study

    try:
        curves = Study(EndcapParams(diameter_mm, wall_mm), silicone).curves
    except EndcapError:  # beyond what was solved
        return []
    found = []
    for curve in curves:
        force, depth, patch, last = [0.0], [0.0], [0.0], 0.0
        for row in zip(curve.normal_n, curve.depth_mm, curve.patch_mm2, strict=True):
            if not row[0] > last:  # the end of the curve, or a snap
                break
            last = float(row[0])
            force.append(round(last, 3))
            depth.append(round(float(row[1]), 3))
            patch.append(round(max(float(row[2]), patch[-1]), 2))
        found.append({"tilt_deg": curve.tilt_deg, "force_n": force, "depth_mm": depth, "patch_mm2": patch})
    return found
