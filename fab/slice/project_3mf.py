"""Slicer projects: 3MF files with meshes in printing pose and the settings of part and volumes.

Two dialects: :func:`write_prusa` for PrusaSlicer, :func:`write_orca` for OrcaSlicer and Bambu Studio. Millimetres; the
part stands in the middle of a square bed, its lowest point at z = 0.

Notes:
    trimesh and lib3mf write sound 3MF, but neither can write what makes it a project: PrusaSlicer ignores all settings
    unless the model carries the metadata ``slic3rpe:Version3mf`` under that very prefix (lib3mf renames prefixes), and
    volumes of a PrusaSlicer object are ranges of triangles. So the few lines of XML are written here; the tests read
    them back with lib3mf. Bambu Studio reads settings only from a file whose ``Application`` names it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from xml.sax.saxutils import quoteattr
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import trimesh

from cad.whole_file import replace_file
from fab.meshing.mesh import joined
from fab.slice.settings import BED_MM, PrintSettings, Region

_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PRUSA = "http://schemas.slic3r.org/3mf/2017/06"
_BAMBU = "http://schemas.bambulab.com/package/2021"
_BAMBU_VERSION = "01.10.00.00"  # of the project format; any later one reads it
_CONTENT_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">\n'
    ' <Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>\n'
    ' <Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>\n'
    ' <Default Extension="config" ContentType="text/plain"/>\n'
    "</Types>\n"
)
_RELATIONSHIPS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">\n'
    ' <Relationship Target="/3D/3dmodel.model" Id="rel-1"'
    ' Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>\n'
    "</Relationships>\n"
)


@dataclass(frozen=True)
class Volume:
    """One closed mesh of a project, in printing pose about the bed's middle, and how it is filled if not as the part.

    Attributes:
        name: shown in the slicer's list.
        mesh: closed mesh, x and y about the bed's middle, z from the bed (mm).
        region: its own filling, or ``None`` for the part's.
    """

    name: str
    mesh: trimesh.Trimesh
    region: Region | None = None


@dataclass(frozen=True)
class Project:
    """One printed part, ready for a slicer."""

    name: str
    settings: PrintSettings
    volumes: tuple[Volume, ...]


def write_prusa(project: Project, path: Path) -> None:
    """Write a project for PrusaSlicer 2.5 and later.

    Raises:
        FileError: it could not be written; nothing is left.
    """
    mesh = joined([volume.mesh for volume in project.volumes])
    model = [
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}" xmlns:slic3rpe="{_PRUSA}">',
        ' <metadata name="slic3rpe:Version3mf">1</metadata>',
        f' <metadata name="Title">{project.name}</metadata>',
        " <resources>",
        *_object(1, project.name, mesh),
        " </resources>",
        f' <build><item objectid="1" transform="{_placed()}"/></build>',
        "</model>",
    ]
    objects = ["<config>", ' <object id="1" instances_count="1">', _prusa_item("object", "name", project.name)]
    first = 0
    for volume in project.volumes:
        last = first + len(volume.mesh.faces) - 1
        objects.append(f'  <volume firstid="{first}" lastid="{last}">')
        objects.append(_prusa_item("volume", "name", volume.name))
        objects.append(_prusa_item("volume", "volume_type", "ModelPart"))
        region = volume.region.prusa() if volume.region else {}
        objects += [_prusa_item("volume", key, value) for key, value in region.items()]
        objects.append("  </volume>")
        first = last + 1
    objects += [" </object>", "</config>"]
    settings = "".join(f"; {key} = {value}\n" for key, value in sorted(project.settings.prusa().items()))
    members = {
        "3D/3dmodel.model": _xml(model),
        "Metadata/Slic3r_PE.config": settings,
        "Metadata/Slic3r_PE_model.config": _xml(objects),
    }
    _write(path, members)


def write_orca(project: Project, path: Path) -> None:
    """Write a project for OrcaSlicer and Bambu Studio.

    Raises:
        FileError: it could not be written; nothing is left.
    """
    whole = len(project.volumes) + 1
    model = [
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}" xmlns:BambuStudio="{_BAMBU}">',
        f' <metadata name="Application">BambuStudio-{_BAMBU_VERSION}</metadata>',
        ' <metadata name="BambuStudio:3mfVersion">1</metadata>',
        f' <metadata name="Title">{project.name}</metadata>',
        " <resources>",
    ]
    for number, volume in enumerate(project.volumes, 1):
        model += _object(number, volume.name, volume.mesh)
    model += [
        f'  <object id="{whole}" type="model"><components>',
        *(f'   <component objectid="{number}"/>' for number in range(1, whole)),
        "  </components></object>",
        " </resources>",
        f' <build><item objectid="{whole}" transform="{_placed()}"/></build>',
        "</model>",
    ]
    objects = ["<config>", f' <object id="{whole}">', *_orca_items({"name": project.name, "extruder": "1"})]
    for number, volume in enumerate(project.volumes, 1):
        objects.append(f'  <part id="{number}" subtype="normal_part">')
        region = volume.region.orca() if volume.region else {}
        objects += _orca_items({"name": volume.name, "matrix": "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", **region})
        objects.append("  </part>")
    objects += [" </object>", " <plate>", *_orca_items({"plater_id": "1", "plater_name": project.name})]
    instance = _orca_items({"object_id": str(whole), "instance_id": "0"})
    objects += ["  <model_instance>", *instance, "  </model_instance>", " </plate>", "</config>"]
    header = {"from": "project", "name": "project_settings", "version": _BAMBU_VERSION}
    members = {
        "3D/3dmodel.model": _xml(model),
        "Metadata/model_settings.config": _xml(objects),
        "Metadata/project_settings.config": json.dumps({**header, **project.settings.orca()}, indent=1, sort_keys=True),
    }
    _write(path, members)


def _object(number: int, name: str, mesh: trimesh.Trimesh) -> list[str]:
    """The mesh as 3MF; nine figures, as many as float32 needs."""
    points = np.asarray(mesh.vertices, dtype=np.float32)
    return [
        f'  <object id="{number}" type="model" name={quoteattr(name)}><mesh><vertices>',
        *(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in points.tolist()),
        "</vertices><triangles>",
        *(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in np.asarray(mesh.faces).tolist()),
        "</triangles></mesh></object>",
    ]


def _placed() -> str:
    return f"1 0 0 0 1 0 0 0 1 {BED_MM / 2:g} {BED_MM / 2:g} 0"


def _prusa_item(kind: str, key: str, value: str) -> str:
    return f'   <metadata type="{kind}" key="{key}" value={quoteattr(value)}/>'


def _orca_items(items: Mapping[str, str]) -> list[str]:
    return [f'   <metadata key="{key}" value={quoteattr(value)}/>' for key, value in items.items()]


def _xml(lines: Sequence[str]) -> str:
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "\n".join(lines) + "\n"


def _write(path: Path, members: Mapping[str, str]) -> None:
    """Write the package under a temporary name, then rename; equal content gives equal bytes."""
    package = BytesIO()
    with ZipFile(package, "w", ZIP_DEFLATED) as archive:
        for name, text in {"[Content_Types].xml": _CONTENT_TYPES, "_rels/.rels": _RELATIONSHIPS, **members}.items():
            info = ZipInfo(name)
            info.compress_type = ZIP_DEFLATED
            archive.writestr(info, text)
    replace_file(path, package.getvalue(), "choose a folder with room")
