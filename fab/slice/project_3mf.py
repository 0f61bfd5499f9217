"""Slicer projects: 3MF files with meshes in printing pose and the settings of part and volumes.

Two dialects: :func:`write_prusa` for PrusaSlicer, :func:`write_orca` for OrcaSlicer and Bambu Studio. Millimetres;
every part stands on the bed, its lowest point at z = 0.

Notes:
    trimesh and lib3mf write valid 3MF, but not the metadata of a project: PrusaSlicer ignores all settings unless the
    model has the metadata ``slic3rpe:Version3mf`` with exactly that prefix (lib3mf renames prefixes), and volumes of a
    PrusaSlicer object are ranges of triangles. Therefore the XML is written here; the tests read it with lib3mf. Bambu
    Studio reads settings only from a file whose ``Application`` names it.
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
from fab.slice.printers import Printer
from fab.slice.region import Region
from fab.slice.seams import FREE
from fab.slice.settings import PrintSettings

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
    """One closed mesh of a project in printing pose, with its infill if that differs from the part's.

    Attributes:
        name: shown in the slicer's list.
        mesh: closed mesh, x and y about the bed's middle, z from the bed (mm).
        region: its own filling, or ``None`` for the part's.
        seam: (n,) code of each triangle, where walls may begin and end (:mod:`fab.slice.seams`); ``None``: anywhere.
    """

    name: str
    mesh: trimesh.Trimesh
    region: Region | None = None
    seam: np.ndarray | None = None

    @property
    def paint(self) -> np.ndarray:
        """(n,) code of each triangle."""
        return np.full(len(self.mesh.faces), FREE) if self.seam is None else self.seam


@dataclass(frozen=True)
class Piece:
    """One part on a plate.

    Attributes:
        name: of the part.
        settings: of the part.
        volumes: its meshes.
        place_mm: of its origin, from the middle of the bed.
    """

    name: str
    settings: PrintSettings
    volumes: tuple[Volume, ...]
    place_mm: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Project:
    """One plate, ready for a slicer: pieces of one filament for one printer.

    Attributes:
        name: of its files.
        pieces: its parts; settings of the plate are those of the first.
    """

    name: str
    pieces: tuple[Piece, ...]

    @property
    def settings(self) -> PrintSettings:
        """Settings of the plate; those that may differ are set for each piece."""
        return self.pieces[0].settings

    @property
    def volumes(self) -> tuple[Volume, ...]:
        """Meshes of all pieces."""
        return tuple(volume for piece in self.pieces for volume in piece.volumes)

    @property
    def printer(self) -> Printer:
        """Printer of the project."""
        return self.settings.printer


def single(name: str, settings: PrintSettings, volumes: tuple[Volume, ...]) -> Project:
    """A plate with one part in its middle.

    Args:
        name: of plate and part.
        settings: of the part.
        volumes: its meshes.
    """
    return Project(name, (Piece(name, settings, volumes),))


def write_both(project: Project, folder: Path) -> tuple[Path, Path]:
    """Write a project in both dialects; return the paths, PrusaSlicer's first.

    Args:
        project: one plate.
        folder: receives ``<name>.prusa.3mf`` and ``<name>.orca.3mf``.

    Raises:
        FileError: a file could not be written.
    """
    prusa, orca = folder / f"{project.name}.prusa.3mf", folder / f"{project.name}.orca.3mf"
    write_prusa(project, prusa)
    write_orca(project, orca)
    return prusa, orca


def write_prusa(project: Project, path: Path) -> None:
    """Write a project for PrusaSlicer 2.5 and later.

    Args:
        project: one plate.
        path: of the 3MF file.

    Raises:
        FileError: the file could not be written; nothing is left.
    """
    resources, items, objects = [], [], ["<config>"]
    for number, piece in enumerate(project.pieces, 1):
        paint = np.concatenate([volume.paint for volume in piece.volumes])
        whole = joined([volume.mesh for volume in piece.volumes])
        resources += _object(number, piece.name, whole, paint, "slic3rpe:custom_seam")
        items.append(f'<item objectid="{number}" transform="{_placed(project, piece)}"/>')
        objects += _prusa_object(number, piece)
    model = [
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}" xmlns:slic3rpe="{_PRUSA}">',
        ' <metadata name="slic3rpe:Version3mf">1</metadata>',
        ' <metadata name="slic3rpe:SeamPaintingVersion">1</metadata>',
        f' <metadata name="Title">{project.name}</metadata>',
        " <resources>",
        *resources,
        " </resources>",
        f" <build>{''.join(items)}</build>",
        "</model>",
    ]
    settings = "".join(f"; {key} = {value}\n" for key, value in sorted(project.settings.prusa().items()))
    members = {
        "3D/3dmodel.model": _xml(model),
        "Metadata/Slic3r_PE.config": settings,
        "Metadata/Slic3r_PE_model.config": _xml([*objects, "</config>"]),
    }
    _write(path, members)


def _prusa_object(number: int, piece: Piece) -> list[str]:
    """Settings of a piece and of its volumes, which are ranges of its triangles."""
    lines = [f' <object id="{number}" instances_count="1">', _prusa_item("object", "name", piece.name)]
    lines += [_prusa_item("object", key, value) for key, value in piece.settings.piece_prusa().items()]
    first = 0
    for volume in piece.volumes:
        last = first + len(volume.mesh.faces) - 1
        lines.append(f'  <volume firstid="{first}" lastid="{last}">')
        lines.append(_prusa_item("volume", "name", volume.name))
        lines.append(_prusa_item("volume", "volume_type", "ModelPart"))
        region = volume.region.prusa() if volume.region else {}
        lines += [_prusa_item("volume", key, value) for key, value in region.items()]
        lines.append("  </volume>")
        first = last + 1
    return [*lines, " </object>"]


def write_orca(project: Project, path: Path) -> None:
    """Write a project for OrcaSlicer and Bambu Studio.

    Args:
        project: one plate.
        path: of the 3MF file.

    Raises:
        FileError: the file could not be written; nothing is left.
    """
    resources, items, objects, instances = [], [], ["<config>"], []
    number = 0
    for piece in project.pieces:
        parts = range(number + 1, number + 1 + len(piece.volumes))
        whole = number = parts.stop
        for part, volume in zip(parts, piece.volumes, strict=True):
            resources += _object(part, volume.name, volume.mesh, volume.paint, "paint_seam")
        components = "".join(f'<component objectid="{part}"/>' for part in parts)
        resources.append(f'  <object id="{whole}" type="model"><components>{components}</components></object>')
        items.append(f'<item objectid="{whole}" transform="{_placed(project, piece)}"/>')
        objects += _orca_object(whole, parts, piece)
        instance = _orca_items({"object_id": str(whole), "instance_id": "0"})
        instances += ["  <model_instance>", *instance, "  </model_instance>"]
    model = [
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{_CORE}" xmlns:BambuStudio="{_BAMBU}">',
        f' <metadata name="Application">BambuStudio-{_BAMBU_VERSION}</metadata>',
        ' <metadata name="BambuStudio:3mfVersion">1</metadata>',
        f' <metadata name="Title">{project.name}</metadata>',
        " <resources>",
        *resources,
        " </resources>",
        f" <build>{''.join(items)}</build>",
        "</model>",
    ]
    plate = [" <plate>", *_orca_items({"plater_id": "1", "plater_name": project.name}), *instances, " </plate>"]
    header = {"from": "project", "name": "project_settings", "version": _BAMBU_VERSION}
    members = {
        "3D/3dmodel.model": _xml(model),
        "Metadata/model_settings.config": _xml([*objects, *plate, "</config>"]),
        "Metadata/project_settings.config": json.dumps({**header, **project.settings.orca()}, indent=1, sort_keys=True),
    }
    _write(path, members)


def _orca_object(whole: int, parts: range, piece: Piece) -> list[str]:
    """Settings of a piece, whose number is ``whole``, and of its volumes, numbered ``parts``."""
    items = {"name": piece.name, "extruder": "1", **piece.settings.piece_orca()}
    lines = [f' <object id="{whole}">', *_orca_items(items)]
    for part, volume in zip(parts, piece.volumes, strict=True):
        lines.append(f'  <part id="{part}" subtype="normal_part">')
        region = volume.region.orca() if volume.region else {}
        lines += _orca_items({"name": volume.name, "matrix": "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", **region})
        lines.append("  </part>")
    return [*lines, " </object>"]


def _object(number: int, name: str, mesh: trimesh.Trimesh, paint: np.ndarray, attribute: str) -> list[str]:
    """The mesh as 3MF; nine figures, as many as float32 needs. Painted triangles have their code as an attribute."""
    points = np.asarray(mesh.vertices, dtype=np.float32)
    words = {int(code): f' {attribute}="{code}"' if code != FREE else "" for code in np.unique(paint)}
    return [
        f'  <object id="{number}" type="model" name={quoteattr(name)}><mesh><vertices>',
        *(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in points.tolist()),
        "</vertices><triangles>",
        *(
            f'<triangle v1="{a}" v2="{b}" v3="{c}"{words[code]}/>'
            for (a, b, c), code in zip(np.asarray(mesh.faces).tolist(), paint.tolist(), strict=True)
        ),
        "</triangles></mesh></object>",
    ]


def _placed(project: Project, piece: Piece) -> str:
    x, y = (middle + shift for middle, shift in zip(project.printer.middle_mm, piece.place_mm, strict=True))
    return f"1 0 0 0 1 0 0 0 1 {x:.9g} {y:.9g} 0"


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
