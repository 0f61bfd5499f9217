"""Chapters of what to buy and have ready, of cure inhibition, and of the provenance letters, in the build sheet."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from cad.fasteners import BomLine
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.data import SheetData

LEGEND = (
    ("P", "stated in the paper of the released sensor"),
    ("M", "measured on a released file or photo"),
    ("S", "a standard or data sheet"),
    ("E", "our estimate: check it before you rely on it"),
)


def safety(data: SheetData) -> list[Block]:
    """Chapter of what inhibits the cure and what damages the mold, to be read before any container is opened.

    Args:
        data: of the sheet.
    """
    name = data.recipe.silicone.name
    return [
        Heading("Before you open the silicone", 2),
        Table(
            ("keep away", "because"),
            (
                ("latex gloves, rubber bands and tubes that touch silicone, sulphur clay, tin-cure silicone, "
                 "fresh resin prints, new epoxy or polyurethane paint",
                 f"{name} is cured by platinum; sulphur, amines, tin and uncured resin stop it, and the surface stays "
                 "sticky. Wear nitrile or vinyl gloves. A rubber band may hold the bowl from outside"),
                ("urethane rubbers in this mold, ReoFlex 60 for one", "they bond to PLA and TPU and stay there; the "
                 "mold is made for addition-cure silicone with a release agent"),
                ("spray of release agent on the TPU interface", "silicone must hold in its gyroid"),
            ),
            (2, 3),
        ),
        Paragraph(
            "The first time, and with another brand of filament: cure a spoonful of silicone on a spare print "
            "overnight. If it is sticky where it touched the plastic, the plastic stops the cure: do not cast. Read "
            "the data sheets of silicone and release agent, air the room, and wear safety glasses when you mix and "
            "demold."
        ),
    ]  # fmt: skip


def bill(data: SheetData) -> list[Block]:
    """Chapter of the bill of materials: parts to make, things to buy, tools to have.

    Args:
        data: of the sheet.
    """
    made = [line for line in data.lines if line.kind == "made"]
    parts = [line for line in data.lines if line.kind == "part"]
    casting = [line for line in data.lines if line.kind in ("silicone", "consumable")]
    tools = [line for line in data.lines if line.kind == "tool"]
    widths = (0.9, 2.2, 3.3, 0.8, 1.9, 0.7, 0.4)
    header = ("", "item", "order as", "how many", "for", "USD, pack", "")
    return [
        Heading("What you need", 1),
        Paragraph(
            "The same lines are in bom.csv. A part number names one that fits; any other of the same value, size and "
            "rating does as well. Prices are estimates in US dollars. For a printed part it is the plastic in it, by "
            "the gram. For all else it is what is paid for the whole pack that is ordered (bag, spool, kit, batch). "
            "bom.csv has both prices. The last column says where a line comes from: "
            + "; ".join(f"{letter} {words}" for letter, words in LEGEND)
            + "."
        ),
        Heading("Print"),
        Table(
            ("", "part", "how many", "for", "USD, plastic"),
            _alike(data, made),
            (0.9, 2.2, 1, 3, 0.8),
        ),
        Heading("Buy: parts"),
        Table(header, _rows(data, parts), widths),
        Heading("Buy: silicone and what casting uses up"),
        Table(header, _rows(data, casting), widths),
        Heading("Have at hand"),
        Table(("tool", "which", "for"), tuple((t.item, t.order_as, t.use) for t in tools), (1.5, 3, 2.5)),
    ]


def _alike(data: SheetData, made: Sequence[BomLine]) -> tuple[tuple[str | Path, ...], ...]:
    """Rows of the made parts; those of one kind (cup_bowl_1, _2, _3) share a row."""
    kinds: dict[str, list[BomLine]] = {}
    for line in made:
        kinds.setdefault(re.sub(r"_\d$", "", line.owner), []).append(line)
    rows = []
    for kind, lines in kinds.items():
        count = sum(line.quantity for line in lines)
        name = lines[0].item if len(lines) == 1 else lines[0].item.replace(lines[0].owner, f"{kind}_1 to {len(lines)}")
        price = "" if lines[0].price_usd is None else f"{sum(line.price_usd or 0.0 for line in lines):.2f}"
        use = lines[0].use + (" each" if len(lines) > 1 and lines[0].price_usd is not None else "")
        rows.append((_picture(data, lines[0]), name, f"{count:g} pc", use, price))
    return tuple(rows)


def _rows(data: SheetData, lines: Sequence[BomLine]) -> tuple[tuple[str | Path, ...], ...]:
    return tuple(
        (_picture(data, line), line.item, line.order_as, _amount(line), line.use, _price(line), line.provenance)
        for line in lines
    )


def _picture(data: SheetData, line: BomLine) -> str | Path:
    return data.pictures.get(f"thumb_{line.owner}", "")


def _amount(line: BomLine) -> str:
    unit = "spools" if line.unit == "spool" and line.quantity != 1 else line.unit
    return f"{line.quantity:g} {unit}"


def _price(line: BomLine) -> str:
    return "" if line.paid_usd is None else f"{line.paid_usd:.2f}"
