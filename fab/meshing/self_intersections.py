"""Search for self-intersecting faces of a mesh (millimetres).

Notes:
    pymeshlab is licensed under GPL-3; it is loaded only here and when this check runs, and no other module uses it.
"""

from __future__ import annotations

import numpy as np
import trimesh

from cad.errors import GeometryError


def self_intersections(mesh: trimesh.Trimesh) -> int:
    """Number of faces that cut another face of the mesh other than along a shared edge or corner."""
    return len(crossing_faces(mesh))


def crossing_faces(mesh: trimesh.Trimesh) -> np.ndarray:
    """Indices of the faces that cut another face of the mesh other than along a shared edge or corner.

    Raises:
        GeometryError: pymeshlab or a system library that it needs is not installed.
    """
    try:
        import pymeshlab
    except ImportError as error:
        raise GeometryError(
            f"self-intersections cannot be checked without pymeshlab ({error}): run `make setup`, or pip install "
            "pymeshlab; where a library lib... is not found, install the system's package of it"
        ) from error

    if len(mesh.faces) == 0:
        return np.empty(0, dtype=np.int64)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int32)))
    meshes.compute_selection_by_self_intersections_per_face()
    return np.flatnonzero(meshes.current_mesh().face_selection_array())
