"""Footprints of the printed parts in closed form, by which a printer's bed is checked before anything is made.

Outlines contain all that can reach a bed's edge: the five lugs of base and adapter, the base's upper rim, the hanger's
plate, the interface's widest circle, the bolt flange of a third of the cup with its tab. Core and ring spacer lie
within the interface's circle. Printing pose of :mod:`fab.slice.pose`, millimetres.

The cup is divided into three pieces: base, adapter, hanger and interface are one part each and need a larger bed than a
third of the cup at every size (checked by a test), so smaller pieces would not allow a larger endcap on any printer.
"""

from __future__ import annotations

import math

import numpy as np

from cad import feasible, pattern
from cad.arm_adapter import THICKNESS_MM, arm_places_mm
from cad.base import LUG_RADIUS_MM
from cad.errors import ParameterError
from cad.mold.layout import (
    FLANGE_TAB_BEYOND_MM,
    FLANGE_TAB_OFFSET_MM,
    FLANGE_TAB_RADIUS_MM,
    PIN_DEPTH_MM,
    PIN_PLAY_MM,
    MoldLayout,
    joint_clearance_range_mm,
    rotated,
)
from cad.params import EndcapParams
from cad.plain_numbers import plain
from fab.slice.printers import MARGIN_MM, Printer, fitting_printers
from fab.variant import printer_option

STEP_DEG = 3.0


def footprints(layout: MoldLayout) -> dict[str, np.ndarray]:
    """Corners (n, 3) of the largest printed parts by name, mm; one segment represents all of its kind.

    Args:
        layout: mold sizes.
    """
    params = layout.params
    lugs = np.concatenate([_disc(place, LUG_RADIUS_MM) for place in arm_places_mm(params)])
    flank = math.sqrt(params.base_sphere_radius_mm**2 - params.centre_height_mm**2)
    top = params.interlock_top_mm
    widest = params.outer_radius_mm if top > params.centre_height_mm else params.outer_radius_at(top)
    arc = [rotated((layout.flange_radius_mm, 0.0), a) for a in np.arange(0.0, 120.0 + STEP_DEG, STEP_DEG)]
    along = params.outer_radius_mm + FLANGE_TAB_OFFSET_MM
    tip = _disc(rotated((along, FLANGE_TAB_BEYOND_MM), 120.0), FLANGE_TAB_RADIUS_MM)
    third = np.concatenate([np.array(arc), tip])
    bowl = np.concatenate([third, [[0.0, 0.0]]])
    hanger_mm = layout.hanger_thickness_mm + PIN_DEPTH_MM - PIN_PLAY_MM
    inside = [rotated((params.bore_radius_mm, 0.0), a) for a in (0.0, 30.0, 60.0, 90.0, 120.0)]
    return {
        "base": _standing(np.concatenate([lugs, _disc((0.0, 0.0), flank)]), params.base_thickness_mm),
        "arm_adapter": _standing(lugs, THICKNESS_MM),
        "hanger": _standing(_disc((0.0, 0.0), layout.hanger_radius_mm), hanger_mm),
        "interface": _standing(_disc((0.0, 0.0), widest), top),
        "cup_bowl": _standing(bowl, layout.stand_height_mm - layout.dam_top_mm),
        "cup_collar": _standing(np.concatenate([third, inside]), layout.seam_height_mm),
    }


def require_printer(layout: MoldLayout, where: Printer) -> None:
    """Refuse a size that a printer cannot print, before it is made.

    Args:
        layout: mold sizes.
        where: the printer.

    Raises:
        ParameterError: a part does not fit; the message has the largest D of this printer, and the smallest printer for
            this D.
    """
    too_large = [name for name, points in footprints(layout).items() if not where.takes(points)]
    if not too_large:
        return
    larger = next(iter(fitting_printers(footprints(layout))), None)
    largest = largest_diameter_mm(layout, where)
    with_it = [f"the largest D of this printer is {largest:g}{_along_with(layout, largest)}"] if largest else []
    remedies = with_it or ["it prints no size of the region"]
    if larger:
        remedies.append(
            f"D={plain(layout.params.diameter_mm)} needs {printer_option(larger.name)} ({larger.title}) or a larger one"
        )
    raise ParameterError(
        f"printer={where.name}: {', '.join(too_large)} of D={plain(layout.params.diameter_mm)} do not fit its "
        f"{where.size} with {MARGIN_MM:g} mm round each part; {'; '.join(remedies)}",
        name="printer",
        value=where.name,
    )


def largest_diameter_mm(layout: MoldLayout, where: Printer) -> float | None:
    """Largest D, to 0.1 mm, whose parts fit a printer; ``None`` if no size fits.

    Args:
        layout: with wall, silicone and joints, on which the height of the bowl depends; they are kept as far as another
            D allows.
        where: the printer.
    """
    low, high = feasible.diameter_range_mm()
    steps = np.arange(math.ceil(low * 10), math.floor(high * 10) + 1)

    def fits(step: int) -> bool:
        return all(where.takes(points) for points in footprints(_at(layout, step / 10)).values())

    if not fits(steps[0]):
        return None
    first, last = 0, len(steps)  # parts grow with D: bisection
    while last - first > 1:
        middle = (first + last) // 2
        first, last = (middle, last) if fits(steps[middle]) else (first, middle)
    return float(steps[first]) / 10


def _at(layout: MoldLayout, diameter_mm: float) -> MoldLayout:
    """The same endcap with another D: with its wall, dots and joints, or the nearest feasible ones."""
    params = layout.params
    wall = feasible.nearest_wall_mm(diameter_mm, params.wall_mm)
    rings = pattern.fitting_rings(diameter_mm / 2 - wall, params.dot_rings, params.dot_mm)
    other = EndcapParams(diameter_mm, wall, rings, params.dot_mm, params.gyroid)
    low, high = joint_clearance_range_mm(other, layout.silicone)
    return MoldLayout(other, min(max(low, layout.joint_clearance_mm), high), layout.silicone)


def _along_with(layout: MoldLayout, diameter_mm: float) -> str:
    """Options not feasible with another D, with the nearest feasible values: `` with T=17.62``; empty for none."""
    nearest = _at(layout, diameter_mm)
    params, other = layout.params, nearest.params
    words = {
        f"T={plain(other.wall_mm)}": other.wall_mm != params.wall_mm,
        f"dots={pattern.rings_text(other.dot_rings)}": other.dot_rings != params.dot_rings,
        f"joint_clearance={plain(nearest.joint_clearance_mm)}": (
            nearest.joint_clearance_mm != layout.joint_clearance_mm
        ),
    }
    changed = " ".join(word for word, differs in words.items() if differs)
    return f" with {changed}" if changed else ""


def _disc(centre: tuple[float, float], radius_mm: float) -> np.ndarray:
    turns = np.radians(np.arange(0.0, 360.0, STEP_DEG))
    return np.array(centre) + radius_mm * np.column_stack([np.cos(turns), np.sin(turns)])


def _standing(outline: np.ndarray, height_mm: float) -> np.ndarray:
    """Corners of a prism over an outline, mm."""
    return np.concatenate([np.column_stack([outline, np.full(len(outline), z)]) for z in (0.0, height_mm)])
