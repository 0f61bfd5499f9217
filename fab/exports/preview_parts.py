"""Parts in the preview of an export: coarse meshes with their displacements in the exploded view."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import trimesh

from fab.design import PRODUCT, Design
from fab.exports.preview import LARGEST_BYTES, PreviewPart, clustered, glb
from fab.meshing.mesh import from_manifold, joined, tessellate, to_manifold

TOLERANCES_MM = (0.1, 0.2, 0.4, 0.8)  # of the parts' surfaces, tried until the file is small enough
CELL_MM = 2.0  # side of a cell for the gyroid, whose sheet becomes one layer
SHELL_TOLERANCE_MM = 0.15  # of the shell's surfaces

Offsets = Mapping[str, tuple[float, float, float]]  # part -> displacement in mm


def preview_glb(design: Design, offsets: Offsets) -> bytes:
    """Preview of a design as GLB, at most ``LARGEST_BYTES`` long if a tolerance in :data:`TOLERANCES_MM` suffices.

    Args:
        design: design with solids and meshes.
        offsets: displacements (x, y, z) of the endcap's parts in the exploded view, by name, mm.
    """
    shell = tessellate(design.parts["shell"].solid, SHELL_TOLERANCE_MM)
    gyroid, flange = _interface(design)
    data = b""
    for tolerance_mm in TOLERANCES_MM:
        data = glb(_parts(design, offsets, {"shell": shell, "interface": joined([gyroid, flange])}, tolerance_mm))
        if len(data) <= LARGEST_BYTES:
            break
        gyroid = clustered(design.meshes["interface"], CELL_MM * tolerance_mm / TOLERANCES_MM[0])
    return data


def _interface(design: Design) -> tuple[trimesh.Trimesh, trimesh.Trimesh]:
    """Meshes ``(gyroid, flange)``: the sheet as one layer of triangles, and the unchanged flange."""
    whole, height = to_manifold(design.meshes["interface"]), design.params.flange_thickness_mm
    flange = from_manifold(whole.trim_by_plane((0.0, 0.0, -1.0), -height).simplify(TOLERANCES_MM[0]))
    mesh = design.meshes["interface"]
    above = mesh.triangles_center[:, 2] > height
    return clustered(trimesh.Trimesh(mesh.vertices, mesh.faces[above], process=False, validate=False), CELL_MM), flange


def _parts(
    design: Design, offsets: Offsets, ready: Mapping[str, trimesh.Trimesh], tolerance_mm: float
) -> list[PreviewPart]:
    """All parts of endcap and mold; the interface is in both groups."""
    mold = _mold_offsets(design)

    def part(name: str, group: str, apart: tuple[float, float, float]) -> PreviewPart:
        mesh = ready[name] if name in ready else simplified(design.meshes[name], tolerance_mm)
        return PreviewPart(name, group, mesh, design.parts[name].color, apart)

    endcap = [part(name, "endcap", offsets.get(name, (0.0, 0.0, 0.0))) for name in PRODUCT]
    return [*endcap, *(part(name, "mold", mold[name]) for name in (*design.mold, "interface"))]


def simplified(mesh: trimesh.Trimesh, tolerance_mm: float) -> trimesh.Trimesh:
    """Closed mesh with fewer triangles, whose surface deviates by at most a tolerance."""
    return from_manifold(to_manifold(mesh).simplify(tolerance_mm))


def _mold_offsets(design: Design) -> dict[str, tuple[float, float, float]]:
    """Displacements of the mold's exploded view, mm: bowl up, collar outward, hanger down, core pieces apart inside."""
    size = design.params.outer_radius_mm
    heights = {
        "cup_bowl": 1.6,
        "cup_collar": -0.2,
        "hanger": -1.5,
        "core_centre": 0.55,
        "core_": 0.55,
        "interface": -0.7,
    }
    reaches = {"cup_bowl": 0.5, "cup_collar": 1.0, "core_key": 0.45, "core_wedge": 0.45}
    found = {}
    for name in (*design.mold, "interface"):
        height = next(v for stem, v in heights.items() if name.startswith(stem))
        reach = next((v for stem, v in reaches.items() if name.startswith(stem)), 0.0)
        x, y = np.asarray(design.meshes[name].bounds).mean(axis=0)[:2]
        far = math.hypot(x, y)
        way = (x / far, y / far) if reach and far > 1e-6 else (0.0, 0.0)
        found[name] = (size * reach * way[0], size * reach * way[1], size * height)
    return found
