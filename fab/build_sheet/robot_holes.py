"""Whether the arm adapter of an export has the holes that its robot's rows of cad/robot_sides.csv describe now.

The sheet names screws, pin and drills by those rows, and the adapter is printed from the file of ``make molds``: rows
that were corrected in between would name screws for holes that are not there.
"""

from __future__ import annotations

import numpy as np
import trimesh

from cad.errors import FileError
from cad.lens import camera_setting
from cad.robot_sides import robot_side
from fab.slice.projects import Export

ON_HOLE_MM = 0.05  # distance of a mesh's vertices from the edge of a hole: they lie on it, but for rounding
FEWEST = 8  # vertices of a hole's two edges, at the least


def require_holes(export: Export, adapter: trimesh.Trimesh) -> None:
    """Refuse an adapter that lacks a hole of its robot.

    Args:
        export: folder of `make molds`.
        adapter: mesh of the arm adapter, endcap frame, mm.

    Raises:
        FileError: it does; the message has the command that makes it anew.
    """
    robot, places = export.variant.robot, np.asarray(adapter.vertices)[:, :2]
    for holes in robot_side(robot):
        for x, y in holes.places_mm:
            off_mm = np.abs(np.hypot(places[:, 0] - x, places[:, 1] - y) - holes.hole_diameter_mm / 2)
            if np.count_nonzero(off_mm < ON_HOLE_MM) < FEWEST:
                raise FileError(
                    f"{export.folder / 'arm_adapter.stl'}: has no {holes.element}'s hole {holes.hole_diameter_mm:g} mm "
                    f"wide at x={x:.1f}, y={y:.1f}, as robot={robot} of cad/robot_sides.csv has: its rows have changed "
                    f"since, run `{camera_setting()}make molds {export.words}` again"
                )
