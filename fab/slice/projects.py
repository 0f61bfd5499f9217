"""Slicer projects of an exported design: every printed part, the interface in both of its forms.

interface_infill    flange and plain zone, which the slicer fills with its own gyroid
interface_gyroid    the mesh with its explicit gyroid, every outline moved out by half of what round lines take off
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cad.errors import FileError
from cad.identity import identity, recorded, require_same
from cad.params import EndcapParams
from fab.exports.whole_folder import file_sha256
from fab.meshing.mesh import read_stl, tessellate
from fab.slice.pose import laid_down
from fab.slice.project_3mf import Project, Volume
from fab.slice.settings import ROUNDING_MM, part_settings, zone_region
from fab.variant import Variant

MANIFEST = "manifest.json"
INTERFACE = "interface"
INFILL, GYROID = "interface_infill", "interface_gyroid"


@dataclass(frozen=True)
class Export:
    """A folder that ``make molds`` wrote.

    Attributes:
        folder: where it lies.
        variant: the two numbers, the joint clearance and the silicone.
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
    def manifest_sha256(self) -> str:
        """What `make slice` notes, so that prints of an earlier export are known as such."""
        return file_sha256(self.folder / MANIFEST)

    @property
    def printed(self) -> dict[str, str]:
        """Printed parts and their materials."""
        return {part["name"]: part["material"] for part in self.manifest["parts"] if part["role"] == "printed"}


def read_export(variant: Variant, exports: Path) -> Export:
    """Open the folder of a variant.

    Raises:
        FileError: it is missing, unreadable or of other parameters; the message has the command that makes it.
    """
    folder = exports / variant.label
    again = f"run `make molds {variant.words}`"
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        found = manifest["digest"], manifest["joint_clearance_mm"], manifest["silicone"]
        [part["name"] for part in manifest["parts"]]
        made_of = recorded(manifest.get("identity"), variant.params)
    except OSError as error:
        raise FileError(f"{folder}: no export here ({error.strerror}): {again} first") from error
    except (ValueError, KeyError, TypeError) as error:
        raise FileError(f"{folder / MANIFEST}: not a manifest of ours, or an older one: {again} again") from error
    if found != (variant.params.digest, variant.layout.joint_clearance_mm, variant.silicone):
        raise FileError(f"{folder}: made for other parameters than its name says: {again} again")
    require_same(folder, "made", made_of, identity(variant.params), f"{again} again", ("dots", "camera"))
    return Export(folder, variant, manifest)


def read_part(export: Export, name: str) -> Any:
    """Mesh of a part, from the STL that the manifest vouches for.

    Raises:
        FileError: the file is missing or not the one that was checked.
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


def project_names(export: Export) -> list[str]:
    """Names of all projects, in the manifest's order."""
    names = []
    for part in export.printed:
        names += [INFILL, GYROID] if part == INTERFACE else [part]
    return names


def build_project(export: Export, name: str) -> Project:
    """Build one project by its name.

    Raises:
        FileError: the part's file is missing or changed.
        GeometryError: the part does not fit the bed.
    """
    part = INTERFACE if name in (INFILL, GYROID) else name
    settings = part_settings(part, export.printed[part])
    if name == INFILL:
        return Project(name, settings, zone_volumes(export.params))
    mesh = laid_down(part, read_part(export, part))
    if name == GYROID:
        settings = replace(settings, grow_mm=round(ROUNDING_MM / 2, 4))
    return Project(name, settings, (Volume(part, mesh),))


def zone_volumes(params: EndcapParams) -> tuple[Volume, Volume]:
    """Flange and plain zone, each a closed mesh."""
    from cad.interface import build_flange, build_zone, zone_radii_mm

    inner, outer = zone_radii_mm(params)
    flange = laid_down(INTERFACE, tessellate(build_flange(params)))
    return Volume("flange", flange), Volume("zone", tessellate(build_zone(params)), zone_region(outer - inner))
