"""Checks of the number of through holes of the mold's pieces, by the genus of their meshes.

A blind hole that breaks out, or two holes that meet, change the genus. A closed connected surface with V corners, E
edges and F faces has the genus ``(2 - V + E - F) / 2`` (Euler), which is the number of holes through the body.
"""

from __future__ import annotations

from collections.abc import Mapping

import trimesh

from cad.hanger import screw_joints
from cad.mold.cup import BOWL, COLLAR
from cad.mold.layout import MoldLayout
from fab.checks.check import Check


def through_hole_checks(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[Check]:
    """Checks of the number of through holes of each piece of cup and core and of the hanger.

    Args:
        layout: mold sizes.
        meshes: closed meshes by name of the part; other parts are ignored.
    """
    return [
        Check(f"{name}.through_holes", through_holes(mesh), low=wanted, high=wanted)
        for name, mesh in meshes.items()
        if (wanted := _wanted(layout, name)) is not None
    ]


def through_holes(mesh: trimesh.Trimesh) -> int:
    """Number of through holes (genus) of a closed connected mesh.

    Args:
        mesh: closed mesh.
    """
    return (2 - int(mesh.euler_number)) // 2


def _wanted(layout: MoldLayout, name: str) -> int | None:
    """Nominal number of holes: bolts and, in a low collar, pilot holes of the cup; vents and screws of the hanger."""
    screws = {joint.anchor: len(joint.places) for joint in screw_joints(layout)}
    if name.startswith("core_"):
        return 0
    if name in (*BOWL, *COLLAR):
        is_low = layout.collar_screw_depth_mm > layout.seam_height_mm
        return len(layout.bolt_azimuths_deg) // len(BOWL) + (screws.get(name, 0) if is_low else 0)
    if name == "hanger":
        return len(layout.vent_azimuths_deg) + sum(screws.values())
    return None
