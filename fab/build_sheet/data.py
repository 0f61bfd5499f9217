"""Data of a build sheet, from which its text, tables and pictures are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cad.fasteners import BomLine
from cad.mold.layout import MoldLayout
from cad.robot_sides import DEFAULT_ROBOT
from fab.checks.screw_fit import ScrewFit
from fab.recipe import Recipe
from fab.slice.printers import DEFAULT_PRINTER
from fab.steps.record import Step


@dataclass(frozen=True)
class SheetData:
    """Data of one build sheet.

    Attributes:
        layout: sizes.
        manifest: of the export.
        sliced: ``slice.json``, or ``None``.
        recipe: of the cast.
        fits: screws.
        steps: of the whole work, in order.
        lines: bill of materials.
        checks: gates of manifest, slices and sheet, as records ``name, value, limit, ok``.
        fill_depth_mm: how far below the bowl's seam the poured silicone stands.
        pictures: step pictures by name, ``thumb_<part>`` of parts, ``cover``, ``section``, ``ring_light``.
        heights_mm: of every printed part in its printing pose.
        fitting_printers: those of the table that take every part, in words, smallest bed first.
        asked_printer: name in the printers' table that the user gave to the command; empty for none.
        exports_option: names the folder of exports in commands of make (:func:`fab.command.exports_words`).
    """

    layout: MoldLayout
    manifest: Mapping[str, Any]
    sliced: Mapping[str, Any] | None
    recipe: Recipe
    fits: Sequence[ScrewFit]
    steps: Sequence[Step]
    lines: Sequence[BomLine]
    checks: Sequence[Mapping[str, Any]]
    fill_depth_mm: float
    pictures: Mapping[str, Path]
    heights_mm: Mapping[str, float] = field(default_factory=dict)
    fitting_printers: tuple[str, ...] = ()
    asked_printer: str = ""
    exports_option: str = ""

    @property
    def robot(self) -> str:
        """Robot that the arm adapter fits, a row of cad/robot_sides.csv."""
        return str(self.manifest.get("robot", DEFAULT_ROBOT))

    @property
    def printer(self) -> str:
        """Printer as sliced, otherwise as given to the command of the sheet or of the molds."""
        sliced = self.sliced["printer"]["name"] if self.sliced else ""
        return sliced or self.asked_printer or self.molds_printer

    @property
    def molds_printer(self) -> str:
        """Printer given to `make molds`."""
        return str(self.manifest.get("printer", DEFAULT_PRINTER))
