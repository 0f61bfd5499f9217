"""Small GLB of an endcap and its mold, for pages: coarse meshes, 16-bit positions (KHR_mesh_quantization).

Metres with y up, as glTF requires. The extras of each node contain its group (``endcap`` or ``mold``) and its
displacement in the exploded view, so that one file shows both.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from fab.meshing.mesh import unique_rows

LARGEST_BYTES = 1_400_000  # of the GLB: 1.9 MB as base64 in a page
SHORT = 32767  # largest 16-bit position
METRE = 1e-3  # metres per millimetre
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # endcap's z becomes glTF's y


@dataclass(frozen=True)
class PreviewPart:
    """One part of a preview.

    Attributes:
        name: name of the part.
        group: ``endcap`` or ``mold``.
        mesh: triangles, endcap frame, mm; not necessarily closed.
        color: sRGB in 0..1.
        apart_mm: displacement in the exploded view, endcap frame, mm.
    """

    name: str
    group: str
    mesh: trimesh.Trimesh
    color: tuple[float, float, float]
    apart_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


def clustered(mesh: trimesh.Trimesh, cell_mm: float) -> trimesh.Trimesh:
    """Mesh with one vertex per cell of a grid; sheets thinner than a cell become one layer of triangles.

    Args:
        mesh: any mesh, mm.
        cell_mm: side of a cell, mm.
    """
    cells = np.floor(mesh.vertices / cell_mm).astype(np.int64)
    _, index = unique_rows(cells - cells.min(axis=0))
    count = np.bincount(index).astype(float)
    points = np.column_stack([np.bincount(index, mesh.vertices[:, k]) / count for k in range(3)])
    faces = index[mesh.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    _, first = np.unique(unique_rows(np.sort(faces, axis=1))[1], return_index=True)
    return trimesh.Trimesh(points, faces[np.sort(first)], process=False, validate=False)


def glb(parts: Sequence[PreviewPart]) -> bytes:
    """Parts as one GLB.

    Args:
        parts: the parts; none is empty.
    """
    scene: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "endcap toolkit"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(parts)))}],
        "nodes": [], "meshes": [], "materials": [], "accessors": [], "bufferViews": [],
    }  # fmt: skip
    binary = b"".join(_put_part(scene, number, part) for number, part in enumerate(parts))
    offset = 0
    for view in scene["bufferViews"]:
        view["byteOffset"] = offset
        offset += _padded(view["byteLength"])
    scene["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(scene, separators=(",", ":")).encode()
    text = text.ljust(_padded(len(text)))
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _put_part(scene: dict[str, Any], number: int, part: PreviewPart) -> bytes:
    """Add one part's entries to the scene; returns its vertices and faces as bytes, each padded to four bytes."""
    used, faces = np.unique(part.mesh.faces, return_inverse=True)
    points = METRE * np.asarray(part.mesh.vertices)[used] @ Y_UP.T
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, max(float((high - low).max()) / 2, 1e-9)
    vertices = np.zeros((len(used), 4), dtype=np.int16)  # vertices are aligned to four bytes
    vertices[:, :3] = np.round((points - middle) / half * SHORT)
    kind, index = (5123, np.uint16) if len(used) < 65536 else (5125, np.uint32)
    data = vertices.tobytes(), faces.reshape(-1).astype(index).tobytes()
    scene["bufferViews"] += [
        {"buffer": 0, "byteLength": len(data[0]), "target": 34962, "byteStride": 8},
        {"buffer": 0, "byteLength": len(data[1]), "target": 34963},
    ]
    scene["accessors"] += [
        {
            "bufferView": 2 * number, "componentType": 5122, "normalized": True, "count": len(used), "type": "VEC3",
            "min": vertices[:, :3].min(axis=0).tolist(), "max": vertices[:, :3].max(axis=0).tolist(),
        },
        {"bufferView": 2 * number + 1, "componentType": kind, "count": faces.size, "type": "SCALAR"},
    ]  # fmt: skip
    primitive = {"attributes": {"POSITION": 2 * number}, "indices": 2 * number + 1, "material": number}
    scene["meshes"].append({"name": part.name, "primitives": [primitive]})
    color = [*(round(float(c), 5) for c in linear_color(np.array(part.color))), 1.0]
    surface = {"baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": 0.7}
    scene["materials"].append({"name": part.name, "pbrMetallicRoughness": surface, "doubleSided": True})
    apart = [round(float(v), 6) for v in METRE * np.array(part.apart_mm) @ Y_UP.T]
    scene["nodes"].append({
        "name": part.name, "mesh": number, "translation": middle.tolist(), "scale": [half] * 3,
        "extras": {"group": part.group, "apart": apart},
    })  # fmt: skip
    return b"".join(piece.ljust(_padded(len(piece)), b"\0") for piece in data)


def _padded(length: int) -> int:
    """The next multiple of four."""
    return length + -length % 4


def linear_color(color: np.ndarray) -> np.ndarray:
    """Convert a colour from sRGB (IEC 61966-2-1) to the linear values of glTF, both in 0..1."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
