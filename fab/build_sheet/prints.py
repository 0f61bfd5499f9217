"""Chapter of printing in the build sheet: bed size, opening the projects, parts of each plate and their infill."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from cad.mold.layout import JOINT_CLEARANCE_RANGE_MM, joint_clearance_range_mm
from fab.build_sheet.blocks import Block, Heading, Paragraph, Table
from fab.build_sheet.commands import coupons_line, make_command
from fab.build_sheet.data import SheetData
from fab.slice.printers import MARGIN_MM
from fab.slice.result import hours, is_mold

BED_GATE = ".bed_mm"  # of the export's gates: the smallest square bed of a part in its printing pose


def bed_needed(data: SheetData) -> str:
    """Text on the part that needs the largest bed (gate ``<part>.bed_mm``) and on the printers that take all parts.

    Args:
        data: of the sheet.
    """
    squares = {
        str(check["name"]).removesuffix(BED_GATE): float(check["value"])
        for check in data.checks
        if str(check["name"]).endswith(BED_GATE)
    }
    if not squares or not data.heights_mm:
        return "not known"
    name = max(squares, key=lambda part: squares[part])
    takers = ", ".join(data.fitting_printers) or "no printer of the table takes every part"
    return (
        f"{name} needs the most, a square of {math.ceil(squares[name])} mm when it is turned to fit best; the tallest "
        f"part is {math.ceil(max(data.heights_mm.values()))} mm high; with {MARGIN_MM:g} mm round each part these take "
        f"all: {takers}"
    )


def prints(data: SheetData) -> list[Block]:
    """Chapter of printing: plates and parts.

    Args:
        data: of the sheet.
    """
    title = Heading("Print", 1)
    if data.sliced is None:
        first, second = (make_command(target, data) for target in ("slice", "sheet"))
        bed = f"Bed: {bed_needed(data)}."
        return [
            title,
            Paragraph(_coupon_words(data)),
            Paragraph(bed),
            Paragraph(f"Not sliced yet: run {first}, then {second} again."),
        ]
    return [title, *_made_for(data, data.sliced), *_plates(data, data.sliced), *_filled(data, data.sliced["projects"])]


def _made_for(data: SheetData, sliced: Mapping[str, Any]) -> list[Block]:
    projects, printer = sliced["projects"], sliced["printer"]
    return [
        Paragraph(
            f"Made for {printer['title']} ({printer['size']}, nozzle {printer['nozzle_mm']:g}), layers "
            f"{projects[0]['layer_mm']:g}. Another printer: {make_command('slice', data, 'NAME')}. Times and "
            f"grams were measured on the G-code of {sliced['slicer']}."
        ),
        Paragraph(_coupon_words(data)),
    ]


def _coupon_words(data: SheetData) -> str:
    """Text on the fit coupon, and on which of its joints hold this silicone: many leak through the widest."""
    layout = data.layout
    low, high = joint_clearance_range_mm(layout.params, layout.silicone)
    is_leaky = high < JOINT_CLEARANCE_RANGE_MM[1]
    wider = f", and {layout.silicone} would leak through a wider joint" if is_leaky else ""
    return (
        f"First the fit coupon: {coupons_line(data)}, print its projects fit_joints in PLA, fit_nuts in TPU, with the "
        "filament and the printer of the mold. These "
        f"molds have joints of {layout.joint_clearance_mm:g} mm a side. If another step of the coupon fits, make "
        f"them again with it (joint_clearance=). For this size it can be {low:g} to {high:g} mm{wider}. Where no such "
        "step fits, docs/coupons.md says by how much to correct the outlines in your slicer, of coupon and molds."
    )


def _plates(data: SheetData, sliced: Mapping[str, Any]) -> list[Block]:
    projects, printer = sliced["projects"], sliced["printer"]
    return [
        Heading("Open the projects"),
        Paragraph(
            "The projects lie in the folder slice/, beside sheet/ with this sheet; <plate> is a name of the table "
            "below. PrusaSlicer: File, Open Project, <plate>.prusa.3mf. OrcaSlicer or Bambu Studio: File, Open "
            "Project, <plate>.orca.3mf, and answer that you want it as a project, not geometry only. Pose, filling, "
            f"temperatures and fan are inside. {_preset(printer)} Do not arrange or turn the parts; slice, look at the "
            "first layer, print."
        ),
        Paragraph(
            "Print ONE interface: interface_infill (the slicer makes the gyroid; quick, small) unless you want "
            f"the very gyroid of the CAD files: interface_gyroid.{_one_by_one(data, projects)}"
        ),
        Table(
            ("plate", "material", "parts", "time", "g"),
            tuple(_plate_row(project) for project in projects),
            (1.3, 0.9, 4, 0.8, 0.6),
        ),
    ]


def _one_by_one(data: SheetData, projects: Sequence[Mapping[str, Any]]) -> str:
    """Text on how to print each part alone; empty where no plate has several parts."""
    if all(len(project["pieces"]) <= 1 for project in projects):
        return ""
    return (
        f" A plate is lost when one part on it comes loose: {make_command('slice', data)} plates=single makes one job "
        "for each part."
    )


def _filled(data: SheetData, projects: list[Mapping[str, Any]]) -> list[Block]:
    return [
        Heading("How each part is filled"),
        Table(("part", "filling", "also"), tuple(_fill_rows(projects)), (2.8, 2.8, 1.4)),
        *(
            Paragraph(
                f"{project['name']}: {100 * project['zone']['fraction']:.2f} % of the zone is printed "
                f"(wanted {100 * data.layout.params.gyroid:.4g}), "
                f"{100 * project['zone']['open_share']:.1f} % of its boundary is open for the silicone."
            )
            for project in projects
            if project["zone"]
        ),
        Paragraph(
            "Break off brims and supports, scrape the ramps of the core smooth. Rub the cup's inside and the core's "
            "outside with a fingernail; a blob there becomes a "
            "pit in the dome. The interface's infill must be open at its sides: hold it against a lamp."
        ),
    ]


def mold_sums(data: SheetData) -> tuple[str, float, float] | None:
    """Printing time, grams and US dollars of the mold; ``None`` before it was sliced.

    Args:
        data: of the sheet.
    """
    if data.sliced is None:
        return None
    pieces = [p for project in data.sliced["projects"] for p in project["pieces"] if is_mold(p["name"])]
    grams, cost = (sum(float(piece[key]) for piece in pieces) for key in ("grams", "cost_usd"))
    return hours(printing_s(data.sliced)[0]) + " of printing", grams, cost


def printing_s(sliced: Mapping[str, Any]) -> tuple[float, float]:
    """Printing time of the mold, and of one endcap's own parts with the interface of the slicer's infill, s.

    A plate's time is divided among its parts in proportion to their plastic.

    Args:
        sliced: ``slice.json``.
    """
    mold = own = 0.0
    for project in one_interface(sliced):
        of_mold = sum(piece["grams"] for piece in project["pieces"] if is_mold(piece["name"])) / project["grams"]
        mold += of_mold * project["time_s"]
        own += (1.0 - of_mold) * project["time_s"]
    return mold, own


def one_interface(sliced: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Projects that are printed: of the two of the interface, the one with the slicer's infill.

    Args:
        sliced: ``slice.json``.
    """
    return [project for project in sliced["projects"] if project.get("name") != "interface_gyroid"]


def _preset(printer: Mapping[str, Any]) -> str:
    """Text on the presets of this printer that the files name, and on its own start G-code, which is preferable."""
    slicers = {"prusa": "PrusaSlicer", "orca": "OrcaSlicer or Bambu Studio"}
    named = [f"the .{key}.3mf files name the preset {name}" for key in slicers if (name := printer[f"{key}_printer"])]
    if not named:
        return (
            "Choose your printer's own preset for start, levelling and end; the projects carry plain ones (G28, G29, "
            "a line that fills the nozzle)."
        )
    without = [
        f"{slicer} has none of this printer. " for key, slicer in slicers.items() if not printer[f"{key}_printer"]
    ]
    words = ", ".join(named)
    return (
        f"{words[0].upper()}{words[1:]}. {''.join(without)}The start in the files homes, levels, heats, "
        "and fills the nozzle with a line along the bed's left edge; your printer's own preset may do more (flow, "
        "resonance): choose it where the slicer asks."
    )


def _plate_row(project: Mapping[str, Any]) -> tuple[str, ...]:
    parts = ", ".join(sorted(piece["name"] for piece in project["pieces"]))
    return project["name"], project["material"], parts, hours(project["time_s"]), f"{project['grams']:.0f}"


def _fill_rows(projects: list[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Rows of the infill, one for all parts with the same settings."""
    alike: dict[tuple[str, str], list[str]] = {}
    for project in projects:
        for piece in project["pieces"]:
            name = project["name"] if project["zone"] else piece["name"]
            alike.setdefault(_filling(piece), []).append(name)
    return [(", ".join(sorted(names)), fill, also) for (fill, also), names in alike.items()]


def _filling(piece: Mapping[str, Any]) -> tuple[str, str]:
    s = piece["settings"]
    fill = f"{s['walls']} walls, {s['density_percent']:g} % {s['pattern']}"
    for volume, own in piece["own_settings"].items():
        fill += f"; {volume}: {own['density_percent']:g} % {own['pattern']}, no walls, no top, no bottom, anchors 0"
    extra = (
        f"brim {s['brim_mm']:g}" if s["brim_mm"] else "",
        "support from the bed" if s["support"] else "",
        f"outlines +{s['grow_mm']:.3f}" if s["grow_mm"] else "",
    )
    return fill, ", ".join(word for word in extra if word)
