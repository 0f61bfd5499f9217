"""``index.html`` of an export folder: its contents and the next steps, readable without this toolkit or a network."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from cad.dots import dot_pattern
from cad.lens import camera_module, camera_setting
from cad.materials import silicone
from cad.plain_numbers import plain
from cad.robot_sides import DEFAULT_ROBOT
from fab.checks.check import Check
from fab.part_words import height_words
from fab.slice.printers import DEFAULT_PRINTER, printer, printer_words
from fab.variant import Variant, coupons_command, size_words

PAGE = "index.html"
PREVIEW = "preview.glb"
KINDS = {
    ".stl": "mesh for slicing; exact to 0.01 mm",
    ".3mf": "the same mesh with its name and unit, for any slicer",
    ".step": "solid for CAD programs",
    ".glb": "meshes with names and colours, to look at",
    ".png": "picture",
}
SHARED = {
    "assembly.step": "endcap put together; the interface as its flange and the plain envelope of its gyroid",
    "assembly.glb": "endcap put together, with the gyroid as it is printed",
    "exploded.step": "endcap pulled apart; the interface as in assembly.step",
    "exploded.glb": "endcap pulled apart, with the gyroid as it is printed",
    "mold.step": "closed mold round the interface (flange and envelope)",
    "mold.glb": "closed mold round the interface, with the gyroid as it is printed",
    PREVIEW: "what turns above: coarse, the gyroid's sheet as one layer, the dome without the gyroid's imprint",
    "exploded.png": "picture: endcap pulled apart",
    "section.png": "picture: section of the endcap",
    "parts.png": "picture: every part",
    "manifest.json": "for programs: parameters, parts, volumes, every check, SHA-256 of every file",
}
ROLES = {"printed": "print", "cast": "cast", "bought": "buy"}


def write_index(
    variant: Variant, manifest: Mapping[str, Any], checks: Sequence[Check], preview: bytes, folder: Path
) -> None:
    """Write ``preview.glb`` and ``index.html``.

    Args:
        variant: variant of the design in the folder.
        manifest: content of ``manifest.json``, as it will be written.
        checks: all checks, passed.
        preview: content of ``preview.glb``, which the page shows rotating.
        folder: folder with all other files.
    """
    (folder / PREVIEW).write_bytes(preview)
    (folder / PAGE).write_text(_page(variant, manifest, checks, preview, folder), encoding="utf-8")


def _page(variant: Variant, manifest: Mapping[str, Any], checks: Sequence[Check], preview: bytes, folder: Path) -> str:
    title = f"Endcap D = {plain(variant.params.diameter_mm)} mm, T = {plain(variant.params.wall_mm)} mm"
    static = files("fab.exports")
    script = "".join(static.joinpath(name).read_text("utf-8") for name in ("viewer.js", "index_page.js"))
    style = static.joinpath("index_page.css").read_text("utf-8")
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src 'self' data: file:; "
        "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n"
        f"<style>{style}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n"
        f'<p class="sub">{escape(_subtitle(variant))}</p>\n{_turning(preview)}\n{_facts(variant, manifest)}\n'
        f"{_next_steps(variant, manifest)}\n{_pictures()}\n{_parts(manifest, folder)}\n{_shared(folder)}\n"
        f"{_checks(checks)}\n</main>\n"
        f"<script>\n{script}</script>\n</body>\n</html>\n"
    )


def _subtitle(variant: Variant) -> str:
    clearance = f"joint clearance {variant.layout.joint_clearance_mm:g} mm"
    return f"{variant.silicone}, {clearance}; digest of the parameters {variant.params.digest[:12]}"


def _turning(preview: bytes) -> str:
    return (
        '<canvas id="turn" tabindex="0" aria-label="the parts in three dimensions: drag or use the arrow keys to turn, '
        'wheel or + and - to scale"></canvas>\n<p id="note">Drag to turn, wheel to scale.</p>\n<div class="knobs">'
        '<label>show <select id="group"><option value="endcap">endcap</option><option value="mold">mold</option>'
        '</select></label><label>pull apart <input id="pull" type="range" min="0" max="100" value="0"></label>'
        '<label><input id="cut" type="checkbox"> cut in half</label></div>\n'
        f'<script id="glb" type="application/octet-stream">{base64.b64encode(preview).decode()}</script>'
    )


def _facts(variant: Variant, manifest: Mapping[str, Any]) -> str:
    params = variant.params
    row = silicone(variant.silicone)
    volume = next(p["volume_mm3"]["mesh"] for p in manifest["parts"] if p["name"] == "shell")
    facts = (
        (
            "dome",
            f"{plain(params.diameter_mm)} mm outside, wall {plain(params.wall_mm)} mm, {height_words(params, ' mm')}",
        ),
        (
            "dots",
            f"{len(dot_pattern(params))} dents of {params.dot_mm:g} mm, {params.dent_depth_mm:.3g} mm deep, inside",
        ),
        ("silicone in the dome", f"{volume / 1000:.0f} ml, {volume * row.density_g_cm3 / 1000:.0f} g of {row.name}"),
        ("robot", str(manifest.get("robot", DEFAULT_ROBOT))),
        ("camera", camera_module().name),
        ("gyroid", f"period {manifest['gyroid']['period_mm']:.2f} mm, {100 * manifest['gyroid']['density']:.1f} % TPU"),
    )
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(words)}</td></tr>" for name, words in facts)
    return f"<table>{rows}</table>"


def _next_steps(variant: Variant, manifest: Mapping[str, Any]) -> str:
    where = printer(str(manifest.get("printer", DEFAULT_PRINTER)))
    asked = printer_words(where.name)
    ring = f"{camera_setting()}make ring {size_words(variant.params)}"
    steps = (
        (f"{variant.command('slice')}{asked}", f"slicer projects, in slice/ ({where.title}; printer=NAME for another)"),
        (variant.command("sheet"), "what to buy, print, mix, cast, assemble and test, in sheet/build_sheet.pdf"),
        (ring, "LED ring: board files for a board house, beside this folder"),
        (f"{variant.command('molds')}{asked}", "makes this folder again"),
    )  # fmt: skip
    width = max(len(command) for command, _ in steps)
    lines = "\n".join(f"{escape(command.ljust(width))}  # {escape(words)}" for command, words in steps)
    return (
        "<h2>What to do next</h2>\n<p>In the toolkit's folder, in this order. Print the fit coupon first "
        f"(<code>{escape(coupons_command(variant.silicone) + asked)}</code>) and give what fits as joint_clearance=. "
        "Where this folder lies elsewhere than in the toolkit's exports/, add exports= with the folder that holds it. "
        f"Without the toolkit: slice the STL or 3MF files by hand.</p>\n<pre tabindex='0'>{lines}</pre>\n"
        '<p>Made by them, once they have run: <a href="sheet/build_sheet.html">build sheet</a>, '
        '<a href="slice/">slicer projects</a>.</p>'
    )


def _pictures() -> str:
    shown = (("exploded.png", "pulled apart"), ("section.png", "section"), ("parts.png", "every part"))
    cells = "".join(
        f'<figure><a href="{name}"><img src="{name}" alt="{words}"></a><figcaption>{words}</figcaption></figure>'
        for name, words in shown
    )
    return f'<h2>Pictures</h2>\n<div class="pictures">{cells}</div>'


def _parts(manifest: Mapping[str, Any], folder: Path) -> str:
    rows = []
    for part in manifest["parts"]:
        links = " ".join(_link(name, folder) for name in part["files"]) or "&ndash;"
        size = " x ".join(f"{high - low:.1f}" for low, high in zip(*part["bounding_box_mm"], strict=True))
        rows.append(
            f"<tr><td>{escape(part['name'])}</td><td>{ROLES.get(part['role'], part['role'])}</td>"
            f"<td>{escape(part['material'])}</td><td>{part['quantity']}</td><td>{size}</td>"
            f'<td class="n">{part["volume_mm3"]["mesh"] / 1000:.1f}</td><td>{links}</td></tr>'
        )
    head = "".join(f"<th>{name}</th>" for name in ("part", "do", "of", "how many", "size, mm", "ml", "files"))
    kinds = "; ".join(f"{suffix} {words}" for suffix, words in KINDS.items() if suffix in (".stl", ".3mf", ".step"))
    return (
        f"<h2>Parts</h2>\n<p>{escape(kinds)}. interface.step is its flange and the plain envelope of its gyroid.</p>\n"
        f'<div class="scroll"><table><tr>{head}</tr>{"".join(rows)}</table></div>'
    )


def _shared(folder: Path) -> str:
    rows = "".join(
        f"<tr><td>{_link(name, folder, whole=True)}</td><td>{escape(words)}</td></tr>" for name, words in SHARED.items()
    )
    return f'<h2>The other files</h2>\n<div class="scroll"><table>{rows}</table></div>'


def _link(name: str, folder: Path, whole: bool = False) -> str:
    path = folder / name
    words = name if whole else path.suffix[1:].upper()
    size = f" ({_bytes(path.stat().st_size)})" if path.exists() else ""
    return f'<a href="{escape(name)}">{escape(words)}</a>{size}'


def _bytes(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{max(1, round(count / 1e3))} kB"


def _checks(checks: Sequence[Check]) -> str:
    groups: dict[str, list[Check]] = {}
    for check in checks:
        groups.setdefault(check.name.split(".")[0], []).append(check)
    blocks = []
    for name, own in groups.items():
        rows = "".join(
            f'<tr><td>{escape(c.name)}</td><td class="n">{c.value:.6g}</td><td>{escape(c.limit)}</td></tr>' for c in own
        )
        blocks.append(f"<details><summary>{escape(name)}: {len(own)}</summary><table>{rows}</table></details>")
    return (
        f"<h2>Checks</h2>\n<p>All {len(checks)} checks passed, on the files as read back; a folder with a failed "
        f"one is not written.</p>\n{''.join(blocks)}"
    )
