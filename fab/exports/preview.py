"""A small GLB of an endcap and its mold, for pages: coarse meshes, positions as 16-bit numbers (KHR_mesh_quantization).

Metres with y up, as glTF asks. Each node carries in its extras the group it belongs to (``endcap`` or ``mold``) and its
displacement when the parts are pulled apart, so that one file shows both.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

LARGEST_BYTES = 1_400_000  # of the GLB: 1.9 MB as base64 in a page
SHORT = 32767
METRE = 1e-3
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # endcap's z becomes glTF's y


@dataclass(frozen=True)
class PreviewPart:
    """One part of a preview.

    Attributes:
        name: of the part.
        group: ``endcap`` or ``mold``.
        mesh: triangles, endcap frame, mm; need not be closed.
        color: as shown on a screen (sRGB).
        apart_mm: displacement when pulled apart.
    """

    name: str
    group: str
    mesh: trimesh.Trimesh
    color: tuple[float, float, float]
    apart_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


def clustered(mesh: trimesh.Trimesh, cell_mm: float) -> trimesh.Trimesh:
    """A mesh with one vertex a cell of a grid: sheets thinner than a cell become one layer of triangles.

    Args:
        mesh: any mesh, mm.
        cell_mm: side of a cell.
    """
    cells = np.floor(mesh.vertices / cell_mm).astype(np.int64)
    _, index = np.unique(cells, axis=0, return_inverse=True)
    index = index.reshape(-1)
    count = np.bincount(index).astype(float)
    points = np.column_stack([np.bincount(index, mesh.vertices[:, k]) / count for k in range(3)])
    faces = index[mesh.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return trimesh.Trimesh(points, faces[np.sort(first)], process=False, validate=False)


def glb(parts: Sequence[PreviewPart]) -> bytes:
    """Parts as one GLB.

    Args:
        parts: none of them empty.
    """
    binary, views, accessors, meshes, materials, nodes = b"", [], [], [], [], []
    for number, part in enumerate(parts):
        used, faces = np.unique(part.mesh.faces, return_inverse=True)
        points = METRE * np.asarray(part.mesh.vertices)[used] @ Y_UP.T
        low, high = points.min(axis=0), points.max(axis=0)
        middle, half = (low + high) / 2, max(float((high - low).max()) / 2, 1e-9)
        shorts = np.round((points - middle) / half * SHORT).astype(np.int16)
        padded = np.zeros((len(shorts), 4), dtype=np.int16)  # a vertex begins on four bytes
        padded[:, :3] = shorts
        kind, wide = (5123, np.uint16) if len(used) < 65536 else (5125, np.uint32)
        for data, target, stride in (
            (padded.tobytes(), 34962, 8),
            (faces.reshape(-1).astype(wide).tobytes(), 34963, 0),
        ):
            view = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(data), "target": target}
            views.append(view | ({"byteStride": stride} if stride else {}))
            binary += data + b"\0" * (-len(data) % 4)
        limits = {"min": shorts.min(axis=0).tolist(), "max": shorts.max(axis=0).tolist()}
        accessors.append(
            {"bufferView": 2 * number, "componentType": 5122, "normalized": True, "count": len(shorts), "type": "VEC3"}
            | limits
        )
        accessors.append({"bufferView": 2 * number + 1, "componentType": kind, "count": faces.size, "type": "SCALAR"})
        primitive = {"attributes": {"POSITION": 2 * number}, "indices": 2 * number + 1, "material": number}
        meshes.append({"name": part.name, "primitives": [primitive]})
        color = [*(round(float(c), 5) for c in linear_color(np.array(part.color))), 1.0]
        surface = {"baseColorFactor": color, "metallicFactor": 0.0, "roughnessFactor": 0.7}
        materials.append({"name": part.name, "pbrMetallicRoughness": surface, "doubleSided": True})
        apart = [round(float(v), 6) for v in METRE * np.array(part.apart_mm) @ Y_UP.T]
        nodes.append(
            {
                "name": part.name,
                "mesh": number,
                "translation": [float(v) for v in middle],
                "scale": [half] * 3,
                "extras": {"group": part.group, "apart": apart},
            }
        )
    scene = {
        "asset": {"version": "2.0", "generator": "endcap toolkit"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def linear_color(color: np.ndarray) -> np.ndarray:
    """A colour as shown on a screen (sRGB, IEC 61966-2-1) to the linear one that glTF holds."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
