"""All checks that an export must pass, made on the files as written.

Each mesh is read back from its STL, so that the checked data are those that a slicer reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path

import trimesh

from cad.interface import build_zone
from cad.mold.layout import JOINT_CLEARANCE_MM, MoldLayout
from cad.params import EndcapParams
from cad.part import Part
from cad.robot_sides import DEFAULT_ROBOT
from fab.bom import fit_joints
from fab.cache import Cache
from fab.checks.bumps import bump_checks
from fab.checks.cavity import (
    balance_check,
    flange_air_check,
    leak_check,
    opened_space,
    trapped_air_checks,
    wall_check,
)
from fab.checks.check import Check
from fab.checks.extraction import Extraction, Leg, core_path, extract_core, extract_cup
from fab.checks.fit import bed_check, clearance_checks, overhang_check, screw_axis_checks
from fab.checks.gyroid import gyroid_checks
from fab.checks.hole_walls import hole_wall_checks
from fab.checks.meshes import exact_volume_mm3, mesh_checks, overlap_check, step_check
from fab.checks.nuts import nut_checks
from fab.checks.through_holes import through_hole_checks
from fab.checks.walls import min_wall_check
from fab.design import PRODUCT, Design, Progress, mesh_volume_mm3
from fab.exports.whole_folder import file_sha256
from fab.kept import SAME_AT_EVERY_CLEARANCE, kept_checks
from fab.meshing.mesh import mesh_sha256, read_stl, to_manifold
from fab.steps.endcap import all_steps
from fab.steps.fasteners import fastener_checks
from fab.steps.record import Step
from fab.steps.sweep import step_bodies, sweep_checks

SHELL = "shell"  # name of the silicone body
CAST_BETWEEN = ("cup_", "core_")  # the pieces that enclose the silicone
LEAST_GAP_RATIO = 1 / 3  # least gap of facets over the joint's clearance, where a bump ends at the joint


@dataclass(frozen=True)
class Gates:
    """The checks of a written folder, which run in other processes.

    Attributes:
        design: the written design.
        before: jobs whose checks precede the others in the manifest: those of the whole mold and of the endcap.
        after: jobs of single parts.
    """

    design: Design
    before: Sequence[Future[list[Check]]]
    after: Sequence[Future[list[Check]]]

    def checks(self, progress: Progress) -> list[Check]:
        """Wait for all checks and return them in a fixed order, passed or failed.

        Args:
            progress: function that receives the name of each step when it begins.
        """
        progress("checks: joints, screw axes")
        solids = solid_gates(self.design)  # in this process: the other ones have only meshes
        progress("checks: ways out, sweeps, cavity")
        before = [check for job in self.before for check in job.result()]
        progress("checks: walls, gyroid, files")
        return [*before, *solids, *(check for job in self.after for check in job.result())]


def start_gates(design: Design, folder: Path, workers: Executor, cache: Cache | None = None) -> Gates:
    """Start all checks of a written folder, the longest first.

    Args:
        design: the written design.
        folder: folder of its files.
        workers: processes that make the checks.
        cache: store of the checks of unchanged parts between runs.
    """
    made = [part for part in design.parts.values() if part.role != "bought"]
    files = {part.name: read_stl(folder / f"{part.name}.stl") for part in made}
    meshes = {name: files.get(name, mesh) for name, mesh in design.meshes.items()}  # bought parts have none
    layout, cast_mm3 = design.layout, mesh_volume_mm3(design, SHELL)
    pieces = {name: mesh for name, mesh in meshes.items() if name.startswith(CAST_BETWEEN)}
    paths = {name: core_path(layout, name, mesh) for name, mesh in pieces.items() if name.startswith("core_")}
    steps = all_steps(layout, paths)
    swept = {name: mesh for name, mesh in meshes.items() if name != SHELL}  # the sweeps make their own silicone body
    assemblies = {"endcap": PRODUCT, "mold": (*design.mold, "interface")}
    demold = workers.submit(demold_gates, layout, steps, swept, cast_mm3)
    mold = workers.submit(mold_gates, layout, steps, swept, design.robot)
    ways = workers.submit(extraction_gates, layout, pieces, paths)
    gyroid = workers.submit(_interface_checks, design.params, files["interface"], folder, cache)
    overlaps = workers.submit(_overlap_checks, assemblies, meshes)  # one job, because all of them need the interface
    cavity = workers.submit(cavity_gates, layout, meshes, cast_mm3)
    walls = workers.submit(
        print_gates, layout, {part.name: meshes[part.name] for part in made if part.role == "printed"}
    )
    single = [_submit(workers, design, part, files[part.name], folder, cache) for part in made]
    return Gates(design, (ways, mold, demold, cavity, overlaps), (walls, *single, gyroid))


def cavity_gates(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh], cast_mm3: float) -> list[Check]:
    """Checks of wall, bumps, leak and air of the closed mold.

    Args:
        layout: mold sizes.
        meshes: meshes of all parts, by name.
        cast_mm3: volume of the silicone shell, mm3.
    """
    pieces = {name: mesh for name, mesh in meshes.items() if name.startswith(CAST_BETWEEN)}
    return [
        wall_check(layout, pieces),
        *bump_checks(layout, [mesh for name, mesh in pieces.items() if name.startswith("core_")]),
        leak_check(layout, cast_mm3),
        *trapped_air_checks(layout, meshes[SHELL]),
        flange_air_check(layout),
    ]


def mold_gates(
    layout: MoldLayout, steps: Sequence[Step], meshes: Mapping[str, trimesh.Trimesh], robot: str = DEFAULT_ROBOT
) -> list[Check]:
    """Checks by sweeps of the steps that pass no silicone, and of the screws of all steps.

    Args:
        layout: mold sizes.
        steps: all steps of the work.
        meshes: meshes of all parts except the silicone shell, by name.
        robot: row of ``robot_sides.csv`` that the arm adapter fits.
    """
    bodies = step_bodies(layout, steps, meshes)  # manifold3d evaluates lazily: the silicone's body is not made here
    fits = fit_joints(layout, meshes)
    return [
        *sweep_checks(layout, [step for step in steps if not _passes_silicone(step)], bodies),
        *fastener_checks(layout.params, steps, bodies, fits, robot),
        *(check for fit in fits for check in fit.checks),
        *hole_wall_checks([fit.joint for fit in fits], meshes),
    ]


def demold_gates(
    layout: MoldLayout, steps: Sequence[Step], meshes: Mapping[str, trimesh.Trimesh], cast_mm3: float
) -> list[Check]:
    """Checks by sweeps of the steps that pass the silicone, and the balance, which share the body of the closed cavity.

    Args:
        layout: mold sizes.
        steps: all steps of the work.
        meshes: meshes of all parts except the silicone shell, by name.
        cast_mm3: volume of the silicone shell, mm3.
    """
    pieces = {name: mesh for name, mesh in meshes.items() if name.startswith(CAST_BETWEEN)}
    opened = opened_space(layout, pieces)
    passing = [step for step in steps if _passes_silicone(step)]
    return [
        *sweep_checks(layout, passing, step_bodies(layout, passing, meshes, opened)),
        balance_check(layout, pieces, meshes["interface"], cast_mm3, opened),
    ]


def _passes_silicone(step: Step) -> bool:
    return any(SHELL in (*move.parts, *move.past) for move in step.moves)


def extraction_gates(
    layout: MoldLayout, pieces: Mapping[str, trimesh.Trimesh], paths: Mapping[str, tuple[Leg, ...]]
) -> list[Check]:
    """Checks of the removal of core and cup.

    Args:
        layout: mold sizes.
        pieces: meshes of cup and core, by name.
        paths: paths of the core's pieces.
    """
    ways = [*extract_core(layout, pieces, paths), *extract_cup(layout, pieces)]
    return extraction_checks(ways, layout.joint_clearance_mm)


def solid_gates(design: Design) -> list[Check]:
    """Checks of joint clearances and screw axes, on the solids."""
    return [
        *clearance_checks(design.layout, {name: part.solid for name, part in design.parts.items()}),
        *screw_axis_checks([design.parts[name] for name in ("interface", "base", "hanger")], design.layout),
    ]


def print_gates(layout: MoldLayout, meshes: Mapping[str, trimesh.Trimesh]) -> list[Check]:
    """Checks of through holes, beds, walls and overhangs.

    Args:
        layout: mold sizes.
        meshes: meshes of the printed parts, by name.
    """
    checks = through_hole_checks(layout, meshes)
    for name, mesh in meshes.items():
        checks.append(bed_check(name, mesh))
        if name != "interface":  # its walls are those of its gyroid and its nut pockets
            checks.append(min_wall_check(name, mesh))
        if name.startswith("cup_"):
            checks.append(overhang_check(layout, name, mesh))
    return checks


def extraction_checks(extractions: Sequence[Extraction], joint_clearance_mm: float = JOINT_CLEARANCE_MM) -> list[Check]:
    """Checks of each piece's removal: penetration, gap, draft, strain of the opening."""
    checks = []
    for way in extractions:
        checks += [
            Check(f"{way.piece}.way_out_penetration_mm", way.penetration_mm, high=0.01),
            Check(f"{way.piece}.way_out_gap_mm", way.piece_gap_mm, low=LEAST_GAP_RATIO * joint_clearance_mm),
            Check(f"{way.piece}.draft_deg", way.draft_deg, low=0.0),
            Check(f"{way.piece}.rim_strain", way.rim_strain, high=0.0),
        ]
    return checks


def _submit(
    workers: Executor, design: Design, part: Part, mesh: trimesh.Trimesh, folder: Path, cache: Cache | None
) -> Future[list[Check]]:
    solids = [part.solid, build_zone(design.params)] if part.name == "interface" else [part.solid]
    volumes = [exact_volume_mm3(solid) for solid in solids]
    wanted = None if part.name == "interface" else mesh_volume_mm3(design, part.name)  # the gyroid has its own check
    keeper = cache if part.name in SAME_AT_EVERY_CLEARANCE else None
    uncrossed = mesh_sha256(mesh) in design.uncrossed  # the file holds the same mesh that was searched
    return workers.submit(_file_checks, part.name, mesh, wanted, volumes, folder, keeper, uncrossed)


def _file_checks(
    name: str,
    mesh: trimesh.Trimesh,
    mesh_volume: float | None,
    solid_volumes: list[float],
    folder: Path,
    cache: Cache | None,
    uncrossed: bool,
) -> list[Check]:
    """Checks of a part's files; ``mesh`` is read back from its STL."""
    stl, step = folder / f"{name}.stl", folder / f"{name}.step"
    inputs = {"name": name, "mesh_mm3": mesh_volume, "solid_mm3": solid_volumes}
    inputs |= {"stl": file_sha256(stl), "step": file_sha256(step)}

    def make() -> list[Check]:
        return [*mesh_checks(name, mesh, mesh_volume, uncrossed), step_check(name, solid_volumes, step)]

    return kept_checks(cache, "files of a part", inputs, make)


def _overlap_checks(assemblies: Mapping[str, Sequence[str]], meshes: Mapping[str, trimesh.Trimesh]) -> list[Check]:
    return [overlap_check(label, [to_manifold(meshes[name]) for name in names]) for label, names in assemblies.items()]


def _interface_checks(params: EndcapParams, mesh: trimesh.Trimesh, folder: Path, cache: Cache | None) -> list[Check]:
    inputs = {"design": params.digest, "stl": file_sha256(folder / "interface.stl")}
    return kept_checks(
        cache, "gyroid and nuts", inputs, lambda: [*gyroid_checks(params, mesh), *nut_checks(params, mesh)]
    )
