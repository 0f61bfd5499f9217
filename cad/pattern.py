"""Accepted dots and gyroids of an endcap, the named options in addition to D and T (standard library only).

    dots    number of dots in each ring from the tip to the last ring before the equator, for example
            1-6-10-12-16-18-20; n rings have equal polar steps of 180 / (2 n - 1) degrees, and rings beyond the
            equator mirror them
    dot_mm  diameter of a dot on the inner surface
    gyroid  volume fraction of TPU in the gyroid zone

Limits of dots are closed forms of the chords between neighbours on the inner sphere; those of the gyroid are fixed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from operator import index

from cad.errors import ParameterError
from cad.plain_numbers import brief, plain

RELEASED_RINGS = (1, 6, 10, 12, 16, 18, 20)  # M, CAM06
RELEASED_DOT_MM = 4.0  # E: diameter of a dot on the photos
RELEASED_GYROID = 0.10  # P, GYR01
DENT_DEPTH_MM = 0.6  # E: deep enough to hold ink; for dots of the released 4 mm or more (flank 33 degrees)
DOT_RANGE_MM = (2.9, 8.0)  # E: below and above, no dent holds ink
LEAST_BRIDGE_MM = 2.0  # E: silicone between two dents; with less, the ink and the images of neighbours merge
ROUNDING_MM = 1e-9  # excess of a proposed pitch over the least one, so that rounding does not make it too small
DOT_MM_EXAMPLE, GYROID_EXAMPLE = "millimetres, for example dot_mm=4", "a fraction, for example gyroid=0.1"
MOST_RINGS = 12  # from the tip to the last ring before the equator
MOST_DIGITS = 4  # of a count: no ring has room for a thousand dots
GYROID_RANGE = (
    0.08,
    0.12,
)  # measured at the thinnest walls: at 0.12 a 2.5 mm ball covers 0.807 of the voids, gate 0.80
GYROID_REASON = (
    "a denser gyroid leaves voids that silicone does not fill at the thinnest walls (a 2.5 mm ball covers 0.75 of them "
    "at 0.15), a sparser one has less than one and a half periods to hold by"
)


def parse_rings(text: object) -> tuple[int, ...]:
    """Read the counts of the rings, joined by minus signs.

    Raises:
        ParameterError: the value has another form.
    """
    if not isinstance(text, str):
        raise ParameterError(
            f"dots={brief(repr(text))} is not a text: give the dots of each ring as {rings_text(RELEASED_RINGS)!r}",
            name="dots",
            value=text,
        )
    words = text.split("-")
    if not all(word.isascii() and word.isdigit() and len(word) <= MOST_DIGITS for word in words):
        raise ParameterError(
            f"dots={brief(text)} is not of the form 1-6-10-12-16-18-20: dots of each ring, from the tip to the "
            f"equator, in at most {MOST_DIGITS} digits each",
            name="dots",
            value=text,
        )
    return tuple(int(word) for word in words)


def rings_text(rings: tuple[int, ...]) -> str:
    """Counts of the rings as typed."""
    return "-".join(map(str, rings))


def whole_counts(rings: Iterable[object]) -> tuple[int, ...]:
    """Counts of the rings as Python integers, from integers of any library.

    Raises:
        ParameterError: a count is not an integer.
    """
    try:
        return tuple(index(count) for count in rings)  # type: ignore[arg-type]
    except TypeError:
        raise ParameterError(
            f"dot_rings={brief(repr(rings))} is no list of whole numbers: give the dots of each ring, for example "
            f"{RELEASED_RINGS}",
            name="dot_rings",
            value=rings,
        ) from None


def dent_depth_mm(dot_mm: float) -> float:
    """Depth of the dents, mm: dents of dots below the released 4 mm keep its slope and are therefore less deep.

    A key of the core is pulled inward. The normals of the sphere at its edges deviate by up to 60 degrees from that
    direction (next to the ramp of the thickest walls), so that flanks steeper than 30 degrees can be undercut. At 33
    degrees the undercut is 6 um for a bump's sphere of 3.6 mm radius; at the 45 degrees of a dot of 2.9 mm with a depth
    of 0.6 mm it would be 70 um.
    """
    return DENT_DEPTH_MM * min(1.0, dot_mm / RELEASED_DOT_MM)


def step_deg(rings: tuple[int, ...]) -> float:
    """Polar step between rings, degrees: the equator lies midway between the last ring and its mirror image."""
    return 180.0 / (2 * len(rings) - 1)


def require_pattern(inner_radius_mm: float, rings: tuple[int, ...], dot_mm: float) -> None:
    """Refuse dots that do not fit next to each other on the inner surface.

    Args:
        inner_radius_mm: radius of the inner surface, mm.
        rings: number of dots in each ring.
        dot_mm: diameter of a dot, mm.

    Raises:
        ParameterError: the value is outside the accepted range, which the message names.
    """
    low, high = DOT_RANGE_MM
    if not low <= dot_mm <= high:
        raise ParameterError(
            f"dot_mm={plain(dot_mm)} outside {low:g}..{high:g}: a smaller or larger dent holds no ink; "
            f"nearest valid choice dot_mm={min(max(dot_mm, low), high):g}",
            name="dot_mm",
            value=dot_mm,
        )
    if not 3 <= len(rings) <= MOST_RINGS or rings[0] != 1 or min(rings[1:]) < 3:
        raise ParameterError(
            f"dots={rings_text(rings)}: give 3 to {MOST_RINGS} rings, the first of 1 dot (the tip), the others of 3 "
            "or more",
            name="dots",
            value=rings,
        )
    if pitch_mm(inner_radius_mm, rings) - LEAST_BRIDGE_MM < dot_mm:
        raise ParameterError(_too_near(inner_radius_mm, rings, dot_mm), name="dots", value=rings)


def _too_near(inner_radius_mm: float, rings: tuple[int, ...], dot_mm: float) -> str:
    """Message for rings that do not fit: it proposes counts that fit, and a smaller dot where one fits."""
    pitch = dot_mm + LEAST_BRIDGE_MM
    fitting = pitch_mm(inner_radius_mm, rings) - LEAST_BRIDGE_MM
    choice = fitting_rings(inner_radius_mm, rings, dot_mm)
    full = [f"ring {k} at most {n}" for k, n in enumerate(choice) if rings[k] > n]
    rows = [f"at most {len(choice)} rings"] if len(choice) < len(rings) else []
    smaller, shortfall = math.floor(fitting * 10) / 10, dot_mm - fitting
    decimals = max(2, math.ceil(-math.log10(shortfall)) + 1)  # enough to show that the distance is too small
    apart = f"{fitting + LEAST_BRIDGE_MM:.{decimals}f}"
    or_smaller = f", or dot_mm={smaller:g}" if smaller >= DOT_RANGE_MM[0] else ""
    return (
        f"dots={rings_text(rings)} with dot_mm={plain(dot_mm)} on an inner radius of {inner_radius_mm:g} mm: "
        f"neighbours lie {apart} mm apart, dots need {plain(round(pitch, 9))} ({LEAST_BRIDGE_MM:g} between them); "
        f"{', '.join(rows + full)}: dots={rings_text(choice)}{or_smaller}"
    )


def fitting_rings(inner_radius_mm: float, rings: tuple[int, ...], dot_mm: float) -> tuple[int, ...]:
    """Counts that fit, each as near as possible to the wanted one.

    Args:
        inner_radius_mm: radius of the inner surface, mm.
        rings: wanted number of dots in each ring.
        dot_mm: diameter of a dot, mm.
    """
    pitch = dot_mm + LEAST_BRIDGE_MM + ROUNDING_MM
    kept = rings[: most_rings(inner_radius_mm, pitch)]
    return (1, *(min(kept[ring], most_dots(inner_radius_mm, kept, ring, pitch)) for ring in range(1, len(kept))))


def pitch_mm(inner_radius_mm: float, rings: tuple[int, ...]) -> float:
    """Least distance between two dots' centres, mm: along a ring, or from ring to ring on their common meridian."""
    step, across = math.radians(step_deg(rings)), 2 * inner_radius_mm
    along = [across * math.sin(k * step) * math.sin(math.pi / count) for k, count in enumerate(rings) if k]
    return min(across * math.sin(step / 2), *along)


def most_dots(inner_radius_mm: float, rings: tuple[int, ...], ring: int, pitch: float) -> int:
    """Largest number of dots in a ring at a pitch.

    Args:
        inner_radius_mm: radius of the inner surface, mm.
        rings: number of dots in each ring.
        ring: number of the ring, 0 at the tip.
        pitch: least distance between centres, mm.
    """
    across = 2 * inner_radius_mm * math.sin(math.radians(ring * step_deg(rings)))
    return math.floor(math.pi / math.asin(pitch / across)) if pitch < across else 1


def most_rings(inner_radius_mm: float, pitch: float) -> int:
    """Largest number of rings up to the equator whose step is at least a pitch (mm)."""
    half_step = math.asin(min(1.0, pitch / (2 * inner_radius_mm)))
    return math.floor((math.pi / (2 * half_step) + 1) / 2)


def require_gyroid(fraction: float) -> None:
    """Refuse a volume fraction of TPU for which the gates of the gyroid do not hold.

    Raises:
        ParameterError: the value is outside the accepted range, which the message names.
    """
    low, high = GYROID_RANGE
    if not low <= fraction <= high:
        raise ParameterError(
            f"gyroid={plain(fraction)} outside {low:g}..{high:g}: {GYROID_REASON}; nearest valid choice "
            f"gyroid={min(max(fraction, low), high):g}",
            name="gyroid",
            value=fraction,
        )


def option_words(rings: tuple[int, ...], dot_mm: float, gyroid: float) -> dict[str, str]:
    """Options that differ from the released values: name -> text as typed.

    Args:
        rings: number of dots in each ring.
        dot_mm: diameter of a dot, mm.
        gyroid: volume fraction of TPU in the gyroid zone.
    """
    words = {}
    if rings != RELEASED_RINGS:
        words["dots"] = rings_text(rings)
    if dot_mm != RELEASED_DOT_MM:
        words["dot_mm"] = plain(dot_mm)
    if gyroid != RELEASED_GYROID:
        words["gyroid"] = plain(gyroid)
    return words
