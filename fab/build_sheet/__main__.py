"""Command `python -m fab.build_sheet D=130 T=8`: the build sheet of one endcap, as HTML and PDF, and its BOM."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cad.materials import silicones
from cad.messages import show
from fab.checks.check import require_passed
from fab.command import VARIANT_DEFAULTS, VARIANT_USAGE, Command, Interrupts, exports_words, parse_variant
from fab.exports.whole_folder import whole_folder, write_record
from fab.progress import Progress
from fab.variant import Variant

if TYPE_CHECKING:
    from cad.fasteners import BomLine
    from fab.build_sheet.data import SheetData
    from fab.build_sheet.pictures import Workshop
    from fab.recipe import Recipe
    from fab.slice.projects import Export

FOLDER = "sheet"
RECORD = "sheet.json"
FIGURES = 6
HELP = """\
options, as NAME=VALUE:
  D=130 T=8        the design; `make molds` with the same options must have run, `make slice` should have
  joint_clearance=0.15  robot=  dots=  dot_mm=  gyroid=   its variant, as molds was given it
  material=NAME    silicone: {materials}
  printer=NAME     has to be that of `make slice` where that has run; else the sheet's commands name it
  exports=DIR      folder that holds D130_T8/ (default: exports/)

Writes D130_T8/sheet/: build_sheet.html, build_sheet.pdf, bom.csv and sheet.json, whole, after every gate has held.
exit status: 0 written; 1 a gate failed; 2 bad input or no export; 130 interrupted
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    command = Command(
        "make sheet",
        f"{VARIANT_USAGE} [printer=NAME] [exports=DIR]",
        "Write the build sheet of an exported endcap.",
        lambda: HELP.format(materials=", ".join(silicones())),
        {**VARIANT_DEFAULTS, "printer": ""},
    )
    return command.run(argv, _act)


def _act(options: dict[str, str], interrupts: Interrupts) -> int:
    variant = parse_variant(options)
    if options["printer"]:
        from fab.slice.printers import printer

        options["printer"] = printer(options["printer"]).name
    return make_sheet(variant, Path(options["exports"]), options["printer"], interrupts.raise_swallowed)


def make_sheet(
    variant: Variant, exports: Path, asked_printer: str = "", check_interrupt: Callable[[], None] = lambda: None
) -> int:
    """Write the build sheet of an export.

    Args:
        variant: what was exported.
        exports: folder that holds ``variant.label``.
        asked_printer: name in the printers' table; empty for that of the slices, or of the molds.
        check_interrupt: raises KeyboardInterrupt where a library swallowed one.

    Returns:
        0.

    Raises:
        ChecksFailedError: a screw does not clamp, a line is missing, or the pot life is too short.
        FileError: no export, or a file cannot be read or written.
        ParameterError: the export was sliced for another printer.
    """
    from fab.bom import bom_csv
    from fab.build_sheet.commands import make_command
    from fab.build_sheet.content import build_document
    from fab.build_sheet.html import write_html
    from fab.build_sheet.pdf import write_pdf
    from fab.build_sheet.sliced import read_slices, require_sliced_for
    from fab.slice.projects import read_export

    export = read_export(variant, exports)
    sliced = read_slices(export)
    require_sliced_for(asked_printer, sliced, export.words)
    with (
        Progress(check_interrupt) as progress,
        whole_folder(export.folder / FOLDER, RECORD, check_interrupt) as folder,
        tempfile.TemporaryDirectory(prefix="sheet-") as scratch,
    ):
        data, own = _collect(export, sliced, Path(scratch), progress)
        data = replace(data, asked_printer=asked_printer, exports_option=exports_words(exports))
        document = build_document(data)
        progress("HTML and PDF")
        write_html(document, folder / "build_sheet.html")
        write_pdf(document, folder / "build_sheet.pdf")
        (folder / "bom.csv").write_text(bom_csv(data.lines), encoding="utf-8")
        write_record(folder, RECORD, own)
    note = "" if sliced else f" (without print times: run {make_command('slice', data)})"
    show(f"{export.folder / FOLDER}: build_sheet.html, build_sheet.pdf, bom.csv, all gates held{note}")
    return 0


def _collect(
    export: Export, sliced: dict[str, Any] | None, folder: Path, progress: Progress
) -> tuple[SheetData, dict[str, Any]]:
    """Measure, check and draw; return the data of the sheet and the content of its record."""
    from cad.mold.core import REMOVAL_ORDER
    from fab.bom import all_joints, bom_checks
    from fab.build_sheet.data import SheetData
    from fab.build_sheet.lighting import ring_checks
    from fab.build_sheet.pictures import fill_depth_mm, step_pictures
    from fab.checks.check import Check
    from fab.checks.extraction import core_path
    from fab.pot_life import require_pot_life
    from fab.recipe import overflow_checks, overflow_of, recipe, shell_volume_mm3
    from fab.steps.endcap import all_steps

    progress("parts and screws")
    shop = open_workshop(export)
    mix = recipe(shell_volume_mm3(export.manifest), overflow_of(shop.layout), export.variant.silicone)
    require_pot_life(shop.layout, mix.cast_volume_mm3)
    depth = fill_depth_mm(shop.layout, mix.cast_volume_mm3 + mix.beyond_mm3)
    ways = {name: core_path(shop.layout, name, shop.meshes[name]) for name in REMOVAL_ORDER}
    steps = all_steps(shop.layout, ways)
    lines = _lines(export, shop, mix, sliced)
    checks = [
        *bom_checks(export.manifest, all_joints(shop.layout), shop.fits, lines),
        Check("recipe.pot_life_to_spare_min", mix.pot_life_to_spare_min, low=0.0),
        Check("recipe.poured_below_seam_mm", depth, low=0.0),
        *overflow_checks(mix),
        *ring_checks(export.params),
    ]
    require_passed(checks, f"at {export.variant.label}")
    pictures = step_pictures(shop, steps, depth, folder, progress) | _other_pictures(export, shop, folder, progress)
    progress("beds")
    records = [check.record(FIGURES) for check in checks]
    listed = [*export.manifest["checks"], *(sliced["checks"] if sliced else []), *records]
    every = list({check["name"]: check for check in listed}.values())  # screws gate both export and sheet
    heights, fitting = _beds(export, shop)
    data = SheetData(
        shop.layout, export.manifest, sliced, mix, shop.fits, steps, lines, every, depth, pictures, heights, fitting
    )
    return data, {"digest": export.params.digest, "recipe": mix.record(), "checks": records}


def _lines(export: Export, shop: Workshop, mix: Recipe, sliced: dict[str, Any] | None) -> list[BomLine]:
    """Lines of the bill of materials."""
    from fab.bom import bom_lines, printed_figures
    from fab.build_sheet.plastic import estimated_plastic_g
    from fab.supplies import plastic_g, with_spools

    plastics = plastic_g(export.manifest["parts"], printed_figures(sliced))
    grams = plastics if sliced else estimated_plastic_g(export.printed, shop.meshes)
    lines = bom_lines(shop.layout, export.manifest, shop.fits, mix, sliced)
    return with_spools(lines, grams, is_estimate=not sliced)


def _other_pictures(export: Export, shop: Workshop, folder: Path, progress: Progress) -> dict[str, Path]:
    """Files of the pictures that belong to no step, by their names in the sheet."""
    from fab.build_sheet.lighting import draw_ring_light
    from fab.build_sheet.pictures import thumbnails

    progress("pictures: parts, ring light")
    pictures = {f"thumb_{name}": path for name, path in thumbnails(shop, folder).items()}
    pictures |= {"cover": export.folder / "exploded.png", "section": export.folder / "section.png"}
    return pictures | {"ring_light": draw_ring_light(export.params, folder)}


def _beds(export: Export, shop: Workshop) -> tuple[dict[str, float], tuple[str, ...]]:
    """Height (mm) of each printed part in its printing pose, and the printers whose beds take all parts."""
    import numpy as np

    from fab.slice.pose import standing
    from fab.slice.printers import fitting_printers

    parts = {name: standing(name, shop.meshes[name].convex_hull) for name in export.printed}
    heights = {name: float(np.ptp(points[:, 2])) for name, points in parts.items()}
    return heights, tuple(f"{p.title} ({p.size})" for p in fitting_printers(parts))


def open_workshop(export: Export) -> Workshop:
    """Read the meshes of all parts: of made ones from their checked STL files, of bought ones from their envelopes.

    Args:
        export: folder of `make molds`.

    Raises:
        FileError: a file is missing or changed, or the adapter has other holes than its robot's rows have now.
    """
    from cad.camera import camera_part
    from cad.led_ring.board import led_ring_part
    from fab.bom import fit_joints
    from fab.build_sheet.pictures import Workshop
    from fab.build_sheet.robot_holes import require_holes
    from fab.meshing.mesh import tessellate
    from fab.slice.projects import read_part

    meshes, colors = {}, part_colors(export)
    for part in export.manifest["parts"]:
        if part["role"] != "bought":
            meshes[part["name"]] = read_part(export, part["name"])
    require_holes(export, meshes["arm_adapter"])
    for make in (led_ring_part, camera_part):
        bought = make(export.params)
        meshes[bought.name], colors[bought.name] = tessellate(bought.solid), bought.color
    layout = export.variant.layout
    return Workshop(layout, meshes, colors, fit_joints(layout, meshes))


def part_colors(export: Export) -> dict[str, tuple[float, float, float]]:
    """Colour (red, green, blue, 0 to 1) of each part, as in the assembly.

    Args:
        export: folder of `make molds`.
    """
    from cad import arm_adapter, base, hanger, interface, ring_spacer, shell
    from cad.mold import core, cup

    stems = {"cup_": cup.COLOR, "core_": core.COLOR, "hanger": hanger.COLOR, "interface": interface.COLOR}
    stems |= {"shell": shell.COLOR, "base": base.COLOR, "ring_spacer": ring_spacer.COLOR}
    stems["arm_adapter"] = arm_adapter.COLOR
    names = [part["name"] for part in export.manifest["parts"] if part["role"] != "bought"]
    return {name: next((c for stem, c in stems.items() if name.startswith(stem)), (0.7, 0.7, 0.7)) for name in names}


if __name__ == "__main__":
    sys.exit(main())
