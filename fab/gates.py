"""All checks that gate an export, on the files as written.

Each mesh is read back from its STL: what is checked is what a slicer will read.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor, Future
from pathlib import Path

import trimesh

from cad.interface import build_zone
from cad.part import Part
from fab.bumps import bump_checks
from fab.cavity import balance_check, leak_check, trapped_air_check, wall_check
from fab.check import Check
from fab.check_gyroid import gyroid_checks
from fab.design import PRODUCT, Design, Progress, solid_volume_mm3
from fab.extraction import Extraction, extract_core, extract_cup
from fab.fit import bed_check, clearance_checks, min_wall_check, overhang_check, screw_axis_checks
from fab.mesh import read_stl
from fab.mesh_checks import mesh_checks, overlap_checks, step_check

SHELL = "shell"


def run_gates(design: Design, folder: Path, workers: Executor, progress: Progress) -> list[Check]:
    """Run every check of a written folder.

    Args:
        design: what was written.
        folder: where its files lie.
        workers: processes for the checks of single meshes.
        progress: called with the name of each step as it begins.

    Returns:
        All checks, in a fixed order, passed or not.
    """
    made = [part for part in design.parts.values() if part.role != "bought"]
    single = [_submit(workers, design, part, folder) for part in made]
    meshes = {part.name: read_stl(folder / f"{part.name}.stl") for part in made}
    pieces = {name: meshes[name] for name in meshes if name.startswith(("cup_", "core_"))}

    progress("checks: gyroid")
    gyroid = workers.submit(gyroid_checks, design.params, design.gyroid)
    progress("checks: extraction")
    checks = extraction_checks([*extract_core(design.layout, pieces), *extract_cup(design.layout, pieces)])
    progress("checks: cavity and fit")
    checks += cavity_gates(design, meshes, pieces)
    checks += fit_gates(design, meshes)
    progress("checks: files")
    for part in made:
        solids = [part.solid, build_zone(design.params)] if part.name == "interface" else [part.solid]
        checks.append(step_check(part.name, solids, folder / f"{part.name}.step"))
    for pending in single:
        checks += pending.result()
    return checks + gyroid.result()


def cavity_gates(design: Design, meshes: dict[str, trimesh.Trimesh], pieces: dict[str, trimesh.Trimesh]) -> list[Check]:
    """Balance, wall, bumps, leak and air of the closed mold."""
    cast = solid_volume_mm3(design, SHELL)
    assert cast is not None
    return [
        balance_check(design.layout, pieces, meshes["interface"], cast),
        wall_check(design.layout, pieces),
        *bump_checks(design.layout, [mesh for name, mesh in pieces.items() if name.startswith("core_")]),
        leak_check(design.layout, cast),
        trapped_air_check(design.layout, meshes[SHELL]),
    ]


def fit_gates(design: Design, meshes: dict[str, trimesh.Trimesh]) -> list[Check]:
    """Overlaps, clearances, screw axes, walls, overhangs, beds."""
    product = {name: meshes.get(name, design.meshes[name]) for name in PRODUCT}
    mold = {name: meshes[name] for name in design.mold} | {"interface": meshes["interface"]}
    checks = overlap_checks(product, "endcap") + overlap_checks(mold, "mold")
    checks += clearance_checks(design.layout, meshes)
    checks += screw_axis_checks([design.parts[name] for name in ("interface", "base", "hanger")], design.layout)
    for name, part in design.parts.items():
        if part.role != "printed":
            continue
        checks.append(bed_check(name, meshes[name]))
        checks.append(min_wall_check(name, part.material.split()[0], meshes[name]))
        if name.startswith("cup_"):
            checks.append(overhang_check(design.layout, name, meshes[name]))
    return checks


def extraction_checks(extractions: Sequence[Extraction]) -> list[Check]:
    """What must hold for each piece on its way out."""
    checks = []
    for way in extractions:
        checks += [
            Check(f"{way.piece}.way_out_penetration_mm", way.penetration_mm, high=0.01),
            Check(f"{way.piece}.way_out_gap_mm", way.piece_gap_mm, low=0.1),
            Check(f"{way.piece}.draft_deg", way.draft_deg, low=0.0),
            Check(f"{way.piece}.rim_strain", way.rim_strain, high=0.0),
        ]
    return checks


def _submit(workers: Executor, design: Design, part: Part, folder: Path) -> Future[list[Check]]:
    return workers.submit(_check_file, part.name, solid_volume_mm3(design, part.name), folder / f"{part.name}.stl")


def _check_file(name: str, volume_mm3: float | None, path: Path) -> list[Check]:
    return mesh_checks(name, read_stl(path), volume_mm3)
