"""The assembly as STEP: all parts with name and colour, in place or exploded (CadQuery, OCCT's XCAF).

Lengths are in mm in the endcap frame. The GLB is made from the meshes (:mod:`fab.exports.glb`).

Notes:
    The file is reproducible byte for byte (:mod:`cad.step_file`); a new version of OCCT may still write other bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cad.errors import FileError, GeometryError
from cad.part import Part
from cad.step_file import canonical_step
from cad.whole_file import drafted

if TYPE_CHECKING:
    import cadquery

Offset = tuple[float, float, float]  # displacement x, y, z in mm


def build_assembly(
    parts: Sequence[Part], offsets: Mapping[str, Offset] | None = None, name: str = "endcap"
) -> cadquery.Assembly:
    """Build an assembly from parts.

    Args:
        parts: parts in the endcap frame; each one's name and colour go into the files.
        offsets: displacement of a part by its name (mm), for an exploded view; parts not named stay in place.
        name: name of the assembly's root.

    Returns:
        A CadQuery assembly of copies: exporting it neither uses nor changes triangles stored in the parts' solids.

    Raises:
        GeometryError: two parts share a name, or an offset names no part.
    """
    import cadquery as cq

    from cad.solids import copied  # loads the CAD kernel

    offsets = offsets or {}
    names = [part.name for part in parts]
    unknown = sorted(set(offsets) - set(names))
    if len(set(names)) < len(names) or unknown:
        raise GeometryError(f"assembly of {names}: names must differ, and offsets for {unknown} move nothing")
    assembly = cq.Assembly(name=name)
    for part in parts:
        shape = cq.Shape.cast(copied(part.solid).wrapped)
        place = cq.Location(offsets.get(part.name, (0.0, 0.0, 0.0)))
        assembly.add(shape, name=part.name, color=cq.Color(*part.color), loc=place)
    return assembly


def exploded_offsets(spans_mm: Mapping[str, tuple[float, float]], gap_mm: float) -> dict[str, Offset]:
    """Displacements along z that separate the parts in an exploded view.

    Args:
        spans_mm: lowest and highest z of each part by its name, mm, in the order from base to dome. (The solid of the
            TPU interface is its flange: give the span of its mesh.)
        gap_mm: least clear height between one part and the next, mm; parts that are further apart stay in place.

    Returns:
        Part name -> displacement (x, y, z), mm.
    """
    offsets: dict[str, Offset] = {}
    top = -math.inf
    for name, (low, high) in spans_mm.items():
        lift = max(0.0, top + gap_mm - low)
        offsets[name] = (0.0, 0.0, lift)
        top = high + lift
    return offsets


def write_step(assembly: cadquery.Assembly, path: Path) -> None:
    """Write an assembly as a STEP file, which appears complete or not at all.

    Raises:
        FileError: the file could not be written.
    """
    try:
        with drafted(path) as draft:
            assembly.export(str(draft), exportType="STEP")
            text = draft.read_text()
            _require_whole(path, text.rstrip().endswith("END-ISO-10303-21;"))
            draft.write_text(canonical_step(text))
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror}): choose a folder with room") from error


def _require_whole(path: Path, whole: bool) -> None:
    """Refuse a truncated file: OCCT's writers do not report a full disk, but a complete file has an end mark."""
    if not whole:
        raise FileError(f"{path.name}: the writer stopped before its end: make room on the disk")
