"""Writer of an export folder's files: meshes, solids, assemblies, pictures, manifest.

Runs with equal parameters give equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cad
from cad.assembly import build_assembly, exploded_offsets, write_step
from cad.errors import FileError
from cad.extras import DISTRIBUTION
from cad.identity import identity
from cad.interface import build_zone
from cad.part import Part
from cad.step_file import canonical_step
from fab.checks.check import Check
from fab.design import PRODUCT, Design
from fab.exports.glb import write_glb
from fab.exports.whole_folder import file_sha256
from fab.meshing.mesh import volume_mm3, write_stl
from fab.pictures.parts import PictureItem, render_exploded, render_parts, render_section

if TYPE_CHECKING:
    from build123d import Shape

MANIFEST = "manifest.json"
DIGITS = 9  # significant figures in the manifest
EXPLODED_GAP_MM = 28.0  # between parts in the exploded view: room for the labels


def write_meshes(design: Design, folder: Path) -> None:
    """Write ``<part>.stl`` for every printed or cast part."""
    for name, part in design.parts.items():
        if part.role != "bought":
            write_stl(folder / f"{name}.stl", design.meshes[name])


def write_solids(design: Design, folder: Path) -> None:
    """Write ``<part>.step`` for every printed or cast part; the interface's contains flange and gyroid envelope."""
    from build123d import Compound

    for name, part in design.parts.items():
        if part.role == "bought":
            continue
        shape = Compound([part.solid, build_zone(design.params)]) if name == "interface" else part.solid
        write_shape(shape, folder / f"{name}.step")


def write_shape(shape: Shape, path: Path) -> None:
    """Write one shape as STEP; its product has the name of the file, which CAD programs show.

    Args:
        shape: solid or compound, mm.
        path: file to write, ``<part>.step``.

    Raises:
        FileError: the kernel could not write the file.
    """
    from build123d import export_step

    named = copy(shape)  # shares the geometry; the design's own solid stays without a label
    named.label = path.stem
    try:
        export_step(named, path)
    except RuntimeError as error:  # the kernel reports only that it failed, mostly on a full disk
        raise FileError(
            f"{path.name}: cannot be written ({error}): free some space or name another folder with exports=DIR"
        ) from error
    path.write_text(canonical_step(path.read_text()))


def write_assemblies(design: Design, folder: Path) -> None:
    """Write the endcap assembled and exploded, and the closed mold, each as STEP and GLB.

    The GLB contains the interface's gyroid; the STEP contains its flange and the gyroid's envelope.
    """
    mold = (*design.mold, "interface")
    for stem, names, offsets in (
        ("assembly", PRODUCT, {}),
        ("exploded", PRODUCT, exploded_offsets_mm(design)),
        ("mold", mold, {}),
    ):
        parts = [_with_envelope(design, name) for name in names]
        write_step(build_assembly(parts, offsets, stem), folder / f"{stem}.step")
        write_glb(design, names, offsets, folder / f"{stem}.glb")


def _with_envelope(design: Design, name: str) -> Part:
    """A part for a STEP assembly: the interface with the gyroid's envelope, the others unchanged."""
    from build123d import Compound

    part = design.parts[name]
    return replace(part, solid=Compound([part.solid, build_zone(design.params)])) if name == "interface" else part


def exploded_offsets_mm(design: Design) -> dict[str, tuple[float, float, float]]:
    """Displacements (x, y, z) of the endcap's parts in the exploded view, by name, mm."""
    order = ("arm_adapter", "base", "camera", "ring_spacer", "led_ring", "interface", "shell")
    spans = {name: (design.meshes[name].bounds[0][2], design.meshes[name].bounds[1][2]) for name in order}
    return exploded_offsets(spans, EXPLODED_GAP_MM)


def picture_items(design: Design) -> tuple[list[PictureItem], list[PictureItem]]:
    """Items of the pictures: the endcap's parts from the tip down with their displacements, and all parts."""
    offsets = exploded_offsets_mm(design)
    product = [_item(design, name, offsets[name]) for name in sorted(PRODUCT, key=lambda n: -offsets[n][2])]
    return product, [_item(design, name) for name in design.parts]


def write_pictures(product: Sequence[PictureItem], parts: Sequence[PictureItem], folder: Path) -> None:
    """Write ``exploded.png``, ``section.png`` and ``parts.png``.

    Args:
        product: items of the exploded view and the section.
        parts: items of the sheet of parts.
        folder: folder of the files.
    """
    render_exploded(product, folder / "exploded.png")
    render_section(product, folder / "section.png")
    render_parts(parts, folder / "parts.png")


def manifest(design: Design, checks: Sequence[Check], folder: Path) -> dict[str, Any]:
    """Content of ``manifest.json``: data of design, parts, checks and files, in a fixed order.

    Args:
        design: design with parts, meshes and sizes.
        checks: all checks.
        folder: folder of the files, which are already written.
    """
    values = {check.name: check.value for check in checks}
    parts = []
    for name, part in design.parts.items():
        mesh = design.meshes[name]
        files = sorted(path for path in folder.iterdir() if path.stem == name)
        parts.append(
            {
                "name": name,
                "role": part.role,
                "material": part.material,
                "quantity": part.quantity,
                "volume_mm3": {"solid": _figures(design.solid_mm3[name]), "mesh": _figures(volume_mm3(mesh))},
                "bounding_box_mm": [[_figures(v) for v in corner] for corner in mesh.bounds],
                "triangles": len(mesh.faces),
                "watertight": bool(
                    values[checked] if (checked := f"{name}.watertight") in values else mesh.is_watertight
                ),
                "self_intersections": int(values.get(f"{name}.self_intersections", 0)),
                "files": {path.name: file_sha256(path) for path in files},
            }
        )
    return {
        "toolkit": f"{DISTRIBUTION} {cad.__version__}",
        "parameters": design.params.record,
        "joint_clearance_mm": design.layout.joint_clearance_mm,
        "silicone": design.layout.silicone,
        "robot": design.robot,
        "digest": design.params.digest,
        "identity": identity(design.params, design.layout.silicone).record(),
        "gyroid": {"period_mm": _figures(design.gyroid.period_mm), "density": _figures(design.gyroid.density)},
        "parts": parts,
        "checks": [check.record(DIGITS) for check in checks],
    }


def write_manifest(content: dict[str, Any], folder: Path) -> None:
    """Write ``manifest.json``: the content, followed by the digests of all files that do not belong to a part."""
    listed = {name for part in content.get("parts", []) for name in part["files"]}
    shared = sorted(path for path in folder.iterdir() if path.name not in listed)
    whole = {**content, "files": {path.name: file_sha256(path) for path in shared}}
    (folder / MANIFEST).write_text(json.dumps(whole, indent=1) + "\n")


def _item(design: Design, name: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> PictureItem:
    part = design.parts[name]
    outside = design.plain_shell if name == "shell" else None
    return PictureItem(name, design.meshes[name], part.color, part.role, offset, outside)


def _figures(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
