"""Numbered steps with their screws."""

from __future__ import annotations

from collections.abc import Sequence

from fab.bom import screw_name
from fab.build_sheet.blocks import Block, Step
from fab.build_sheet.data import SheetData


def screws(data: SheetData, prefix: str) -> str:
    """Number and name of the screws of the joints whose name begins so."""
    fits = [fit for fit in data.fits if fit.joint.name.startswith(prefix)]
    return f"{sum(len(fit.joint.places) for fit in fits)} x {screw_name(fits[0])}"


def steps(data: SheetData, letter: str, told: Sequence[tuple[str, tuple[str, ...], str | None]]) -> list[Block]:
    """Steps <letter>1, 2, ... from (title, lines, name of the picture or None)."""
    return [
        Step(f"{letter}{number}", title, lines, data.pictures[picture] if picture else None)
        for number, (title, lines, picture) in enumerate(told, 1)
    ]
