"""How each part lies on the printer's bed: its side down, turned if it must be, in the middle. Millimetres.

cup_bowl      dome-down, on the foot it also stands on when poured: the cavity needs no support
core          neck-down; the ramp over the bore, 60 degrees from upright, is propped from the bed
interface     mating plane down, the axis in the middle of the bed, where the zone is measured
all others    as in the endcap frame
"""

from __future__ import annotations

import math

import numpy as np
import trimesh

from cad.errors import GeometryError
from fab.slice.settings import BED_MM

MARGIN_MM = 4.0  # round the part: brim and the width of a line


def laid_down(name: str, mesh: trimesh.Trimesh, bed_mm: float = BED_MM) -> trimesh.Trimesh:
    """A part in its printing pose: x and y about the bed's middle, lowest point at z = 0.

    Args:
        name: stable name of the part.
        mesh: closed mesh in the endcap frame.
        bed_mm: side and height of the printing space.

    Raises:
        GeometryError: it fits in no turn about the vertical; the message says by how much.
    """
    pose = printing_rotation(name)
    points = np.asarray(mesh.vertices) @ pose.T
    room = bed_mm - 2 * MARGIN_MM
    turn = _turn(points[:, :2], room)
    points[:, :2] = points[:, :2] @ turn.T
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    if max(size[:2]) > room or size[2] > bed_mm:
        raise GeometryError(
            f"{name} is {size[0]:.0f} x {size[1]:.0f} x {size[2]:.0f} mm as printed, over the {room:g} x {room:g} x "
            f"{bed_mm:g} mm of a {bed_mm:g} mm bed with its margin: choose a smaller D, or a printer with a larger bed"
        )
    middle = np.zeros(2) if name == "interface" else (low + high)[:2] / 2
    points -= (*middle, low[2])
    return trimesh.Trimesh(points.astype(np.float32), mesh.faces, process=False, validate=False)


def printing_rotation(name: str) -> np.ndarray:
    """Rotation (3, 3) from the endcap frame to the printing pose, before any turn about the vertical."""
    if name.startswith("cup_bowl"):
        return np.diag([1.0, -1.0, -1.0])
    return np.eye(3)


def _turn(points: np.ndarray, room_mm: float) -> np.ndarray:
    """Turn (2, 2) about the vertical: none if the part fits, else the one with the smallest square, to a degree."""
    best, best_side = np.eye(2), float(np.ptp(points, axis=0).max())
    for degrees in range(1, 90) if best_side > room_mm else ():
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn = np.array([[c, -s], [s, c]])
        side = float(np.ptp(points @ turn.T, axis=0).max())
        if side < best_side:
            best, best_side = turn, side
    return best
