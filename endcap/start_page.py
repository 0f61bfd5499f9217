"""Page ``start.html`` of ``make endcap``: what the endcap will feel, what to do next, every file with its purpose."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote

from cad.design_arguments import design_words
from cad.materials import DEFAULT_SILICONE
from cad.whole_file import replace_file
from fab.command import exports_words
from fab.variant import Variant, coupons_command, printer_option
from sensing.interpreter import typed_command

PAGE = "start.html"
MEANINGS = {  # of folders and files beside those that index.html explains
    "index.html": "parts, their files, 3-D view and checks",
    "sheet/build_sheet.html": "what to buy, print, mix, cast, demold, paint, assemble and test",
    "sheet/build_sheet.pdf": "the same, to print",
    "study/study.html": "what this endcap will feel",
    "study/study.csv": "the same as a table",
    "study/study.json": "the same for programs",
    "robot_model/endcap.xml": "the endcap for MuJoCo (MJCF), springs fitted to the pressed shell",
    "robot_model/endcap.urdf": "the same as a rigid body (URDF)",
    "robot_model/robot_model.json": "mass, inertia, springs and how wrong they are, for programs",
    "slice/slice.json": "time, material and gates of every print",
    "shell.stl": "the dome as it is cast, as a mesh; it is not printed",
    "manifest.json": "every part, file digest and check, for programs",
}
BY_FOLDER = {
    "slice": "slicer project", "sheet": "of the build sheet", "study": "of the study",
    "robot_model": "of the robot-simulator model",
}  # fmt: skip
BY_ENDING = {
    ".stl": "part as a mesh, to slice", ".3mf": "part as a mesh with name and unit", ".glb": "3-D view",
    ".step": "part or assembly as solid", ".png": "picture", ".safetensors": "weights: field to wrench",
    ".csv": "table", ".zip": "archive",
}  # fmt: skip
STYLE = (
    "body{font:15px/1.45 system-ui,sans-serif;max-width:64rem;margin:1.5rem auto;padding:0 1rem}td{padding:.1rem .8rem "
    ".1rem 0;vertical-align:top}img{max-width:48%}pre{background:#f3f3f3;padding:.6rem;overflow-x:auto}"
)


def write_page(variant: Variant, exports: Path, printer: str, skipped: Sequence[str]) -> None:
    """Write the page that lists everything into the folder of the variant.

    Args:
        variant: the design, its joint clearance, silicone and robot.
        exports: folder that holds that of the variant.
        printer: name in the printers' table; empty where none was given.
        skipped: titles of the steps left out.
    """
    folder = exports / variant.label
    shown = {"exploded.png": "the parts, pulled apart", "section.png": "section of the endcap"}
    pictures = "".join(f'<img src="{file}" alt="{alt}">' for file, alt in shown.items() if (folder / file).is_file())
    missing = f"<p>Left out: {escape(', '.join(skipped))} (its own message is in the terminal).</p>" if skipped else ""
    title = f"Endcap {folder.name}"
    commands = escape(_next(variant, exports, printer))
    body = (
        f"<h1>{escape(title)}</h1><p>{escape(_checks(folder))}</p>{missing}{pictures}<h2>What it will feel</h2>"
        f"<table>{_figures(folder)}</table><h2>Next</h2><pre tabindex='0'>{commands}</pre>"
        f"<h2>Every file</h2><table>{_files(folder)}</table>"
    )
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head><body><main>{body}</main></body></html>\n"
    )
    replace_file(folder / PAGE, page.encode(errors="replace"))  # a file of one's own may have a name that is no UTF-8


def _checks(folder: Path) -> str:
    try:
        checks = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))["checks"]
    except (OSError, ValueError, KeyError):
        return "Its manifest cannot be read: make the molds again."
    return f"{len(checks)} checks of the parts passed, on files that were read back."


def _figures(folder: Path) -> str:
    try:
        with (folder / "study" / "study.csv").open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
    except OSError:
        return ""
    return "".join(
        f"<tr><td>{escape(row['name'])}</td><td>{escape(_short(row['value'], row['unit']))}</td>"
        f"<td>{escape(row['source'])}</td></tr>"
        for row in rows
    )


def _short(value: str, unit: str) -> str:
    """A value in the format of the study's page: three digits, larger numbers whole."""
    if not value:
        return "–"
    digits = f"{float(value):.0f}" if abs(float(value)) >= 999.5 else f"{float(value):.3g}"
    return f"{digits} {unit}".strip()


def _next(variant: Variant, exports: Path, printer: str) -> str:
    design, material = design_words(variant.params), variant.silicone
    other = ("--silicone", material) if material != DEFAULT_SILICONE else ()
    where = (f" {printer_option(printer)}" if printer else "") + exports_words(exports)
    sheet, coupons = f"{variant.command('sheet')}{where}", f"{coupons_command(material)}{where}"
    calibrate = ("--photo", "a.jpg", *design, "--out", "camera.json", "--picture", "fit.png")
    return "\n".join([
        f"{coupons:<64} # print the fit coupon first; give what fits as joint_clearance=",
        f"{sheet:<64} # {variant.label}/sheet/build_sheet.pdf: print, cast, assemble",
        f"{typed_command('sensing.live', *design, *other)}    # the simulated robot of this size, with its weights",
        typed_command("sensing.calibrate", *calibrate),
        typed_command("sensing.live", "--camera", "0", *design, *other),
    ])  # fmt: skip


def _files(folder: Path) -> str:
    rows = []
    for path in sorted(folder.rglob("*"), key=lambda path: (len(path.relative_to(folder).parts), str(path))):
        name = path.relative_to(folder).as_posix()
        if path.is_file() and name != PAGE and not path.name.startswith("."):
            top = name.split("/")[0] if "/" in name else ""
            ring = "of the LED ring" if top.startswith("led_ring") else ""
            meaning = MEANINGS.get(name) or ring or BY_FOLDER.get(top) or BY_ENDING.get(path.suffix, "")
            size = f"{max(1, round(path.stat().st_size / 1000))} kB"
            link = f'<a href="{quote(os.fsencode(name))}">{escape(name)}</a>'
            rows.append(f"<tr><td>{link}</td><td>{escape(meaning)}</td><td>{size}</td></tr>")
    return "".join(rows)
