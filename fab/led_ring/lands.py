"""Lands of the LED ring by package, and the leads that must lie on them.

Millimetres, in the part's own drawing seen from its component side: rectangles as (x, y, width, height). A part's land
is found by the ``package`` of its row in cad/led_parts.csv, its leads by the row's length and width.

Land patterns: SOT-23-6, SOD-123 and chips after IPC-7351 nominal; 3030 and 4018 estimated (E) from the parts' outlines;
JST SH as in its maker's drawing (S, eSH; the same as KiCad's JST_SH_SM02B-SRSS-TB), but 0.325 mm shorter at both ends
to stay on the ring. Seen on the header with its contacts up, contact 1 is the left one.
"""

from __future__ import annotations

from dataclasses import dataclass

from cad.errors import ParameterError
from cad.led_ring.parts import LedPart

Rectangle = tuple[float, float, float, float]  # centre x, y, width, height


@dataclass(frozen=True)
class Lead:
    """Soldered foot of a lead at one end of a part.

    Attributes:
        side: -1 at the left end, 1 at the right one.
        foot_mm: length along the part.
        width_mm: across the part; None is the part's whole width.
        inset_mm: from the part's end to the lead's.
        y_mm: of the lead's middle.
    """

    side: int
    foot_mm: float
    width_mm: float | None
    inset_mm: float = 0.0
    y_mm: float = 0.0


def _two(x: float, width: float, height: float) -> dict[str, Rectangle]:
    """Lands of a chip."""
    return {"1": (-x, 0.0, width, height), "2": (x, 0.0, width, height)}


def _ends(foot_mm: float) -> dict[str, Lead]:
    """Leads of a chip: its two ends."""
    return {"1": Lead(-1, foot_mm, None), "2": Lead(1, foot_mm, None)}


_SOT_X, _SOT_W, _SOT_H, _SOT_PITCH = 1.1375, 1.325, 0.60, 0.95
LANDS: dict[str, dict[str, Rectangle]] = {
    "0603": _two(0.80, 0.80, 0.95),
    "0805": _two(0.95, 1.00, 1.45),
    "1206": _two(1.475, 1.15, 1.80),
    "SOT-23-6": {
        **{str(k + 1): (-_SOT_X, (1 - k) * _SOT_PITCH, _SOT_W, _SOT_H) for k in range(3)},
        **{str(k + 4): (_SOT_X, (k - 1) * _SOT_PITCH, _SOT_W, _SOT_H) for k in range(3)},
    },
    "SOD-123": {"K": (-1.65, 0.0, 0.9, 1.2), "A": (1.65, 0.0, 0.9, 1.2)},
    "4018": {"1": (1.5, 0.0, 1.2, 3.6), "2": (-1.5, 0.0, 1.2, 3.6)},
    "3030": {"A": (1.13, 0.0, 0.8, 2.5), "K": (-0.52, 0.0, 1.6, 2.5)},
    "SH 1.0": {
        "1": (-0.5, 1.8375, 0.6, 1.225),
        "2": (0.5, 1.8375, 0.6, 1.225),
        "M1": (-1.8, -1.7125, 1.2, 1.475),
        "M2": (1.8, -1.7125, 1.2, 1.475),
    },
}
LEADS: dict[str, dict[str, Lead]] = {
    "0603": _ends(0.35),  # S: 0.2 to 0.5 at GRM188
    "0805": _ends(0.45),  # S: 0.2 to 0.7 at GRM21
    "1206": _ends(0.55),  # S: 0.3 to 0.8
    "SOT-23-6": {  # S: DBV, foot 0.3 to 0.6, width at most 0.5
        **{str(k + 1): Lead(-1, 0.45, 0.5, y_mm=(1 - k) * _SOT_PITCH) for k in range(3)},
        **{str(k + 4): Lead(1, 0.45, 0.5, y_mm=(k - 1) * _SOT_PITCH) for k in range(3)},
    },
    "SOD-123": {"K": Lead(-1, 0.4, 0.7), "A": Lead(1, 0.4, 0.7)},  # E
    "4018": {"1": Lead(1, 1.0, 3.4), "2": Lead(-1, 1.0, 3.4)},  # E
    "3030": {"A": Lead(1, 0.7, 2.4), "K": Lead(-1, 1.5, 2.4, inset_mm=0.2)},  # E
}
# E: contacts' tails, from the housing's back; of the tabs that hold it down we have the land alone.
HEADER_TAILS: dict[str, Rectangle] = {"1": (-0.5, 1.975, 0.2, 0.6), "2": (0.5, 1.975, 0.2, 0.6)}


# Packages for which the tracks are drawn; a part's row may name any of them.
PACKAGES: dict[str, tuple[str, ...]] = {
    "led": ("3030",),
    "driver": ("SOT-23-6",),
    "inductor": ("4018",),
    "diode": ("SOD-123",),
    "plug": ("SH 1.0",),
    **dict.fromkeys(("c_in", "c_out", "c_comp", "r_set"), ("0603", "0805", "1206")),
}


def lands_of(part: LedPart) -> dict[str, Rectangle]:
    """Lands of a part by pin.

    Args:
        part: its row of the table.

    Raises:
        ParameterError: the ring has no land for its package.
    """
    fitting = PACKAGES[part.part]
    if part.package not in fitting:
        raise ParameterError(
            f"package={part.package} of {part.part} in cad/led_parts.csv has no land on the LED ring: {part.part} can "
            f"be {', '.join(fitting)}; take a part in such a package, or draw its land in fab/led_ring/lands.py",
            name="package",
            value=part.package,
        )
    return LANDS[part.package]


def leads_of(part: LedPart) -> dict[str, Rectangle]:
    """Soldered ends of the leads of a part by pin, from the size in its row.

    Args:
        part: its row of the table, with a package that has a land.
    """
    if part.package not in LEADS:
        return HEADER_TAILS
    half = part.length_mm / 2
    return {
        pin: (
            lead.side * (half - lead.inset_mm - lead.foot_mm / 2),
            lead.y_mm,
            lead.foot_mm,
            part.width_mm if lead.width_mm is None else lead.width_mm,
        )
        for pin, lead in LEADS[part.package].items()
    }
