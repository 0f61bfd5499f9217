"""Writer of one part as 3MF, with the elements of the format's core specification only.

Units are millimetres. Source: 3MF Core Specification 1.3, sections 2 (package) and 4 (objects).

Notes:
    trimesh (4 and 5) declares extensions that it does not use and gives random identifiers of one of them, which the
    3MF consortium's own reader refuses in strict mode. Taking them out again took twice as long as to write the file.
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import numpy as np
import trimesh

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MODEL = "3D/3dmodel.model"
_DECLARATION = "<?xml version='1.0' encoding='utf-8'?>\n"
_RELATION = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" '
    f'Target="/{MODEL}" Id="rel0"/></Relationships>'
)
_TYPES = {  # file extension -> type of its content
    "jpeg": "image/jpeg",
    "jpg": "image/jpeg",
    "model": "application/vnd.ms-package.3dmanufacturing-3dmodel+xml",
    "png": "image/png",
    "rels": "application/vnd.openxmlformats-package.relationships+xml",
    "texture": "application/vnd.ms-package.3dmanufacturing-3dmodeltexture",
}
_IN_PLACE = "1.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0"  # 4 x 3 matrix, row by row
_LEVEL = 1  # of the compression: takes a third of the time of level 6


def write_3mf(mesh: trimesh.Trimesh, name: str, path: Path) -> None:
    """Write one part as 3MF; equal meshes give equal bytes.

    Args:
        mesh: mesh of the part, mm.
        name: name of the part.
        path: the file.

    Raises:
        OSError: the file cannot be written.
    """
    types = "".join(f'<Default Extension="{end}" ContentType="{kind}"/>' for end, kind in _TYPES.items())
    members = {
        MODEL: _model(mesh, name),
        "_rels/.rels": _RELATION,
        "[Content_Types].xml": f'<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">{types}</Types>',
    }
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for member, text in members.items():
            info = ZipInfo(member)  # with the format's own date, not the current one
            info.compress_type = ZIP_DEFLATED
            archive.writestr(info, f"{_DECLARATION}{text}".encode(), compresslevel=_LEVEL)


def _model(mesh: trimesh.Trimesh, name: str) -> str:
    """The model's XML: one object, in place."""
    points, corners = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    vertices = '<vertex x="%r" y="%r" z="%r" />' * len(points) % tuple(points.ravel().tolist())
    triangles = '<triangle v1="%d" v2="%d" v3="%d" />' * len(corners) % tuple(corners.ravel().tolist())
    title = quoteattr(name)
    return (
        f'<model xmlns="{CORE}" unit="millimeter"><resources><object id="1" name={title} type="model">'
        f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh></object></resources>"
        f'<build><item objectid="1" transform="{_IN_PLACE}" partnumber={title}/></build></model>'
    )
