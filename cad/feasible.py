"""Feasible region of (D, T): which endcaps can be made, and for which reasons (standard library only).

Each limit is a closed form of the two parameters. The region is therefore exact for the reasons named here, and the
nearest valid choice can be computed (R = D / 2, lengths in mm):

    T >= 6.5      below it a 2.5 mm ball reaches less than four fifths of the gyroid's voids at some D (measured):
                  35,000 cP silicone would not fill the bond.
    T <= R / 5    a thicker wall no longer bends like a shell: the dots hardly move (E).
    opening       the LED ring (radius 39.0 + 0.3) must pass the silicone on the flange.
    crown         the gyroid must end at least 60 degrees from the tip, outside the paper's 50 degree tilts plus a
                  10 degree patch: TPU under the contact would distort the wrench.
    collar        above the equator the mold's collar needs room for the dam, which holds the silicone that rises in
                  the closing stroke, and for the bolt flange.
    D <= 250      the lugs of the base, and the quarter of the mold, must lie on a 256 mm print bed.
"""

from __future__ import annotations

import math
from functools import cache
from numbers import Real

from cad import scaling
from cad.errors import ParameterError
from cad.plain_numbers import brief, plain

MIN_WALL_MM = 6.5  # M: see above
MAX_WALL_RATIO = 1 / 5  # E: T / R
MAX_DIAMETER_MM = 250.0  # print bed, see above
MIN_FREE_CAP_DEG = 60.0  # polar angle from the tip that stays free of gyroid
RING_OPENING_MM = scaling.RING_ENVELOPE_RADIUS_MM + scaling.RING_CLEARANCE_MM  # radius that the LED ring passes
BOLT_FLANGE_MM = 6.0  # E: PLA under an M4 head
DAM_MARGIN_MM = 1.5  # E: of the dam above the closing stroke
INCH_MM = 25.4
DECIMALS = 9  # to which limits are rounded: 179.2 / 10 is one bit below 17.92, which is typed and proposed


def real_number(name: str, value: object, example: str = "millimetres, for example D=130 T=8") -> float:
    """Convert a real number of any Python or NumPy type to a float.

    Args:
        name: name of the parameter, for the message.
        value: its value.
        example: accepted form with an example, for the message.

    Raises:
        ParameterError: the value is not a number.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ParameterError(f"{name}={brief(repr(value))} is not a number: give {example}", name=name, value=value)
    try:
        return float(value)
    except OverflowError:  # an integer of more than 308 digits
        return math.inf


def positive_number(name: str, value: object, example: str = "millimetres, for example D=130 T=8") -> float:
    """Convert a positive, finite number to a float.

    Args:
        name: name of the parameter, for the message.
        value: its value.
        example: accepted form with an example, for the message.

    Raises:
        ParameterError: the value is not a positive, finite number.
    """
    number = real_number(name, value, example)
    if not math.isfinite(number) or number <= 0:
        raise ParameterError(
            f"{name}={number:g} is not a positive finite number: give {example}", name=name, value=value
        )
    return number


def closing_stroke_mm(diameter_mm: float, wall_mm: float) -> float:
    """Closing stroke: how far the mold is still open when the silicone reaches its equator seam, mm.

    In its last s millimetres the core displaces pi r^2 s of silicone from the bowl. This equals the volume of silicone
    that ends above the equator, pi (R^2 - r^2)(h - f), hence s = (R^2 / r^2 - 1)(h - f), with R and r the outer and
    inner radius, h the height of the equator and f that of the flange's top above the mating plane.
    """
    outer = diameter_mm / 2
    inner = outer - wall_mm
    above_equator = scaling.centre_height_mm(diameter_mm) - scaling.FLANGE_THICKNESS_MM
    return (outer**2 - inner**2) * above_equator / inner**2


def dam_height_mm(diameter_mm: float, wall_mm: float) -> float:
    """Height of the bowl's dam above the equator seam, mm."""
    return closing_stroke_mm(diameter_mm, wall_mm) + DAM_MARGIN_MM


def wall_limits(diameter_mm: float) -> tuple[dict[str, float], dict[str, float]]:
    """Lower and upper limits of the wall at one diameter, each with its reason.

    Returns:
        ``(lower, upper)``: reason -> limit in mm. Empty limits (``upper < lower``) mean that no wall fits.
    """
    outer = diameter_mm / 2
    centre = scaling.centre_height_mm(diameter_mm)
    flange_offset = centre - scaling.FLANGE_THICKNESS_MM
    lower = {"a thinner wall leaves the gyroid no room that silicone can fill": MIN_WALL_MM}
    upper = {
        "a wall over R/5 no longer bends like a shell": round(outer * MAX_WALL_RATIO, DECIMALS),
        "the LED ring (radius 39.3 mm with clearance) must pass the opening": outer
        - math.hypot(RING_OPENING_MM, flange_offset),
        "the mold's dam and bolt flange must fit between equator and rim": _collar_wall_limit(outer, centre),
    }
    return lower, upper


def wall_range_mm(diameter_mm: float) -> tuple[float, float]:
    """Thinnest and thickest wall that can be made at a diameter, mm; ``(inf, -inf)`` where none can."""
    if not _diameter_holds(diameter_mm):
        return math.inf, -math.inf
    lower, upper = wall_limits(diameter_mm)
    low, high = max(lower.values()), min(upper.values())
    return (low, high) if low <= high else (math.inf, -math.inf)


@cache
def diameter_range_mm() -> tuple[float, float]:
    """Smallest and largest diameter that can be made with any wall, mm (the smallest by bisection, to 1e-9 mm)."""
    low, high = 2 * scaling.MIN_RIM_RADIUS_MM, MAX_DIAMETER_MM
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if wall_range_mm(middle)[0] < math.inf else (middle, high)
    return high, MAX_DIAMETER_MM


def require_feasible(diameter_mm: float, wall_mm: float) -> None:
    """Refuse a (D, T) that cannot be made.

    Raises:
        ParameterError: one line with the value, the accepted range, the reason and the nearest valid choice.
    """
    smallest, largest = diameter_range_mm()
    if not smallest <= diameter_mm <= largest:
        raise ParameterError(_diameter_message(diameter_mm, wall_mm), name="diameter_mm", value=diameter_mm)
    low, high = wall_range_mm(diameter_mm)
    if not low <= wall_mm <= high:
        lower, upper = wall_limits(diameter_mm)
        limits, pick = (lower, max) if wall_mm < low else (upper, min)
        reason = pick(limits, key=limits.__getitem__)
        raise ParameterError(
            f"wall_mm={plain(wall_mm)} outside {_inward(low, 1):g}..{_inward(high, -1):g} at D={plain(diameter_mm)}: "
            f"{reason}; nearest valid choice D={plain(diameter_mm)} T={plain(nearest_wall_mm(diameter_mm, wall_mm))}",
            name="wall_mm",
            value=wall_mm,
        )


def _diameter_holds(diameter_mm: float) -> bool:
    """Whether a diameter keeps the limits that do not depend on the wall: rim, crown and bed."""
    outer = diameter_mm / 2
    centre = scaling.centre_height_mm(diameter_mm)
    if not math.isfinite(centre) or diameter_mm > MAX_DIAMETER_MM:
        return False
    interlock_top = scaling.FLANGE_THICKNESS_MM + scaling.INTERLOCK_DEPTH_MM
    return interlock_top <= centre + outer * math.cos(math.radians(MIN_FREE_CAP_DEG))


def _collar_wall_limit(outer: float, centre: float) -> float:
    """Thickest wall whose closing stroke leaves room for dam margin and bolt flange, mm.

    Solves :func:`closing_stroke_mm` for r. ``outer`` is R, ``centre`` the height h of the equator, mm.
    """
    room = centre - BOLT_FLANGE_MM - DAM_MARGIN_MM
    above_equator = centre - scaling.FLANGE_THICKNESS_MM  # > 0 wherever there is room, as the flange is thinner
    if room <= 0:
        return -math.inf
    return outer - outer * math.sqrt(above_equator / (room + above_equator))


def _diameter_message(diameter_mm: float, wall_mm: float) -> str:
    smallest, largest = diameter_range_mm()
    nearest = min(max(diameter_mm, _inward(smallest, 1)), largest)
    if diameter_mm > largest:
        reason = "base and mold must lie on a 256 mm print bed"
    else:
        reason = (
            "camera and LED ring keep their size, so the rim does too, and a smaller dome has no room above its "
            "equator for the mold's dam and bolt flange"
        )
    inches = diameter_mm * INCH_MM
    thin, thick = wall_range_mm(wall_mm)
    hint = ""
    if thin <= diameter_mm <= thick:
        hint = f" (swapped? D={plain(wall_mm)} T={plain(diameter_mm)} can be made)"
    elif smallest <= inches <= largest:
        hint = f" ({plain(diameter_mm)} looks like inches: {inches:g} mm)"
    return (
        f"diameter_mm={plain(diameter_mm)} outside {_inward(smallest, 1):g}..{largest:g}{hint}: {reason}; "
        f"nearest valid choice D={plain(nearest)} T={plain(nearest_wall_mm(nearest, wall_mm))}"
    )


def nearest_wall_mm(diameter_mm: float, wall_mm: float) -> float:
    """Feasible wall at a diameter that is nearest to a wanted one, mm (limits rounded inward to 0.01 mm)."""
    low, high = wall_range_mm(diameter_mm)
    return min(max(wall_mm, _inward(low, 1)), _inward(high, -1))


def _inward(limit: float, direction: int) -> float:
    """Round a limit to 0.01 mm toward the inside of the region (``direction`` +1: up), so that it is itself valid."""
    scaled = limit * 100
    return (math.ceil(scaled - 1e-9) if direction > 0 else math.floor(scaled + 1e-9)) / 100
