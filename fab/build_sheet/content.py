"""Text and tables of the build sheet. Each number is read from parameters, manifest, slices, recipe or screws."""

from __future__ import annotations

import re

from cad.dots import dot_pattern
from cad.plain_numbers import plain
from cad.robot_sides import fixing_words, robot_words
from fab.build_sheet.blocks import Block, Document, Heading, Paragraph, Picture, Table
from fab.build_sheet.casting import casting, demolding, silicone
from fab.build_sheet.commands import make_command
from fab.build_sheet.data import SheetData
from fab.build_sheet.finishing import assembling, light_check, painting
from fab.build_sheet.judging import judging, record
from fab.build_sheet.lighting import led_ring
from fab.build_sheet.prints import bed_needed, mold_sums, prints
from fab.build_sheet.several import time_and_number
from fab.build_sheet.shopping import bill
from fab.build_sheet.sums import cost_facts
from fab.part_words import WORKSHOP, height_words
from fab.slice.result import PAPER_MOLD

COVER_RATIO = 0.6  # of the text's width: table and words below the picture stay on its page
GATE_LETTERS = 34  # of a gate's name that fit on its line of the appendix


def build_document(data: SheetData) -> Document:
    """The whole sheet.

    Args:
        data: of the sheet.
    """
    params = data.layout.params
    blocks = [
        *_cover(data),
        *bill(data),
        *time_and_number(data),
        *prints(data),
        *silicone(data),
        *casting(data),
        *demolding(data),
        *judging(data),
        *painting(data),
        *led_ring(data),
        *assembling(data),
        *light_check(data),
        *record(data),
        *_gates(data),
    ]
    subtitle = f"digest of the parameters {params.digest[:12]}; lengths in mm unless marked"
    return Document(f"Endcap D = {plain(params.diameter_mm)}, T = {plain(params.wall_mm)} mm", subtitle, tuple(blocks))


def _cover(data: SheetData) -> list[Block]:
    params, recipe = data.layout.params, data.recipe
    facts = [
        ("made by", make_command("molds", data)),
        ("joints", f"{data.layout.joint_clearance_mm:g} a side"),
        ("silicone dome", f"{plain(params.diameter_mm)} outside, wall {plain(params.wall_mm)}, {height_words(params)}"),
        ("dots", f"{len(dot_pattern(params))} dents of {params.dot_mm:g} diameter, {params.dent_depth_mm:.3g} deep"),
        ("silicone", f"{recipe.silicone.name}: {recipe.part_a_g:.1f} g A + {recipe.part_b_g:.1f} g B"),
        ("cast weighs", f"{recipe.expected_g:.0f} g of silicone"),
        ("gates", f"{len(data.checks)}, all held" if all(c["ok"] for c in data.checks) else "NOT ALL HELD"),
    ]
    fixing = fixing_words(data.robot)
    adapter = f"adapter for {robot_words(data.robot)}: {fixing}" if fixing else "adapter without holes: drill your own"
    facts.append(("robot", adapter))
    facts.append(("print bed", bed_needed(data)))
    if mold := mold_sums(data):
        facts.append(("mold", f"{mold[0]}, {mold[1]:.0f} g of PLA, {mold[2]:.2f} USD ({PAPER_MOLD})"))
    facts += cost_facts(data)
    return [
        Picture(data.pictures["cover"], "what you will build", COVER_RATIO),
        Table((), tuple(facts), (1, 4)),
        Paragraph(
            "Read once to the end before you mix: from the first drop of B the clock runs. The order is buy, print, "
            "cast, demold, judge the dome, paint, make the ring's cable, assemble, test. Order the LED ring's board "
            "first: it is made for you. What stops the cure is in the chapter Silicone: no latex. Commands are typed "
            "in the toolkit's folder."
        ),
        Heading("Words of the steps"),
        Table(("word", "what it is"), tuple(WORKSHOP.items()), (1, 4)),
    ]


def short_limit(limit: str) -> str:
    """A limit to four figures, so that it takes one line: an edge's tolerance of 3e-7 mm makes 0.0989997 of 0.099."""
    return re.sub(r"\d+\.\d+", lambda number: f"{float(number[0]):.4g}", limit)


def _gates(data: SheetData) -> list[Block]:
    """Table of all gates, two in a row, as an appendix: no step of the work needs them."""
    cells = [
        (_breakable(c["name"]), f"{c['value']:.4g}", short_limit(c["limit"]) if c["ok"] else f"{c['limit']} FAILED")
        for c in sorted(data.checks, key=lambda c: bool(c["ok"]))
    ]
    half = -(-len(cells) // 2)
    right = [*cells[half:], ("", "", "")]
    rows = tuple((*left, *other) for left, other in zip(cells[:half], right, strict=False))
    return [
        Heading("Appendix: every gate", 1),
        Paragraph("From manifest.json, slice.json and this sheet's own checks. Nothing is written when one fails."),
        Table(("gate", "value", "limit") * 2, rows, (3.3, 1, 1.4) * 2, is_small=True),
    ]


def _breakable(name: str) -> str:
    """Name of a gate with a permitted line break after the name of the part, if it is too long for its column."""
    return name if len(name) <= GATE_LETTERS else name.replace(".", ".\u200b")
