"""Chapter of time and number in the build sheet: the days of one endcap, and what more of them need from the same mold.

Each further endcap takes its own printed parts, bought parts, screws and silicone; the mold, its screws and the tools
are used again. Packs are counted on the total: screws for ten come in fewer bags than ten times those for one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cad.dots import dot_pattern
from cad.fasteners import BomLine
from cad.plain_numbers import plain
from cad.silicone_kits import silicone_kits
from fab.bom import BAG_OWNERS, MOLD_USE, RING_BATCH, SCREW_USD, screw_name
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.commands import make_command
from fab.build_sheet.data import SheetData
from fab.build_sheet.prints import one_interface, printing_s
from fab.slice.result import hours, is_mold
from fab.supplies import SPOOL_G, bag_size, filament_item, kit_count, spool_count, spool_usd

COUNTS = (6, 10)  # endcaps: of a robot with three bars, and a round number
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
        usd: price of a piece, a spool or a kit; ``None`` where it is unknown.
    """

    what: str
    each: float
    mold: float = 0.0
    unit: str = ""
    packs: str = ""
    usd: float | None = None

    def total(self, count: int) -> float:
        """Amount for so many endcaps and one mold."""
        return self.mold + count * self.each

    def bought(self, count: int) -> int:
        """Number of pieces, spools or kits to buy for so many endcaps and one mold: whole packs."""
        total = self.total(count)
        if self.packs == "spool":
            return spool_count(self.what, total)
        if self.packs == "kit":
            kit = silicone_kits().get(self.what)
            return kit_count(total, kit.amount_g) if kit else 0
        pieces = math.ceil(total)
        return {"bag": bag_size(pieces), "batch": max(RING_BATCH, pieces)}.get(self.packs, pieces)


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
         *(_total_words(need, count) for count in COUNTS))
        for need in needs
    )  # fmt: skip
    unpriced = ", ".join(need.what for need in needs if need.usd is None)
    sums = (
        f"to pay, without tools{f' and {unpriced}, whose price is unknown' if unpriced else ''}",
        "",
        "",
        *(f"about {paid_usd(data, count):.0f} USD" for count in COUNTS),
    )
    slicing = make_command("slice", data)
    without = "" if data.sliced else f" Plastic is missing here until the parts are sliced: {slicing}."
    return [
        Table(header, (*rows, sums), (2.6, 1.1, 1, 1.8, 1.8), is_small=True),
        Paragraph(
            "What is not in this table is bought once, and serves all of them; look how much is left in the can of "
            "release agent, in the alcohol and in the gloves. Where many kits are named, ask for the silicone's larger "
            f"kit: it costs less by the gram.{without}"
        ),
    ]  # fmt: skip


def needed(data: SheetData) -> list[Need]:
    """What an endcap and the mold need, without tools and without consumables that serve for several casts.

    Args:
        data: of the sheet.
    """
    plastics = _plastics(data.sliced) if data.sliced else []
    mix = data.recipe
    kit = silicone_kits().get(mix.silicone.name)
    silicone = Need(mix.silicone.name, mix.part_a_g + mix.part_b_g, 0.0, "g", "kit", kit.price_usd if kit else None)
    return [*plastics, silicone, *_screws(data), *_pieces(data.lines)]


def _plastics(sliced: Mapping[str, Any]) -> list[Need]:
    """Plastic by the gram, of one interface."""
    grams: dict[str, list[float]] = {}
    for project in one_interface(sliced):
        pair = grams.setdefault(project["material"], [0.0, 0.0])
        for piece in project["pieces"]:
            pair[is_mold(piece["name"])] += piece["grams"]
    return [Need(name, own, mold, "g", "spool", spool_usd(filament_item(name))) for name, (own, mold) in grams.items()]


def _screws(data: SheetData) -> list[Need]:
    """Screws by their size: those of the mold are used again."""
    counts: dict[tuple[str, float], list[int]] = {}
    for fit in data.fits:
        name, usd = f"{screw_name(fit)} {fit.joint.standard}", SCREW_USD[fit.joint.thread]
        pair = counts.setdefault((name, usd), [0, 0])
        pair[is_mold(fit.joint.seat)] += len(fit.joint.places)
    return [Need(name, own, mold, packs="bag", usd=usd) for (name, usd), (own, mold) in sorted(counts.items())]


def _pieces(lines: Sequence[BomLine]) -> list[Need]:
    """Other bought parts: nuts and washers that close the mold stay with it, all else goes into each endcap."""
    needs = []
    for line in lines:
        if line.kind == "part" and line.owner != "screws":
            stays = line.use == MOLD_USE
            packs = "batch" if line.owner == "led_ring" else "bag" if line.owner in BAG_OWNERS else ""
            each, mold = (0.0, line.quantity) if stays else (line.quantity, 0.0)
            usd = None if line.price_usd is None else line.price_usd / line.quantity
            needs.append(Need(line.item, each, mold, packs=packs, usd=usd))
    return needs


def paid_usd(data: SheetData, count: int) -> float:
    """Price of whole packs for so many endcaps and one mold, and of consumables that serve all of them, US dollars.

    Args:
        data: of the sheet.
        count: of endcaps.
    """
    filaments = {filament_item(plastic) for plastic in SPOOL_G}
    once = [line for line in data.lines if line.kind == "consumable" and line.item not in filaments]
    packs = sum(need.bought(count) * (need.usd or 0.0) for need in needed(data))
    return packs + sum(line.paid_usd or 0.0 for line in once)


def _amount(amount: float, unit: str) -> str:
    if not amount:
        return "–"
    return f"{amount:.0f} {unit}" if unit else plain(amount)


def _total_words(need: Need, count: int) -> str:
    """Amount and packs: ``110: bag of 200``, ``1267 g: 3 x 500 g``."""
    words, bought = _amount(need.total(count), need.unit), need.bought(count)
    if need.packs == "spool":
        return f"{words}: {bought} {'spool' if bought == 1 else 'spools'}"
    if need.packs == "kit":
        return f"{words}: {bought} x {silicone_kits()[need.what].amount_g:g} g" if bought else words
    return f"{words}: {need.packs} of {bought}" if need.packs else words
