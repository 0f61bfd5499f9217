"""Solves the shells of the library: ``python -m sensing.simulator.similarity.solve --help``.

Each node is one shell of the reference radius; its states and its capacity curves go to one file, so that several
processes can solve nodes, and a stopped run can be continued.

    python -m sensing.simulator.similarity.solve --node 0 --out build/similarity        # one node (a minute)
    python -m sensing.simulator.similarity.solve --out build/similarity                 # all, then the file that ships
    python -m sensing.simulator.similarity.solve --keep --out build/similarity          # only those that it lacks
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, ParameterError
from cad.materials import DEFAULT_SILICONE, silicone
from cad.messages import LOG, show
from cad.whole_file import make_folder, require_place
from sensing.arguments import whole
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.dataset.states import PathState, path_states
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import Refusal, contact_patch
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.protocols.scaled import scaled
from sensing.simulator.similarity.library import FILE, Library, joined, load_library, save_library, solved_node
from sensing.simulator.similarity.node import (
    CAPACITY,
    CAPACITY_DEPTHS,
    CAPACITY_FRICTION,
    CAPACITY_TILTS_DEG,
    LABELS,
    SolvedNode,
    read_node,
    save_node,
)
from sensing.simulator.similarity.nodes import NODES, SOME_PATHS, Design, file_name
from sensing.simulator.similarity.paths import library_paths, stand_paths, touching_steps
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios, about, common_order, wrench_units
from sensing.simulator.solid.elasticity import deformation_gradient
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry, shell_geometry
from sensing.simulator.solid.mesh import HexMesh, Index
from sensing.simulator.solid.shell import ShellModel, shell_model

TOLERANCE, LOOSER = 1e-3, 3e-3  # of level 2; the looser one for nodes at which level 1 would have to solve most states
MODES = 96  # surface modes that are kept
RIM_SHARE = 0.85  # of the polar angle to the clamp: strains beyond it are those of the bonded edge, which is singular


def solve_node(
    geometry: ShellGeometry, paths: Sequence[LoadPath], with_capacity: bool, numbers: Sequence[int] | None = None
) -> SolvedNode:
    """Solve a shell along paths given for D=130 T=8 in Smooth-Sil 950.

    Args:
        geometry: the shell.
        paths: loading paths; they are scaled to the shell.
        with_capacity: whether the capacity curves are solved, too.
        numbers: numbers of the paths that are solved; the states of the others are NaN. None for all.
    """
    law = silicone(DEFAULT_SILICONE).neo_hooke()
    simulator = Simulator(geometry, law, "data", 2, TOLERANCE if numbers is None else LOOSER)
    scale = LoadScale.of(geometry, law.shear_mpa)
    order, radius = common_order(geometry, simulator.surface.position), geometry.outer_radius_mm
    units, centre = wrench_units(radius, law.shear_mpa), np.array(geometry.centre_mm)
    surfaces, wrenches, labels, tilt = [], [], [], None
    for path in paths:
        if path.tilt_deg != tilt:
            simulator.forget()
            tilt = path.tilt_deg
        known = path_states(simulator, scaled(path, scale))[0] if numbers is None or path.number in numbers else []
        found = {state.step: state for state in known}
        for step in touching_steps(path):
            state = found.get(step)
            surfaces.append(_surface(state, order, radius))
            wrenches.append(np.full(6, np.nan) if state is None else about(state.end.wrench, centre) / units)
            labels.append(_labels(state, radius, units[0]))
        LOG.info(f"path {path.number}: {len(found)} of {len(path.waypoints)} states")
    curves = capacity(geometry) if with_capacity else np.zeros((0,))
    return SolvedNode(ShellRatios.of(geometry), np.array(surfaces), np.array(wrenches), np.array(labels), curves)


def capacity(geometry: ShellGeometry) -> Array:
    """(3, 15, 4) force, patch and largest stretch by tilt and depth (:data:`CAPACITY`), up to the first refusal."""
    law = silicone(DEFAULT_SILICONE).neo_hooke()
    model = shell_model(geometry, law, "data", half=True)
    radius, force = geometry.outer_radius_mm, law.shear_mpa * geometry.outer_radius_mm**2
    found = np.full((len(CAPACITY_TILTS_DEG), len(CAPACITY_DEPTHS), len(CAPACITY)), np.nan)
    for row, tilt in enumerate(CAPACITY_TILTS_DEG):
        press = Press(model, Indenter(tilt), CAPACITY_FRICTION)
        state = press.start()
        for column, depth in enumerate(CAPACITY_DEPTHS):
            try:
                state = press.advance(state, Target(depth_mm=depth * radius))
            except Refusal as refusal:
                LOG.info(f"tilt {tilt:g} depth {depth:.2f} R: {refusal}")
                break
            area = 2 * contact_patch(model, state).area_mm2 / radius**2
            found[row, column] = depth, state.normal_n / force, area, _largest_stretch(model, state.displacement)
    return found


def _surface(state: PathState | None, order: Index, radius: float) -> Array:
    if state is None:
        return np.full((len(order), 3), np.nan)
    return state.end.surface_mm[order] / radius


def _labels(state: PathState | None, radius: float, force: float) -> Array:
    if state is None:
        return np.full(len(LABELS), np.nan)
    end = state.end
    return np.array([end.depth_mm / radius, end.normal_n / force, end.patch_mm2 / radius**2, end.slip_share])


def _largest_stretch(model: ShellModel, displacement: Array) -> float:
    """Largest principal stretch at the Gauss points away from the bonded edge."""
    mesh: HexMesh = model.solid.mesh
    offset = mesh.points[mesh.cells].mean(axis=1) - np.array(model.geometry.centre_mm)
    polar = np.arccos(offset[:, 2] / np.linalg.norm(offset, axis=1))
    free = polar < RIM_SHARE * model.geometry.clamp_polar_rad(model.geometry.mid_radius_mm)
    gradient = deformation_gradient(model.solid.data, displacement[mesh.cells])[free]
    return float(np.linalg.svd(gradient, compute_uv=False).max())


def _solve(design: Design, folder: Path, known: Library | None) -> None:
    """Write the missing files of one node, from a library that has it, else solved."""
    ratios = ShellRatios.of(shell_geometry(*design))
    table = np.zeros((0, 2)) if known is None else known.ratios
    same = np.flatnonzero(np.isclose(table, [ratios.wall, ratios.clamp]).all(axis=1))
    for part, paths in (("node", library_paths()), ("stands", stand_paths())):
        path, some = folder / file_name(part, design), SOME_PATHS.get(design) if part == "node" else None
        if path.exists():
            read_node(path)  # a file of other paths is refused before the rest is solved for hours
            continue
        if known is not None and len(same):
            save_node(solved_node(known, int(same[0]), part == "stands"), path)
        else:
            save_node(solve_node(ratios.shell(), paths, part == "node", some), path)
        show(str(path))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m sensing.simulator.similarity.solve", description="Solve the library of states (an hour)."
    )
    parser.add_argument("--node", type=whole, help=f"solve one of the {len(NODES)} nodes (default: all missing)")
    parser.add_argument("--out", type=Path, default=Path("build/similarity"), help="folder of the solved nodes")
    parser.add_argument("--keep", action="store_true", help="take the nodes that the library has from it")
    parser.add_argument("--modes", type=whole, default=MODES, help=f"of the surface that are kept ({MODES})")
    parser.add_argument("--library", type=Path, default=FILE, help="file to write (default: the one that ships)")
    options = parser.parse_args(arguments)
    try:
        numbers = range(len(NODES)) if options.node is None else [options.node]
        if not all(0 <= number < len(NODES) for number in numbers):
            raise ParameterError(f"node={options.node} outside 0..{len(NODES) - 1}", name="node", value=options.node)
        make_folder(options.out)
        if options.node is None:
            require_place(options.library)  # before the solver runs for an hour
        for number in numbers:
            _solve(NODES[number], options.out, load_library(options.library) if options.keep else None)
        if options.node is None:
            parts = [[read_node(options.out / file_name(part, node)) for node in NODES] for part in ("node", "stands")]
            save_library(joined(parts[0], parts[1], options.modes), options.library)
            show(f"{options.library}: {len(NODES)} nodes, {options.library.stat().st_size / 1e6:.2f} MB")
    except EndcapError as error:
        LOG.error(f"sensing.simulator.similarity.solve: {error}")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
