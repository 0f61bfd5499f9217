"""The words and tables of the build sheet. Every number comes from parameters, manifest, slices, recipe or screws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cad.dots import DENT_DEPTH_MM, DOT_RADIUS_MM, dot_pattern
from fab.build_sheet.blocks import Block, Document, Heading, Paragraph, Picture, Table
from fab.build_sheet.casting import casting, demolding, silicone
from fab.build_sheet.commands import make_command
from fab.build_sheet.data import SheetData
from fab.build_sheet.finishing import assembling, light_check, painting
from fab.build_sheet.lighting import led_ring
from fab.build_sheet.shopping import bill, safety
from fab.slice.result import hours, is_mold

PAPER_MOLD_USD = 8.50  # P


def build_document(data: SheetData) -> Document:
    """The whole sheet."""
    params = data.layout.params
    blocks = [
        *_cover(data),
        *safety(data),
        *bill(data),
        *_prints(data),
        *silicone(data),
        *casting(data),
        *demolding(data),
        *painting(data),
        *led_ring(data.layout.params, data.pictures["ring_light"]),
        *assembling(data),
        *light_check(data),
        *_gates(data),
    ]
    subtitle = f"digest of the parameters {params.digest[:12]}; lengths in mm unless marked"
    return Document(f"Endcap D = {params.diameter_mm:g}, T = {params.wall_mm:g} mm", subtitle, tuple(blocks))


def _cover(data: SheetData) -> list[Block]:
    params, recipe = data.layout.params, data.recipe
    facts = [
        ("silicone dome", f"{params.diameter_mm:g} outside, wall {params.wall_mm:g}, {params.tip_height_mm:.1f} high"),
        ("dots", f"{len(dot_pattern(params))} dents of {2 * DOT_RADIUS_MM:g} diameter, {DENT_DEPTH_MM:g} deep"),
        ("silicone", f"{recipe.silicone.name}: {recipe.part_a_g:.1f} g A + {recipe.part_b_g:.1f} g B"),
        ("cast weighs", f"{recipe.expected_g:.0f} g of silicone"),
        ("gates", f"{len(data.checks)}, all held" if all(c["ok"] for c in data.checks) else "NOT ALL HELD"),
    ]
    if mold := _mold_sums(data):
        facts.append(
            ("mold", f"{mold[0]}, {mold[1]:.0f} g of PLA, {mold[2]:.2f} USD (the paper: about {PAPER_MOLD_USD:.2f})")
        )
    total = sum(line.price_usd or 0.0 for line in data.lines)
    facts.append(("everything", f"about {total:.0f} USD, small things bought whole"))
    return [
        Picture(data.pictures["cover"], "what you will build"),
        Table(("", ""), tuple(facts), (1, 4)),
        Paragraph(
            "Read once to the end before you mix: from the first drop of B the clock runs. The order is print, "
            "buy, cast, demold, paint, assemble, test. Commands are typed in the toolkit's folder."
        ),
    ]


def _prints(data: SheetData) -> list[Block]:
    title = Heading("Print", 1)
    if data.sliced is None:
        first, second = (make_command(target, data) for target in ("slice", "sheet"))
        return [title, Paragraph(f"Not sliced yet: run {first}, then {second} again.")]
    projects = data.sliced["projects"]
    return [
        title,
        Paragraph(
            f"Open <part>.prusa.3mf in PrusaSlicer or <part>.orca.3mf in OrcaSlicer or Bambu Studio: pose and settings "
            f"are inside. Layers {projects[0]['settings']['layer_mm']:g}, nozzle 0.4. Times and grams were measured on "
            f"the G-code of {data.sliced['slicer']}."
        ),
        Paragraph(
            "Print ONE interface: interface_infill (the slicer makes the gyroid; quick, small) unless you want "
            "the very gyroid of the CAD files: interface_gyroid."
        ),
        Table(
            ("project", "material", "filling", "also", "time", "g"),
            tuple(_print_row(project) for project in projects),
            (2, 1.1, 2.4, 2.2, 1, 0.7),
        ),
        *(
            Paragraph(
                f"{project['name']}: {100 * project['zone']['fraction']:.2f} % of the zone is printed (wanted 10), "
                f"{100 * project['zone']['open_share']:.1f} % of its boundary is open for the silicone."
            )
            for project in projects
            if project["zone"]
        ),
        Paragraph(
            "Before you go on: rub the cup's inside and the core's outside with a fingernail; a blob there becomes a "
            "pit in the dome. The interface's infill must be open at its sides: hold it against a lamp."
        ),
    ]


def _print_row(project: Mapping[str, Any]) -> tuple[str, ...]:
    own_settings, s = project["own_settings"], project["settings"]
    fill = f"{s['walls']} walls, {s['density_percent']:g} % {s['pattern']}"
    for volume, own in own_settings.items():
        fill += f"; {volume}: {own['density_percent']:g} % {own['pattern']}, no walls, no top, no bottom, anchors 0"
    extra = (
        f"brim {s['brim_mm']:g}" if s["brim_mm"] else "",
        "support from the bed" if s["support"] else "",
        f"outlines +{s['grow_mm']:.3f}" if s["grow_mm"] else "",
    )
    also = ", ".join(word for word in extra if word)
    return project["name"], project["material"], fill, also, hours(project["time_s"]), f"{project['grams']:.1f}"


def _gates(data: SheetData) -> list[Block]:
    """All gates, two a row: they are for whoever doubts, not for the bench."""
    cells = [
        (c["name"], f"{c['value']:.5g}", c["limit"] if c["ok"] else f"{c['limit']} FAILED")
        for c in sorted(data.checks, key=lambda c: bool(c["ok"]))
    ]
    half = -(-len(cells) // 2)
    right = [*cells[half:], ("", "", "")]
    rows = tuple((*left, *other) for left, other in zip(cells[:half], right, strict=False))
    return [
        Heading("Appendix: every gate", 1),
        Paragraph("From manifest.json, slice.json and this sheet's own checks. Nothing is written when one fails."),
        Table(("gate", "value", "limit") * 2, rows, (3.4, 1, 1.3) * 2, is_small=True),
    ]


def _mold_sums(data: SheetData) -> tuple[str, float, float] | None:
    if data.sliced is None:
        return None
    mold = [p for p in data.sliced["projects"] if is_mold(p["name"])]
    return (
        hours(sum(p["time_s"] for p in mold)) + " of printing",
        sum(p["grams"] for p in mold),
        sum(p["cost_usd"] for p in mold),
    )
