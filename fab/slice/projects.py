"""Slicer projects of an exported design: every printed part, the interface in both of its forms.

interface_infill    flange and plain zone, which the slicer fills with its own gyroid
interface_gyroid    the mesh with its explicit gyroid, every outline moved out (:mod:`fab.slice.growth`)
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from cad.errors import EndcapError, FileError, ParameterError
from cad.identity import identity, recorded, require_same
from cad.interface import build_flange, build_zone, zone_radii_mm
from cad.params import EndcapParams
from fab.command import exports_words
from fab.exports.whole_folder import file_sha256
from fab.meshing.mesh import read_stl, tessellate
from fab.slice.growth import growth_mm
from fab.slice.nest import Place, Standing, nested
from fab.slice.pose import laid_down, standing
from fab.slice.printers import Printer, require_bed, turned
from fab.slice.project_3mf import Piece, Project, Volume, single
from fab.slice.seams import seam_paint
from fab.slice.settings import part_settings, zone_region
from fab.variant import Variant, variant_of

MANIFEST = "manifest.json"
INTERFACE = "interface"
IN_EVERY_EXPORT = frozenset(("shell", "interface", "base", "ring_spacer", "arm_adapter", "hanger", "core_centre"))
INFILL, GYROID = "interface_infill", "interface_gyroid"


@dataclass(frozen=True)
class Export:
    """A folder that ``make molds`` wrote.

    Attributes:
        folder: of the export.
        variant: design, joint clearance, silicone and robot.
        manifest: its ``manifest.json``.
    """

    folder: Path
    variant: Variant
    manifest: Mapping[str, Any]

    @property
    def params(self) -> EndcapParams:
        """The two numbers."""
        return self.variant.params

    @property
    def words(self) -> str:
        """The options that name it on a command line."""
        return self.variant.words + exports_words(self.folder.parent)

    @property
    def manifest_sha256(self) -> str:
        """SHA-256 of the manifest, recorded by `make slice` so that slices of an earlier export are detected."""
        return file_sha256(self.folder / MANIFEST)

    @property
    def printed(self) -> dict[str, str]:
        """Printed parts and their materials."""
        return {part["name"]: part["material"] for part in self.manifest["parts"] if part["role"] == "printed"}


def read_export(variant: Variant, exports: Path) -> Export:
    """Open the export of a variant in the folder that holds ``variant.label``.

    Raises:
        FileError: the export is missing, unreadable or of other parameters; the message has the command that makes it.
    """
    folder = exports / variant.label
    again = f"run `{variant.command('molds')}{exports_words(exports)}`"
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        found, digest = variant_of(variant.params, manifest), manifest["digest"]
        [part["name"] for part in manifest["parts"]]
        made_of = recorded(manifest.get("identity"), variant.params)
    except OSError as error:
        raise FileError(
            f"{folder}: no export here ({error.strerror}): {again} first{_others(variant, exports)}"
        ) from error
    except (ValueError, KeyError, TypeError, ParameterError) as error:
        raise FileError(f"{folder / MANIFEST}: not a manifest of ours, or an older one: {again} again") from error
    if (found, digest) != (variant, variant.params.digest):
        raise FileError(f"{folder}: made for other parameters than its name says: {again} again")
    require_same(folder, "made", made_of, identity(variant.params), f"{again} again", ("dots", "camera"))
    try:
        _read_all_of(manifest)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(f"{folder / MANIFEST}: lacks what make molds writes ({error}): {again} again") from error
    return Export(folder, variant, manifest)


def _read_all_of(manifest: Mapping[str, Any]) -> None:
    """Read once each entry of a manifest that the commands read later.

    Raises:
        KeyError, TypeError, ValueError, AttributeError: an entry is missing, or has another type.
    """
    parts = {part["name"]: part for part in manifest["parts"]}
    for part in parts.values():
        _ = part["role"], part["material"], float(part["volume_mm3"]["mesh"]), int(part["quantity"])
        _ = part["files"].items()
    for check in manifest["checks"]:
        _ = check["name"], float(check["value"]), check["limit"], check["ok"]
    if lacking := IN_EVERY_EXPORT - set(parts):
        raise ValueError(f"no part {min(lacking)}")


def _others(variant: Variant, exports: Path) -> str:
    """Text with the options of the exported variants of the same D and T; empty for none."""
    found = []
    for path in sorted(exports.glob(f"{variant.params.label}_*/{MANIFEST}")):
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, EndcapError):
            manifest = json.loads(path.read_text(encoding="utf-8"))
            other = variant_of(variant.params, manifest)
            if other.label == path.parent.name:  # not of another camera module
                found.append(other.words)
    return f", or name what has been made: {'; '.join(found)}" if found else ""


def read_part(export: Export, name: str) -> Any:
    """Read the mesh of a part from its STL file, whose SHA-256 is in the manifest.

    Raises:
        FileError: the file is missing, or changed since it was checked.
    """
    file = f"{name}.stl"
    wanted = next(part["files"].get(file) for part in export.manifest["parts"] if part["name"] == name)
    path = export.folder / file
    try:
        found = file_sha256(path)
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}): run make molds again") from error
    if found != wanted:
        raise FileError(
            f"{path}: changed since it was checked (SHA-256 differs from the manifest): run make molds again"
        )
    return read_stl(path)


@dataclass(frozen=True)
class Plate:
    """Parts of one plate.

    Attributes:
        name: of its project.
        places: its parts, by their names in the manifest.
    """

    name: str
    places: tuple[Place, ...]


def project_names(export: Export) -> list[str]:
    """Names of all parts as ``parts=`` takes them, in the order of the manifest, the interface in both of its forms."""
    parts = ([INFILL, GYROID] if part == INTERFACE else [part] for part in export.printed)
    return [name for names in parts for name in names]


def single_plates(names: Sequence[str]) -> list[Plate]:
    """One plate for each of some :func:`project_names`, with the part in its middle."""
    return [Plate(name, (Place(_part_of(name), 0.0, (0.0, 0.0)),)) for name in names]


def nested_plates(export: Export, where: Printer) -> list[Plate]:
    """Plates with as many parts of one material as fit; the interface is alone, as its zone is measured about its axis.

    Args:
        export: what is printed.
        where: the printer.

    Raises:
        FileError: a part's file is missing or changed.
        ParameterError: a part does not fit the bed.
    """
    standing_parts = {name: _standing(export, name) for name in export.printed}
    require_bed({name: part.mesh.vertices for name, part in standing_parts.items()}, where)
    plates = []
    for material in dict.fromkeys(export.printed.values()):
        names = [name for name, own in export.printed.items() if own == material]
        if INTERFACE in names:
            plates += single_plates([INFILL, GYROID])
        found = nested({name: standing_parts[name] for name in names if name != INTERFACE}, where)
        plates += [Plate("", tuple(places)) for places in found]
    return _numbered(plates)


def _numbered(plates: Sequence[Plate]) -> list[Plate]:
    """Plates with names: that of its part, or plate_1, plate_2 and so on."""
    named, count = [], 0
    for plate in plates:
        name = plate.name
        if not name:
            count += len(plate.places) > 1
            name = f"plate_{count}" if len(plate.places) > 1 else plate.places[0].name
        named.append(Plate(name, plate.places))
    return named


def _part_of(name: str) -> str:
    return INTERFACE if name in (INFILL, GYROID) else name


def _standing(export: Export, part: str) -> Standing:
    """A part in its printing pose, with its brim and the places of its seams."""
    mesh, settings = read_part(export, part), part_settings(part, export.printed[part])
    upright = trimesh.Trimesh(standing(part, mesh), mesh.faces, process=False, validate=False)
    return Standing(upright, settings.brim_mm, seam_paint(part, mesh, export.params))


def build_project(export: Export, plate: Plate, where: Printer) -> Project:
    """Build the project of one plate.

    Args:
        export: what is printed.
        plate: its parts and their places.
        where: the printer.

    Raises:
        FileError: a part's file is missing or changed.
        ParameterError: a part does not fit the bed.
    """
    if len(plate.places) == 1:
        return _single_project(export, plate.name, where)
    pieces = []
    for place in plate.places:
        part = _standing(export, place.name)
        points = np.array(part.mesh.vertices)
        points[:, :2] = turned(points[:, :2], place.turn_deg)
        points[:, 2] -= points[:, 2].min()
        mesh = trimesh.Trimesh(points.astype(np.float32), part.mesh.faces, process=False, validate=False)
        settings = part_settings(place.name, export.printed[place.name], where)
        pieces.append(Piece(place.name, settings, (Volume(place.name, mesh, seam=part.seam),), place.place_mm))
    return Project(plate.name, tuple(pieces))


def _single_project(export: Export, name: str, where: Printer) -> Project:
    """One part in the middle of its plate."""
    part = _part_of(name)
    material = export.printed[part]
    if name == INFILL:
        return infill_project(export.params, material, where)
    mesh = read_part(export, part)
    if name == GYROID:
        return gyroid_project(export.params, mesh, material, where)
    volume = Volume(part, laid_down(part, mesh, where), seam=seam_paint(part, mesh, export.params))
    return single(name, part_settings(part, material, where), (volume,))


def infill_project(params: EndcapParams, material: str, where: Printer) -> Project:
    """The interface whose zone the slicer fills.

    Args:
        params: the design.
        material: of the interface.
        where: the printer.

    Raises:
        ParameterError: an unknown material, or it does not fit the bed.
    """
    return single(INFILL, part_settings(INTERFACE, material, where), zone_volumes(params, where))


def gyroid_project(params: EndcapParams, mesh: trimesh.Trimesh, material: str, where: Printer) -> Project:
    """The interface as its mesh, with outlines moved outward by the volume that its lines would lack.

    Args:
        params: the design.
        mesh: the interface with its gyroid, endcap frame, mm.
        material: of the interface.
        where: the printer.

    Raises:
        ParameterError: an unknown material, or it does not fit the bed.
    """
    inner, outer = zone_radii_mm(params)
    grow = round(growth_mm(outer - inner, params.gyroid), 4)
    settings = replace(part_settings(INTERFACE, material, where), grow_mm=grow)
    return single(GYROID, settings, (Volume(INTERFACE, laid_down(INTERFACE, mesh, where)),))


def zone_volumes(params: EndcapParams, where: Printer | None = None) -> tuple[Volume, Volume]:
    """Flange and plain zone, each a closed mesh in printing pose; ``where`` is by default any with a 256 mm bed."""
    inner, outer = zone_radii_mm(params)
    flange = laid_down(INTERFACE, tessellate(build_flange(params)), where)
    return Volume("flange", flange), Volume(
        "zone", tessellate(build_zone(params)), zone_region(outer - inner, params.gyroid)
    )
