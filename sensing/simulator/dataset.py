"""Labelled marker displacements in shards: chunked, resumable, reproducible from a seed (mm, N, N m, degrees).

A folder holds ``manifest.json`` (what was asked for), ``surface.npz`` (inner surface nodes at rest, dot directions) and
``shards/NNNNN.npz``. A shard holds its solved states (arrays ``state_*``, contact on azimuth 0) and its frames (arrays
``frame_*``: one state at one azimuth). Rendered images join by frame number. ``state_surface`` is the displacement of
the nodes in ``surface.npz``: all that a renderer needs.

Each shard is solved from its own seeds alone, so a killed run goes on where it stopped and ends with the same numbers.
It appears under its name only when complete. States that the simulator refused are listed in ``refusals``.
"""

from __future__ import annotations

import json
import os
import sys
import time
import zipfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cad.errors import FileError, ParameterError
from cad.materials import DEFAULT_SILICONE, silicone
from sensing.simulator.condensed import StoredTangent
from sensing.simulator.element import INNER_FACE
from sensing.simulator.frozen import FrozenPress
from sensing.simulator.geometry import shell_geometry
from sensing.simulator.indenter import Indenter
from sensing.simulator.mesh import DENSITIES, Index
from sensing.simulator.press import Press
from sensing.simulator.protocols import PHASES, LoadPath, load_path
from sensing.simulator.shell import ShellModel, shell_model
from sensing.simulator.state import Refusal, State, contact_patch
from sensing.simulator.surface import dot_directions, surface_sampler
from sensing.simulator.turn import turn_wrench

FORMAT = 1
PATHS_PER_SHARD = 5  # one of each tilt


@dataclass(frozen=True)
class DataRequest:
    """What a data set is made of; equal requests give equal data.

    Attributes:
        frames: least number of labelled frames (whole paths are kept, so a few more).
        diameter_mm, wall_mm, silicone: the shell. density: of the mesh (:data:`sensing.simulator.mesh.DENSITIES`).
        protocol, seed: loading paths. azimuths: labelled azimuths of every solved state.
        tolerance: of level 2, residual over contact force.
    """

    frames: int
    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    silicone: str = DEFAULT_SILICONE
    density: str = "data"
    protocol: str = "static"
    seed: int = 0
    azimuths: int = 4
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        for name, low, high in (("frames", 1, 10**7), ("azimuths", 1, 360)):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(f"{name}={value} outside {low}..{high}: give a count", name=name, value=value)
        if not 1e-9 <= self.tolerance <= 1e-2:
            raise ParameterError(
                f"tolerance={self.tolerance:g} outside 1e-9..1e-2: above it labels would be wrong by percents",
                name="tolerance",
                value=self.tolerance,
            )
        load_path(self.protocol, self.seed, 0, 1)
        silicone(self.silicone)
        if self.density not in DENSITIES:
            raise ParameterError(
                f"density={self.density!r} is unknown: choose one of {', '.join(DENSITIES)}",
                name="density",
                value=self.density,
            )

    def shards(self) -> list[list[LoadPath]]:
        """Paths of every shard."""
        paths: list[LoadPath] = []
        total = 0
        while total < self.frames:
            paths.append(load_path(self.protocol, self.seed, len(paths), self.azimuths))
            total += paths[-1].frames
        return [paths[k : k + PATHS_PER_SHARD] for k in range(0, len(paths), PATHS_PER_SHARD)]

    def model(self) -> ShellModel:
        """The whole shell, meshed."""
        geometry = shell_geometry(self.diameter_mm, self.wall_mm)
        return shell_model(geometry, silicone(self.silicone).neo_hooke(), self.density)


def write_dataset(request: DataRequest, folder: Path, workers: int = 1) -> int:
    """Write the shards that are missing.

    Returns:
        Number of shards written in this call.

    Raises:
        FileError: the folder holds another data set, or cannot be written (what was written stays readable).
    """
    shards = request.shards()
    model = request.model()
    try:
        (folder / "shards").mkdir(parents=True, exist_ok=True)
        _check_manifest(request, folder)
        _save(folder / "surface.npz", surface_arrays(model))
        missing = [k for k in range(len(shards)) if not _is_whole(shard_path(folder, k))]
        jobs = [(request, folder, k, shards[k]) for k in missing]
        begin = time.monotonic()
        if workers > 1:
            with ProcessPoolExecutor(workers) as pool:
                for count, _ in enumerate(pool.map(_write_shard, jobs), 1):
                    _progress(count, len(missing), begin)
        else:
            for count, job in enumerate(jobs, 1):
                _write_shard(job, model)
                _progress(count, len(missing), begin)
    except OSError as error:
        raise FileError(
            f"{folder}: cannot be written ({error.strerror or error}): the shards there stay readable; free some space "
            "or mend the folder and run the same command again"
        ) from error
    return len(missing)


def read_shard(path: Path) -> dict[str, Any]:
    """Arrays of a shard.

    Raises:
        FileError: missing or corrupt.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError) as error:
        raise FileError(f"{path}: not a whole shard ({error}): delete it and run the data command again") from error


def shard_path(folder: Path, number: int) -> Path:
    """Where a shard lies."""
    return folder / "shards" / f"{number:05d}.npz"


def solve_paths(request: DataRequest, paths: list[LoadPath], model: ShellModel) -> dict[str, Any]:
    """Arrays of one shard (see the module's text): every path on level 2, falling back to level 1."""
    directions = dot_directions(model.geometry)
    inner = inner_nodes(model)
    states: list[dict[str, Any]] = []
    frames: list[dict[str, Any]] = []
    refusals: list[str] = []
    shared: dict[float, list[StoredTangent]] = {}
    for path in paths:
        press = Press(model, Indenter(tilt_deg=path.tilt_deg), path.friction)
        solver = FrozenPress(press, request.tolerance, shared.setdefault(path.tilt_deg, []))
        samplers = [surface_sampler(model, directions, azimuth) for azimuth in path.azimuths_deg]
        state = solver.start()
        for count, point in enumerate(path.waypoints):
            before = solver.fallbacks
            try:
                state = solver.advance(state, point.target)
            except Refusal as refusal:
                refusals.append(f"path {path.number} state {count}: {refusal}")
                break
            states.append(_state_row(path, point.phase, state, model, inner, 1 if solver.fallbacks > before else 2))
            for azimuth, sampler in zip(path.azimuths_deg, samplers, strict=True):
                wrench = turn_wrench(state.wrench, azimuth)
                frames.append(
                    {
                        "frame_state": len(states) - 1,
                        "frame_azimuth_deg": azimuth,
                        "frame_force_n": wrench[:3],
                        "frame_torque_nm": wrench[3:] / 1000,
                        "frame_marker_mm": sampler.sample(state.displacement).astype(np.float32),
                    }
                )
    arrays = {
        name: np.array([row[name] for row in rows]) for rows in (states, frames) for name in (rows[0] if rows else {})
    }
    arrays["refusals"] = np.array(refusals, dtype=np.str_)
    return arrays


def inner_nodes(model: ShellModel) -> Index:
    """Numbers of the nodes on the inner surface, ascending (k,)."""
    mesh = model.solid.mesh
    return np.unique(mesh.cells[mesh.inner][:, INNER_FACE])


def surface_arrays(model: ShellModel) -> dict[str, Any]:
    """Inner surface at rest: ``position`` (k, 3), ``face`` (f, 9), ``dot_direction`` (m, 3), ``centre`` (3,)."""
    mesh = model.solid.mesh
    nodes, inverse = np.unique(mesh.cells[mesh.inner][:, INNER_FACE], return_inverse=True)
    return {
        "position": mesh.points[nodes],
        "face": inverse.reshape(-1, 9),
        "dot_direction": dot_directions(model.geometry),
        "centre": np.array(model.geometry.centre_mm),
    }


def _state_row(path: LoadPath, phase: str, state: State, model: ShellModel, inner: Index, level: int) -> dict[str, Any]:
    patch = contact_patch(model, state)
    assert state.certificate is not None
    return {
        "state_path": path.number,
        "state_phase": PHASES.index(phase),
        "state_tilt_deg": path.tilt_deg,
        "state_friction": path.friction,
        "state_level": level,
        "state_depth_mm": state.depth_mm,
        "state_shift_mm": np.array(state.shift_mm),
        "state_normal_n": state.normal_n,
        "state_wrench": state.wrench,
        "state_residual": state.certificate.residual,
        "state_wrench_gap": state.certificate.wrench_gap,
        "state_patch_mm2": patch.area_mm2,
        "state_slip_share": patch.slip_share,
        "state_surface": state.displacement[inner].astype(np.float32),
    }


def _write_shard(job: tuple[DataRequest, Path, int, list[LoadPath]], model: ShellModel | None = None) -> int:
    request, folder, number, paths = job
    _save(shard_path(folder, number), solve_paths(request, paths, model if model is not None else request.model()))
    return number


def _save(path: Path, arrays: dict[str, Any]) -> None:
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as stream:
            np.savez_compressed(stream, **arrays)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _is_whole(path: Path) -> bool:
    if not path.exists():
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.testzip() is None
    except (zipfile.BadZipFile, OSError):
        print(f"{path}: corrupt shard, solved again", file=sys.stderr)
        return False


def _check_manifest(request: DataRequest, folder: Path) -> None:
    path = folder / "manifest.json"
    wanted = {"format": FORMAT, "phases": list(PHASES), "request": asdict(request)}
    if path.exists():
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except ValueError as error:
            raise FileError(f"{path}: not a manifest ({error}): choose an empty folder") from error
        if found != wanted:
            raise FileError(f"{path}: holds another request ({found.get('request')}): choose an empty folder")
        return
    temporary = path.with_suffix(".part")
    temporary.write_text(json.dumps(wanted, indent=1) + "\n", encoding="utf-8")
    temporary.replace(path)


def _progress(done: int, total: int, begin: float) -> None:
    if sys.stderr.isatty():
        left = (time.monotonic() - begin) / done * (total - done)
        print(f"\r{done}/{total} shards, {left:.0f} s left ", end="\n" if done == total else "", file=sys.stderr)
