"""Is every hole of the mold's pieces whole? A blind one that breaks out, or two that meet, change a mesh's genus.

A closed surface with V corners, E edges and F faces in one piece has ``(2 - V + E - F) / 2`` holes through it (Euler).
"""

from __future__ import annotations

from collections.abc import Mapping

import trimesh

from cad.hanger import screw_joints
from cad.mold_cup import BOWL, COLLAR
from cad.mold_layout import MoldLayout
from fab.checks.check import Check


def through_hole_checks(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[Check]:
    """Holes through each piece of cup and core and the hanger, against those that are wanted.

    Args:
        layout: mold sizes.
        meshes: closed meshes by name of the part; others are left out.
    """
    return [
        Check(f"{name}.through_holes", through_holes(mesh), low=wanted, high=wanted)
        for name, mesh in meshes.items()
        if (wanted := _wanted(layout, name)) is not None
    ]


def through_holes(mesh: trimesh.Trimesh) -> int:
    """How many holes go through a closed mesh of one piece.

    Args:
        mesh: closed.
    """
    return (2 - int(mesh.euler_number)) // 2


def _wanted(layout: MoldLayout, name: str) -> int | None:
    """Bolts go through cup pieces, as do the pilot holes of a low collar; vents and screws through the hanger."""
    screws = {joint.anchor: len(joint.places) for joint in screw_joints(layout)}
    if name.startswith("core_"):
        return 0
    if name in (*BOWL, *COLLAR):
        is_low = layout.collar_screw_depth_mm > layout.seam_height_mm
        return len(layout.bolt_azimuths_deg) // len(BOWL) + (screws.get(name, 0) if is_low else 0)
    if name == "hanger":
        return len(layout.vent_azimuths_deg) + sum(screws.values())
    return None
