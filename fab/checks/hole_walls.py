"""Checks of the walls of a part round the holes that hold its screws and inserts (millimetres).

:mod:`fab.checks.walls` finds a thin wall between two surfaces, but not a hole that has broken out through a surface,
where no wall remains. Here rays start on the hole's axis, normal to it and all round: each meets the hole's side first
and then the far side of the wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import trimesh

from cad.bought import bought_mm
from cad.fasteners import ScrewJoint
from fab.checks.check import Check
from fab.checks.screw_fit import INSERT_RING_MM, upright_spans
from fab.checks.walls import MIN_WALL_MM

RIM_MM = 0.4  # outside the hole's side: there lines along the axis measure the hole's depth
END_MM = 0.05  # excluded at the hole's mouth and bottom because of facets
STEP_MM = 0.5  # between rays along the axis
OFF_MM = 0.03  # distance of a line from the axis, which coincides with edges
ANGLES = 24  # rays round the axis
RELEASED = ("camera_to_base",)  # M: not checked: the released base has 0.3 mm between these holes and its pocket


def hole_wall_checks(joints: Iterable[ScrewJoint], meshes: Mapping[str, trimesh.Trimesh]) -> list[Check]:
    """Checks of the thinnest wall round the holes of each joint whose thread is in the part, except :data:`RELEASED`.

    Args:
        joints: joints of the design.
        meshes: closed meshes of their parts, by name, endcap frame, mm.
    """
    checks = []
    for joint in joints:
        if joint.holder in ("plastic", "insert") and joint.name not in RELEASED:
            walls = [hole_wall_mm(joint, meshes[joint.anchor], place) for place in joint.places]
            checks.append(Check(f"{joint.name}.hole_wall_mm", min(walls), low=MIN_WALL_MM))
    return checks


def hole_wall_mm(joint: ScrewJoint, mesh: trimesh.Trimesh, place: tuple[float, float]) -> float:
    """Thinnest wall round one hole, from its mouth to its end, mm; 0 where the hole is open to the side.

    Args:
        joint: joint of the hole.
        mesh: closed mesh of the part that holds the thread, endcap frame, mm.
        place: (x, y) of the axis, mm.
    """
    widest = INSERT_RING_MM - 2 * RIM_MM if joint.holder == "insert" else bought_mm(joint.thread, "thread") / 2
    angles = np.linspace(0.0, 2 * math.pi, ANGLES, endpoint=False) + 0.1  # between the edges of a hole's facets
    square = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(ANGLES)])
    rim = [span for line in upright_spans(mesh, place + (widest + RIM_MM) * square[:, :2], joint.up) for span in line]
    axis = upright_spans(mesh, np.array([place]) + OFF_MM, joint.up)[0]
    mouth, far_end = min((span[0] for span in rim), default=0.0), max((span[1] for span in rim), default=0.0)
    bottom = min((start for start, _ in axis if start > mouth), default=far_end)
    heights = np.arange(mouth + END_MM, bottom - END_MM, STEP_MM)
    if len(heights) == 0:
        return 0.0
    starts = np.column_stack([np.tile(place, (len(heights), 1)), heights if joint.up else -heights])
    spans = _first_spans(mesh, np.repeat(starts, ANGLES, axis=0), np.tile(square, (len(starts), 1)))
    closed = bool((spans[:, 0] <= widest).all())
    return float((spans[:, 1] - spans[:, 0]).min()) if closed else 0.0


def _first_spans(mesh: trimesh.Trimesh, starts: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """Distances (n, 2) at which rays from outside of a part enter and leave it, mm; infinite where they miss it."""
    places, rays, _ = mesh.ray.intersects_location(starts, ways, multiple_hits=True)
    distances = np.linalg.norm(places - starts[rays], axis=1)
    order = np.lexsort((distances, rays))
    rays, distances = rays[order], distances[order]
    fresh = np.append(True, (np.diff(rays) > 0) | (np.diff(distances) > 1e-4))  # a ray through an edge meets it twice
    rays, distances = rays[fresh], distances[fresh]
    spans = np.full((len(starts), 2), np.inf)
    rank = np.arange(len(rays)) - np.searchsorted(rays, rays)
    for number in (0, 1):
        spans[rays[rank == number], number] = distances[rank == number]
    return spans
