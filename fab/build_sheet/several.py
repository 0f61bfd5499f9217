"""Chapter of time and number in the build sheet: the days of one endcap, and what more of them need from the same mold.

Each further endcap takes its own printed parts, bought parts, screws and silicone; the mold, its screws and the tools
are used again. Packs are counted on the total: screws for ten come in fewer bags than ten times those for one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cad.dots import dot_pattern
from cad.fasteners import BomLine
from cad.plain_numbers import plain
from fab.bom import RING_BATCH, screw_name
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.commands import make_command
from fab.build_sheet.data import SheetData
from fab.build_sheet.prints import one_interface, printing_s
from fab.slice.result import hours, is_mold
from fab.supplies import bag_size, kit_count, spool_count, supplies

COUNTS = (6, 10)  # endcaps: of a robot with three bars, and a round number
BAG = re.compile(r", bag of \d+$")
SMOOTH_H, PREPARE_H, DEMOLD_H, CABLE_H, ASSEMBLE_H, LIGHT_H = 1.5, 0.75, 0.75, 0.5, 1.0, 0.75  # E: hands on
DOT_S = 10.0  # E: seconds for each dot


@dataclass(frozen=True)
class Need:
    """Amount of one thing.

    Attributes:
        what: the thing.
        each: for each endcap, in ``unit``.
        mold: for the mold, once, in ``unit``.
        unit: of both; empty for pieces.
        packs: kind of pack: ``bag``, ``spool``, ``kit``, ``batch``; empty for single pieces.
    """

    what: str
    each: float
    mold: float = 0.0
    unit: str = ""
    packs: str = ""

    def total(self, count: int) -> float:
        """Amount for so many endcaps and one mold."""
        return self.mold + count * self.each


def time_and_number(data: SheetData) -> list[Block]:
    """Chapter of the days of one endcap, and of more endcaps from the same mold.

    Args:
        data: of the sheet.
    """
    cure = data.recipe.silicone.cure_h
    return [
        Heading("Time and number", 1),
        Paragraph(
            "How long one endcap takes. Working times are estimates; printing times are the slicer's, the cure is the "
            "silicone's."
        ),
        Table(("what", "your time", "waits"), _days(data), (3, 1.2, 3)),
        Heading("More endcaps from the same mold"),
        Paragraph(
            f"One mold makes one cast in {cure:g} h of cure and about {PREPARE_H + DEMOLD_H:.1f} h of work. "
            f"{_casts_a_day(cure)} Print a second mold if that is too slow. Print interfaces, bases, spacers and "
            "adapters while casts cure. Number the endcaps on the interface's rim and fill in the record at the end of "
            "this sheet for each: masses and wiring differ, and a camera belongs to the dome it was set up with."
        ),
        *_needs_blocks(data),
    ]


def _casts_a_day(cure_h: float) -> str:
    if cure_h + PREPARE_H + DEMOLD_H > 12.0:
        return "That is one cast a day: mix in the afternoon, demold the next day."
    return "Two casts a day are possible."


def _days(data: SheetData) -> tuple[tuple[str, str, str], ...]:
    """Rows of the work, its hands-on time, and what one waits for."""
    recipe = data.recipe
    closed, pot = recipe.timeline[-1].end_min, recipe.silicone.pot_life_min
    dots = len(dot_pattern(data.layout.params))
    paint_min = math.ceil(dots * DOT_S / 60 / 5) * 5
    return (
        ("order the LED ring's board, the camera and the silicone", "0.5 h", "1 to 3 weeks until they are there"),
        ("print the fit coupon, measure it, make the molds again if another joint fits", "0.5 h", "a few hours"),
        ("print", "0.5 h", _printing_words(data)),
        ("smooth and wash the core; break off brims", f"{SMOOTH_H:g} h", "until it is dry"),
        ("C1 to C5: nuts, release agent, both halves", f"{PREPARE_H * 60:g} min", "until the release agent is dry"),
        ("C6 to C9: mix to closed", f"{closed:g} min", f"look at the wells until {pot:g} min are over"),
        ("cure", "", f"{recipe.silicone.cure_h:g} h"),
        ("D1 to D6: demold, trim, judge the dome", f"{DEMOLD_H * 60:g} min", ""),
        (f"paint {dots} dots", f"{paint_min} min", "10 min until the ink is dry"),
        ("cable of the ring", f"{CABLE_H * 60:g} min", ""),
        ("assemble", f"{ASSEMBLE_H * 60:g} min", "until the glue smells no more"),
        ("first light, calibration by weight", f"{LIGHT_H * 60:g} min", "some minutes until weights are trained"),
    )


def _printing_words(data: SheetData) -> str:
    if data.sliced is None:
        return "measured once the parts are sliced"
    mold_s, own_s = printing_s(data.sliced)
    return f"{hours(mold_s)} for the mold, {hours(own_s)} for the endcap's own parts"


def _needs_blocks(data: SheetData) -> list[Block]:
    needs = needed(data)
    header = ("what", "each endcap", "the mold", *(f"for {count} endcaps" for count in COUNTS))
    rows = tuple(
        (need.what, _amount(need.each, need.unit), _amount(need.mold, need.unit),
         *(_total_words(data, need, count) for count in COUNTS))
        for need in needs
    )  # fmt: skip
    slicing = make_command("slice", data)
    without = "" if data.sliced else f" Plastic is missing here until the parts are sliced: {slicing}."
    return [
        Table(header, rows, (2.6, 1.1, 1, 1.8, 1.8), is_small=True),
        Paragraph(
            "What is not in this table is bought once, and serves all of them; look how much is left in the can of "
            f"release agent, in the alcohol and in the gloves.{without}"
        ),
    ]  # fmt: skip


def needed(data: SheetData) -> list[Need]:
    """What an endcap and the mold need, without tools and without consumables that serve for several casts.

    Args:
        data: of the sheet.
    """
    plastics = _plastics(data.sliced) if data.sliced else []
    silicone = Need(data.recipe.silicone.name, data.recipe.part_a_g + data.recipe.part_b_g, 0.0, "g", "kit")
    return [*plastics, silicone, *_screws(data), *_pieces(data.lines)]


def _plastics(sliced: Mapping[str, Any]) -> list[Need]:
    """Plastic by the gram, of one interface."""
    grams: dict[str, list[float]] = {}
    for project in one_interface(sliced):
        pair = grams.setdefault(project["material"], [0.0, 0.0])
        for piece in project["pieces"]:
            pair[is_mold(piece["name"])] += piece["grams"]
    return [Need(name, own, mold, "g", "spool") for name, (own, mold) in grams.items()]


def _screws(data: SheetData) -> list[Need]:
    """Screws by their size: those of the mold are used again."""
    counts: dict[str, list[int]] = {}
    for fit in data.fits:
        pair = counts.setdefault(f"{screw_name(fit)} {fit.joint.standard}", [0, 0])
        pair[is_mold(fit.joint.seat)] += len(fit.joint.places)
    return [Need(name, own, mold, packs="bag") for name, (own, mold) in sorted(counts.items())]


def _pieces(lines: Sequence[BomLine]) -> list[Need]:
    """Other bought parts: nuts and washers that close the mold stay with it, all else goes into each endcap."""
    needs = []
    for line in lines:
        if line.kind == "part" and line.owner != "screws":
            stays = line.use == "closes the mold"
            packs = "batch" if line.owner == "led_ring" else "bag" if BAG.search(line.order_as) else ""
            each, mold = (0.0, line.quantity) if stays else (line.quantity, 0.0)
            needs.append(Need(line.item, each, mold, packs=packs))
    return needs


def _amount(amount: float, unit: str) -> str:
    if not amount:
        return "–"
    return f"{amount:.0f} {unit}" if unit else plain(amount)


def _total_words(data: SheetData, need: Need, count: int) -> str:
    """Amount and packs: ``110: bag of 200``, ``1267 g: 3 x 500 g``."""
    total = need.total(count)
    words = _amount(total, need.unit)
    if need.packs == "bag":
        return f"{words}: bag of {bag_size(math.ceil(total))}"
    if need.packs == "spool":
        spools = spool_count(need.what, total)
        return f"{words}: {spools} {'spool' if spools == 1 else 'spools'}"
    if need.packs == "batch":
        return f"{words}: batch of {max(RING_BATCH, math.ceil(total))}"
    if need.packs == "kit" and (kit := supplies().get(need.what)):
        return f"{words}: {kit_count(total, kit.amount)} x {kit.amount:g} g"
    return words
