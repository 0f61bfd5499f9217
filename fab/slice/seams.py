"""Where the walls of a layer may begin and end: never on what the silicone copies. Endcap frame, millimetres.

Where a wall begins and ends, the printer leaves a ridge. Slicers put it into a corner, and the sharpest corner of a
segment of the mold is that between the surface that the silicone copies and the joint: there the ridge is copied, and
holds the joint open. On the G-code of D=107 T=7.3 a bowl segment had half of its seams there (M). Therefore triangles
are painted, in the codes of both slicers.
"""

from __future__ import annotations

import numpy as np
import trimesh

from cad.params import EndcapParams

FREE, SEAM_HERE, NO_SEAM = 0, 4, 8  # S: a whole triangle's paint in PrusaSlicer, OrcaSlicer and Bambu Studio
SURFACE_MM = 0.03  # of a triangle's corners from the sphere: three times the tolerance of the meshes
BUMP_MM = 1.5  # more than the height of a bump over the core's sphere
BEYOND_MM = 3.0  # from the cavity to the outside of a cup segment, at least
MIDDLE_DEG = 30.0  # to either side of a cup segment's middle: its joints are 60 away, and their tabs end before 40
OUTWARD = 0.7  # cosine to the direction from the axis


def seam_paint(name: str, mesh: trimesh.Trimesh, params: EndcapParams) -> np.ndarray:
    """Code of each triangle (n,) of a printed part: none on the silicone's surface, cups have them outside.

    Args:
        name: stable name of the part.
        mesh: of the part, endcap frame.
        params: the design.
    """
    codes = np.full(len(mesh.faces), FREE, dtype=np.uint8)
    if not name.startswith(("cup_", "core_")):
        return codes
    points, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    radius = np.linalg.norm(points - np.array([0.0, 0.0, params.centre_height_mm]), axis=1)
    if name.startswith("core_"):
        on = (radius >= params.inner_radius_mm - SURFACE_MM) & (radius <= params.inner_radius_mm + BUMP_MM)
    else:
        on = np.abs(radius - params.outer_radius_mm) <= SURFACE_MM
        codes[_outside(mesh, radius[faces].min(axis=1) > params.outer_radius_mm + BEYOND_MM)] = SEAM_HERE
    codes[on[faces].all(axis=1)] = NO_SEAM
    return codes


def _outside(mesh: trimesh.Trimesh, beyond: np.ndarray) -> np.ndarray:
    """Triangles (n,) in the middle third of a segment that face away from the axis, of those ``beyond`` the cavity."""
    middles = np.asarray(mesh.triangles_center)[:, :2]
    outward = middles / np.maximum(np.linalg.norm(middles, axis=1), 1e-9)[:, None]
    facing = (np.asarray(mesh.face_normals)[:, :2] * outward).sum(axis=1)
    middle = (outward * np.asarray(mesh.area_faces)[:, None]).sum(axis=0)
    near = outward @ (middle / np.linalg.norm(middle)) > np.cos(np.radians(MIDDLE_DEG))
    return np.asarray(beyond & near & (facing > OUTWARD))
