"""Printing pose of each part: side down, rotated if necessary, in the middle of the bed. Millimetres.

cup_bowl      dome-down, on the foot it also stands on when poured: the cavity needs no support
core          neck-down; the ramp over the bore, 60 degrees from upright, is propped from the bed
interface     mating plane down, the axis in the middle of the bed, where the zone is measured
all others    as in the endcap frame
"""

from __future__ import annotations

import numpy as np
import trimesh

from fab.slice.printers import Printer, fitting_turn_deg, printer, require_bed, turned


def laid_down(name: str, mesh: trimesh.Trimesh, where: Printer | None = None) -> trimesh.Trimesh:
    """A part in its printing pose: x and y about the bed's middle, lowest point at z = 0.

    Args:
        name: stable name of the part.
        mesh: closed mesh in the endcap frame.
        where: the printer; by default any with a 256 mm bed.

    Raises:
        ParameterError: it fits in no turn about the vertical; the message names a printer that takes it.
    """
    where = where or printer()
    points = standing(name, mesh)
    require_bed({name: points}, where)
    points[:, :2] = turned(points[:, :2], fitting_turn_deg(points, where) or 0.0)
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.zeros(2) if name == "interface" else (low + high)[:2] / 2
    points -= (*middle, low[2])
    return trimesh.Trimesh(points.astype(np.float32), mesh.faces, process=False, validate=False)


def standing(name: str, mesh: trimesh.Trimesh) -> np.ndarray:
    """Vertices (n, 3) of a part in its printing pose, before any turn about the vertical, where they happen to lie."""
    return np.asarray(mesh.vertices @ printing_rotation(name).T)


def printing_rotation(name: str) -> np.ndarray:
    """Rotation (3, 3) from the endcap frame to the printing pose, before any turn about the vertical."""
    if name.startswith("cup_bowl"):
        return np.diag([1.0, -1.0, -1.0])
    return np.eye(3)
