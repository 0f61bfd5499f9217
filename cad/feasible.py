"""Which (D, T) can be made, and why (standard library only).

Each limit is a closed form of the two parameters, so the region is exact for the reasons named here, and the nearest
valid choice can be computed instead of guessed:

    T >= 6.5      below it a 2.5 mm ball reaches less than four fifths of the gyroid's voids at some D (measured):
                  35,000 cP silicone would not fill the bond.
    T <= R / 5    a thicker wall no longer bends like a shell: the dots hardly move (E).
    opening       the silicone on the flange must leave the LED ring (radius 39.0 + 0.3) a way in.
    crown         the gyroid must end at least 60 degrees from the tip, outside the paper's 50 degree tilts plus a
                  10 degree patch: TPU under the contact would falsify the wrench.
    collar        above the equator the mold's collar needs room for the dam that holds the silicone which rises in
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

MIN_WALL_MM = 6.5
MAX_WALL_RATIO = 1 / 5
MAX_DIAMETER_MM = 250.0
MIN_FREE_CAP_DEG = 60.0
RING_OPENING_MM = scaling.RING_ENVELOPE_RADIUS_MM + scaling.RING_CLEARANCE_MM
BOLT_FLANGE_MM = 6.0  # E: PLA under an M4 head
DAM_MARGIN_MM = 1.5  # E: on top of the closing stroke
INCH_MM = 25.4
DECIMALS = 9  # of a limit that has few: 179.2 / 10 comes out one bit below the 17.92 that is typed and proposed


def real_number(name: str, value: object, example: str = "millimetres, for example D=130 T=8") -> float:
    """A number of any kind that Python or NumPy has, as a float.

    Args:
        name: of the parameter. value: what was given. example: what to give instead, for the message.

    Raises:
        ParameterError: naming the value and the accepted form.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ParameterError(f"{name}={brief(repr(value))} is not a number: give {example}", name=name, value=value)
    try:
        return float(value)
    except OverflowError:  # of a whole number with over 308 digits
        return math.inf


def positive_number(name: str, value: object, example: str = "millimetres, for example D=130 T=8") -> float:
    """A positive, finite number, as a float.

    Args:
        name: of the parameter. value: what was given. example: what to give instead, for the message.

    Raises:
        ParameterError: naming the value and the accepted form.
    """
    number = real_number(name, value, example)
    if not math.isfinite(number) or number <= 0:
        raise ParameterError(
            f"{name}={number:g} is not a positive finite number: give {example}", name=name, value=value
        )
    return number


def closing_stroke_mm(diameter_mm: float, wall_mm: float) -> float:
    """How far the mold is still open when the silicone passes its equator seam.

    The silicone that ends above the equator, pi (R^2 - r^2)(h - flange), is what the core pushes out of the bowl in
    its last s millimetres, pi r^2 s (R, r outer and inner radius, h height of the equator).
    """
    outer = diameter_mm / 2
    inner = outer - wall_mm
    above_equator = scaling.centre_height_mm(diameter_mm) - scaling.FLANGE_THICKNESS_MM
    return (outer**2 - inner**2) * above_equator / inner**2


def dam_height_mm(diameter_mm: float, wall_mm: float) -> float:
    """Height of the bowl's dam above the equator seam."""
    return closing_stroke_mm(diameter_mm, wall_mm) + DAM_MARGIN_MM


def wall_limits(diameter_mm: float) -> tuple[dict[str, float], dict[str, float]]:
    """Lower and upper limits of the wall at one diameter, each under its reason.

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
    """Thinnest and thickest wall that can be made at a diameter; ``(inf, -inf)`` where none can."""
    if not _diameter_holds(diameter_mm):
        return math.inf, -math.inf
    lower, upper = wall_limits(diameter_mm)
    low, high = max(lower.values()), min(upper.values())
    return (low, high) if low <= high else (math.inf, -math.inf)


@cache
def diameter_range_mm() -> tuple[float, float]:
    """Smallest and largest diameter that can be made with any wall (the smallest by bisection, to 1e-9 mm)."""
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
    """Rim, crown and bed: the limits that no choice of the wall meets."""
    outer = diameter_mm / 2
    centre = scaling.centre_height_mm(diameter_mm)
    if not math.isfinite(centre) or diameter_mm > MAX_DIAMETER_MM:
        return False
    interlock_top = scaling.FLANGE_THICKNESS_MM + scaling.INTERLOCK_DEPTH_MM
    return interlock_top <= centre + outer * math.cos(math.radians(MIN_FREE_CAP_DEG))


def _collar_wall_limit(outer: float, centre: float) -> float:
    """Thickest wall whose closing stroke leaves room for dam margin and bolt flange: solves the stroke for r."""
    room = centre - BOLT_FLANGE_MM - DAM_MARGIN_MM
    above_equator = centre - scaling.FLANGE_THICKNESS_MM  # over 0 wherever there is room: the flange is thinner
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
    """Wall that can be made at a diameter, nearest to a wanted one (limits rounded inward to 0.01 mm)."""
    low, high = wall_range_mm(diameter_mm)
    return min(max(wall_mm, _inward(low, 1)), _inward(high, -1))


def _inward(limit: float, direction: int) -> float:
    """Round a limit to 0.01 mm toward the inside of the region, so that the printed number is itself valid."""
    scaled = limit * 100
    return (math.ceil(scaled - 1e-9) if direction > 0 else math.floor(scaled + 1e-9)) / 100
