"""Supplies besides the parts: rows of ``supplies.csv`` with order, amount and purpose."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from cad.data_table import positive, read_table
from cad.fasteners import BomLine
from cad.lens import camera_module
from cad.materials import silicones
from cad.mold.layout import MoldLayout
from cad.robot_sides import DEFAULT_ROBOT, robot_side
from cad.silicone_kits import silicone_kits
from fab.lift import lift_kg
from fab.recipe import Recipe
from fab.slice.filaments import filament
from fab.steps.mold import core_passes_gyroid

TABLE = Path(__file__).with_name("supplies.csv")
KINDS = ("part", "consumable", "tool")
CUP_TIMES = 5  # E: volume of the foam during degassing, over that of the mix
STIR_TIMES = 2  # E: of the volume, where nothing foams: room to stir
DEGAS_USE = "degas"  # of rows that are needed only where the pot life leaves time to degas
DRILL_USE = "holes of the adapter for your robot"  # of rows that are needed only where its robot side is blank
BLANK = re.compile(r"\{(\w+)\}")
LEVEL_LIES_MM = 3.0  # E: of a spirit level on the dam, at either end
SPOOL_G = {"PLA": 1000.0, "TPU 95A": 500.0, "PETG": 1000.0}  # of the rows of supplies.csv
CUP_G, CUP_G_ML = 500.0, 0.05  # E: mass of a cup that the scale carries, too: the least, and of a bucket by its size
STAYS_IN_BOTTLES = 1.02  # E: ratio of the mass bought to the mass weighed out
SPARE = 1.1  # E: skirts, brims, and a part that fails
ESTIMATE_ERROR = 0.15  # E: of the plastic before it is sliced (fab/build_sheet/plastic.py has what was measured)
LEAST_CHAMBER_L = 5
CHAMBER_TIMES = 1.3  # E: a round chamber round a round cup, with a finger's breadth to lift it out
PACKS = (10, 20, 50, 100, 200, 500)  # E: how many screws a bag holds
SPARE_SCREWS = 1  # E: of each kind, at the least: one that falls must not stop a cast while the clock runs
CALIPERS_MM = (150, 200, 300)  # S: usual measuring ranges
CALIPER_SPARE_MM = 5.0  # E: of the range, beyond the length that is measured
RULER_BEYOND_MM = 30.0  # E: of a ruler on the interface's flange, on both sides of its bore together


@dataclass(frozen=True)
class Supply:
    """One row.

    Attributes:
        name: of the item.
        kind: one of ``KINDS``.
        order_as: what to order; the blanks of :func:`supply_lines` are filled in, such as ``{cup_ml}``.
        amount: how much, in ``unit``.
        unit: of the amount.
        use: its purpose; the same blanks are filled in.
        price_usd: of the amount; ``None`` for tools that a workshop has.
        provenance: letter of docs/provenance.md, and why.
    """

    name: str
    kind: str
    order_as: str
    amount: float
    unit: str
    use: str
    price_usd: float | None
    provenance: str

    @property
    def letter(self) -> str:
        """The first letter of the provenance."""
        return self.provenance[:1]


@cache
def supplies() -> dict[str, Supply]:
    """The table, name -> row.

    Raises:
        FileError: a missing or unreadable table, naming the line.
    """
    return read_table(TABLE, _supply)


def supply_lines(mix: Recipe, layout: MoldLayout, robot: str = DEFAULT_ROBOT) -> list[BomLine]:
    """Lines of the parts, consumables and tools that no part of the design requires by itself.

    Args:
        mix: recipe of the cast.
        layout: mold sizes.
        robot: row of cad/robot_sides.csv that the arm adapter fits.
    """
    blanks = _blanks(mix, layout, robot)

    def filled(text: str) -> str:
        return BLANK.sub(lambda found: blanks.get(found[1], found[0]), text)

    is_left_out = {DEGAS_USE: not mix.is_degassed, DRILL_USE: bool(robot_side(robot))}
    return [
        BomLine(
            row.name, row.amount, row.unit, row.name, filled(row.use), row.price_usd, row.letter,
            filled(row.order_as), row.kind, spool_usd(row.name),
        )
        for row in supplies().values()
        if not is_left_out.get(row.use, False)
    ]  # fmt: skip


def _blanks(mix: Recipe, layout: MoldLayout, robot: str) -> dict[str, str]:
    """Values of the blanks in the texts of the table; other words in braces stay unchanged."""
    mixed_g = mix.part_a_g + mix.part_b_g
    cup_times = CUP_TIMES if mix.is_degassed else STIR_TIMES
    cup_ml = math.ceil(cup_times * mixed_g / mix.silicone.density_g_cm3 / 100) * 100
    across_dam_mm = 2 * (layout.piston_radius_mm + layout.joint_clearance_mm + LEVEL_LIES_MM)
    keys = [f", {holes.key_mm:g} (M{holes.body_mm:g} of the robot's flange)" for holes in robot_side(robot)
            if holes.key_mm]  # fmt: skip
    return {
        "cup_ml": f"{cup_ml:g}",
        "cup_times": str(cup_times),
        "scale_g": f"{math.ceil((mixed_g + max(CUP_G, CUP_G_ML * cup_ml)) / 500) * 500:g}",
        "chamber_l": f"{max(LEAST_CHAMBER_L, math.ceil(CHAMBER_TIMES * cup_ml / 5000) * 5):g}",
        "and_degas": " and degas" if mix.is_degassed else "",
        "level_mm": str(math.ceil(across_dam_mm / 10) * 10),
        "dot_mm": f"{layout.params.dot_mm:g}",
        "caliper_mm": str(caliper_mm(layout.params.tip_height_mm)),
        "tape_m": f"{math.ceil(2 * math.pi * layout.params.outer_radius_mm / 500) / 2:g}",
        "lift_kg": f"{lift_kg(layout, mix):g}",
        "rod_mm": str(math.ceil((2 * layout.params.bore_radius_mm + RULER_BEYOND_MM) / 10) * 10),
        "and_core": "" if core_passes_gyroid(layout) else ", and the interface while the core goes into it",
        "robot_key": "".join(keys),
    }


def caliper_mm(length_mm: float) -> int:
    """Measuring range of the smallest usual caliper whose depth rod reaches so far, mm.

    Args:
        length_mm: mm.
    """
    return next(size for size in CALIPERS_MM if size >= length_mm + CALIPER_SPARE_MM)


def spool_usd(item: str) -> float | None:
    """Price of one spool from the price of a kilogram; ``None`` for an item that is no filament.

    Args:
        item: name of a row, such as ``PLA filament``.
    """
    plastic = next((name for name in SPOOL_G if item == filament_item(name)), None)
    return None if plastic is None else SPOOL_G[plastic] / 1000 * filament(plastic).price_usd_kg


def plastic_g(parts: Sequence[Mapping[str, Any]], figures: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Grams of each plastic in the printed parts.

    Args:
        parts: of the manifest.
        figures: grams and price of each part that was sliced.
    """
    grams: dict[str, float] = {}
    for part in parts:
        if part["name"] in figures:
            grams[part["material"]] = grams.get(part["material"], 0.0) + part["quantity"] * figures[part["name"]][0]
    return grams


def with_spools(lines: Sequence[BomLine], grams: Mapping[str, float], is_estimate: bool = False) -> list[BomLine]:
    """Lines of the bill with the number of spools that the prints need.

    Args:
        lines: of the bill.
        grams: of each plastic; the line of a plastic that is missing keeps the amount of the table.
        is_estimate: whether the grams are estimated, and not sliced; then the lines name them with their range.
    """
    plastics = {filament_item(plastic): plastic for plastic in SPOOL_G if grams.get(plastic)}
    counted = []
    for line in lines:
        if plastic := plastics.get(line.item):
            spools = spool_count(plastic, grams[plastic])
            use = line.use + (f"; {estimate_words(grams[plastic])}" if is_estimate else "")
            line = replace(line, quantity=spools, pack_usd=spools * (spool_usd(line.item) or 0.0), use=use)
        counted.append(line)
    return counted


def estimate_words(grams: float) -> str:
    """Text on the plastic of prints that are not sliced: ``estimated 680 to 920 g until sliced``.

    Args:
        grams: as estimated.
    """
    low, high = ((1 + sign * ESTIMATE_ERROR) * grams for sign in (-1, 1))
    digits = 0 if high < 100 else -1
    return f"estimated {round(low, digits):.0f} to {round(high, digits):.0f} g until sliced"


def camera_supply() -> Supply:
    """The camera module (:mod:`cad.lens`)."""
    module = camera_module()
    return Supply("camera module", "part", module.order_as, 1, "pc", "camera", module.price_usd, module.provenance)


def silicone_line(mix: Recipe) -> BomLine:
    """Line of the silicone: kits to buy, and the mass in the cast.

    Args:
        mix: recipe of the cast.
    """
    grams = round(mix.part_a_g + mix.part_b_g, 1)
    item = f"{mix.silicone.name}: {mix.part_a_g:.1f} g A, {mix.part_b_g:.1f} g B"
    kit = silicone_kits().get(mix.silicone.name)
    if kit is None:
        return BomLine(item, grams, "g", "shell", "cast", None, "E", _kit_missing(mix.silicone.name), "silicone")
    count = kit_count(grams, kit.amount_g)
    order = f"{count} x {kit.order_as} ({kit.amount_g:g} g)"
    price = None if kit.price_usd is None else count * kit.price_usd
    return BomLine(item, grams, "g", "shell", "cast", price, kit.provenance[:1], order, "silicone")


def _kit_missing(name: str) -> str:
    """What the bill says instead of an order; a kit under a name that differs a little is named."""
    near = next(iter(difflib.get_close_matches(name, [kit for kit in silicone_kits() if kit not in silicones()])), "")
    wrong = f"; its row {near!r} is of no silicone of cad/materials.csv" if near else ""
    return f"add its kit to cad/silicone_kits.csv under the name {name!r}{wrong}"


def bag_size(count: int) -> int:
    """Size of the smallest bag with enough screws and a spare one.

    Args:
        count: of screws that are needed.
    """
    wanted = count + SPARE_SCREWS
    return next((size for size in PACKS if size >= wanted), wanted)


def spool_count(plastic: str, grams: float) -> int:
    """Number of spools of a plastic.

    Args:
        plastic: name, such as ``TPU 95A``.
        grams: in the printed parts.
    """
    return math.ceil(SPARE * grams / SPOOL_G[plastic])


def kit_count(grams: float, kit_g: float) -> int:
    """Number of kits of a silicone.

    Args:
        grams: to be weighed out.
        kit_g: mass of one kit, g.
    """
    return math.ceil(STAYS_IN_BOTTLES * grams / kit_g)


def filament_item(plastic: str) -> str:
    """Name of the row of supplies.csv for a plastic: ``TPU filament`` for TPU 95A.

    Args:
        plastic: name, such as ``TPU 95A``.
    """
    return f"{plastic.split()[0]} filament"


def _supply(row: dict[str, str]) -> Supply:
    if row["kind"] not in KINDS:
        kit = "; the kit of a silicone is a row of cad/silicone_kits.csv" if row["kind"] == "silicone" else ""
        raise ValueError(f"kind={row['kind']!r} is none of {', '.join(KINDS)}{kit}")
    price = positive(row, "price_usd") if row["price_usd"] else None
    amount = positive(row, "amount")
    return Supply(row["name"], row["kind"], row["order_as"], amount, row["unit"], row["use"], price, row["provenance"])
