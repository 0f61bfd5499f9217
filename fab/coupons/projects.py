"""Slicer projects of the fit coupons, with the settings of the parts whose joints and pockets they stand for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import trimesh

from fab.slice.pose import laid_down
from fab.slice.printers import Printer
from fab.slice.project_3mf import Piece, Project, Volume, single, write_both
from fab.slice.settings import PrintSettings, part_settings

JOINTS, NUTS = "fit_joints", "fit_nuts"
APART_MM = 6.0  # between plate and tab
STANDS_FOR = {"fit_plate": ("cup_collar_1", "PLA"), "fit_tab": ("cup_collar_1", "PLA"), NUTS: ("interface", "TPU 95A")}


def write_fit_projects(meshes: Mapping[str, trimesh.Trimesh], where: Printer, folder: Path) -> list[str]:
    """Write the projects of joints and nuts in both dialects; return their file names.

    Args:
        meshes: of the coupons, by name, standing on z = 0, mm.
        where: the printer.
        folder: receives ``fit_joints`` and ``fit_nuts``, ``.prusa.3mf`` and ``.orca.3mf``.

    Raises:
        ParameterError: a coupon does not fit the bed.
        FileError: a file could not be written.
    """
    nuts = single(NUTS, _settings(NUTS, where), (_volume(NUTS, meshes, where),))
    return [path.name for project in (_joints(meshes, where), nuts) for path in write_both(project, folder)]


def _joints(meshes: Mapping[str, trimesh.Trimesh], where: Printer) -> Project:
    """Plate and tab one behind the other in the middle of the bed."""
    pieces = []
    for name, side in (("fit_plate", -1), ("fit_tab", 1)):
        volume = _volume(name, meshes, where)
        shift_mm = side * (float(volume.mesh.extents[1]) + APART_MM) / 2
        pieces.append(Piece(name, _settings(name, where), (volume,), (0.0, shift_mm)))
    return Project(JOINTS, tuple(pieces))


def _settings(name: str, where: Printer) -> PrintSettings:
    return replace(part_settings(*STANDS_FOR[name], where), reason="as the part for which it stands")


def _volume(name: str, meshes: Mapping[str, trimesh.Trimesh], where: Printer) -> Volume:
    return Volume(name, laid_down(name, meshes[name], where))
