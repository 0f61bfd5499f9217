"""Labelled frames of any design and silicone from the library, in the form of every data set.

    shell = shell_of(request)
    states = library_source(shell[0])                     # or solved_source(shell[0]): the same paths, solved directly
    write_labelled(request, library_paths(), states, Path("exports/D180_T10/states"), shell)

The folder is that of :mod:`sensing.records_labelled`, as for solved sets. Loads are those of
:class:`sensing.simulator.similarity.ratios.LoadScale`. Level 5 in the column ``level`` means: from the library.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.materials import silicone
from cad.whole_file import put_file
from sensing.set_manifest import FORMAT, shard_path
from sensing.simulator.dataset.frames import SIMULATED, joined, labels_of, light_labels, renderer_of, rest_arrays
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.states import PathState, apart_state, path_states
from sensing.simulator.levels import Simulator
from sensing.simulator.protocols.loading import PHASES, LoadPath, Waypoint
from sensing.simulator.protocols.scaled import scaled
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.scene import SceneState
from sensing.simulator.similarity.library import Library, ShellStates, load_library
from sensing.simulator.similarity.paths import library_paths, touching_steps
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios, about, common_order, wrench_units
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry

LEVEL = 5  # value of the column "level" for states from the library
PROTOCOL = "library"  # value of the protocol for the library's paths
StateSource = Callable[[LoadPath], list[PathState]]  # a path for this shell -> its states, without the refused ones
Progress = Callable[[int, int], None]


def shell_of(request: DataRequest) -> tuple[Simulator, LoadScale]:
    """Simulator of a request's shell and the scale of its loads.

    Args:
        request: design, silicone, density, tolerance and interlock.
    """
    law = silicone(request.silicone).neo_hooke()
    geometry = ShellGeometry.from_params(request.params)
    simulator = Simulator(geometry, law, request.density, request.level, request.tolerance, interlock=request.interlock)
    return simulator, LoadScale.of(geometry, law.shear_mpa)


def library_source(simulator: Simulator, library: Library | None = None) -> StateSource:
    """States of a shell by similarity, for the library's own paths.

    Args:
        simulator: simulator of the shell.
        library: library of states; None for the one that ships.
    """
    geometry, units = simulator.geometry, wrench_units(simulator.geometry.outer_radius_mm, simulator.law.shear_mpa)
    states = (library or load_library()).states(ShellRatios.of(geometry))
    first, count = {}, 0
    for path in library_paths():
        first[path.number] = count
        count += len(touching_steps(path))
    order = common_order(geometry, simulator.surface.position)

    def source(path: LoadPath) -> list[PathState]:
        found, row = [], first[path.number]
        for step, point in enumerate(path.waypoints):
            if point.target is None:
                found.append(apart_state(simulator, step, point, LEVEL))
                continue
            if states.known[row]:
                found.append(_from_library(states, row, step, point, geometry, order, units))
            row += 1
        return found

    return source


def solved_source(simulator: Simulator) -> StateSource:
    """States of a shell that are solved directly by the full simulation, which the library approximates."""
    last: list[float] = []

    def source(path: LoadPath) -> list[PathState]:
        if last != [path.tilt_deg]:
            simulator.forget()
            last[:] = [path.tilt_deg]
        return path_states(simulator, path)[0]

    return source


def write_labelled(
    request: DataRequest,
    paths: Sequence[LoadPath],
    source: StateSource,
    folder: Path,
    shell: tuple[Simulator, LoadScale],
    progress: Progress | None = None,
    keep: bool = False,
) -> int:
    """Write a set of paths that are given for D=130 T=8 in Smooth-Sil 950; replaces the content of the folder.

    Args:
        request: design, silicone, azimuths, camera and look of the pictures (``render``).
        paths: loading paths; they are scaled to the shell.
        source: source of the states of a scaled path.
        folder: folder of the set.
        shell: result of :func:`shell_of`.
        progress: called with (paths done, paths in all).
        keep: whether paths that an earlier run of the same request and source left there stay as they are.

    Returns:
        Number of labelled frames written.

    Raises:
        FileError: the folder cannot be written.
    """
    simulator, scale = shell
    renderer, frames = renderer_of(request, simulator), 0
    try:
        (folder / "shards").mkdir(parents=True, exist_ok=True)
        for old in () if keep else (folder / "shards").glob("*.npz"):
            old.unlink()
        _begin(request, simulator, folder, len(paths))
        for number, path in enumerate(paths):
            if shard_path(folder, number).exists():
                continue
            shard = _shard(request, simulator, renderer, scaled(path, scale), source)
            frames += len(shard["path"])
            buffer = io.BytesIO()
            np.savez(buffer, **cast(dict[str, Any], shard))
            put_file(shard_path(folder, number), buffer.getvalue(), durable=keep)
            if progress is not None:
                progress(number + 1, len(paths))
    except OSError as error:
        reason = error.strerror or error
        raise FileError(f"{folder}: cannot be written ({reason}): free some space, or choose another folder") from error
    return frames


def _begin(request: DataRequest, simulator: Simulator, folder: Path, shards: int) -> None:
    record = request.record() | {"protocol": PROTOCOL, "level": LEVEL}
    manifest = {"format": FORMAT, "phases": list(PHASES), "columns": SIMULATED, "request": record, "shards": shards}
    manifest["identity"] = request.identity.record()
    np.savez(buffer := io.BytesIO(), **cast(dict[str, Any], rest_arrays(simulator)))
    put_file(folder / "dots.npz", buffer.getvalue())
    request.mounted.save(folder / "camera.json", request.identity)
    put_file(folder / "manifest.json", (json.dumps(manifest, indent=1) + "\n").encode())


def _shard(
    request: DataRequest, simulator: Simulator, renderer: DomeRenderer | None, path: LoadPath, source: StateSource
) -> dict[str, NDArray[Any]]:
    """Columns and pictures of one path."""
    states = source(path)
    rows: list[dict[str, Any]] = []
    pictures: list[bytes] = []
    noise = path.number << 14
    for azimuth in path.azimuths_deg[: request.azimuths]:
        for state in states:
            moved = simulator.markers(state.end, azimuth)
            shown = simulator.outlines(state.end, request.mounted, azimuth)
            row = labels_of(request, path, state, azimuth) | {"reference": 0, **light_labels(request.settings)}
            row |= {"dots_mm": moved.astype(np.float32), "outline_mm": shown.astype(np.float32)}
            if renderer is None:
                pixels = np.full((len(moved), 2), np.nan)
                seen = np.zeros(len(moved), dtype=bool)
            else:
                noise += 1
                frame = renderer.render(
                    state.end.surface_mm, azimuth_deg=azimuth, frame=noise, settings=request.settings
                )
                pixels, seen = frame.dots_px, frame.dots_visible
                pictures.append(frame.jpeg)
            rows.append(row | {"dots_px": pixels.astype(np.float32), "dots_visible": seen})
    arrays: dict[str, NDArray[Any]] = {name: np.array([row[name] for row in rows]) for name in SIMULATED}
    arrays["refusals"] = np.array([], dtype=np.str_)
    if renderer is None:
        return arrays
    reference = renderer.render(frame=path.number << 14, settings=request.settings).jpeg
    return arrays | joined("jpeg", pictures) | joined("reference_jpeg", [reference])


def _from_library(
    states: ShellStates, row: int, step: int, point: Waypoint, geometry: ShellGeometry, order: NDArray[np.int64],
    units: Array,
) -> PathState:  # fmt: skip
    """State of a shell from one row of the library."""
    assert point.target is not None
    radius = geometry.outer_radius_mm
    surface = np.empty_like(states.surface[row])
    surface[order] = states.surface[row] * radius
    depth, normal, patch, slip = states.labels[row]
    end = SceneState(
        LEVEL,
        float(depth * radius),
        point.target.shift_mm,
        float(normal * units[0]),
        (float("nan"), float("nan")),
        about(states.wrench[row] * units, -np.array(geometry.centre_mm)),
        surface,
        float(patch * radius**2),
        float(np.clip(slip, 0.0, 1.0)),
        0.0,
        None,
        None,
    )
    return PathState(step, end, end)


def with_azimuths(paths: Sequence[LoadPath], count: int) -> list[LoadPath]:
    """The same paths, labelled at ``count`` azimuths, evenly spaced from their first one; the states do not change."""
    turns = np.arange(count) * (360.0 / count)
    return [
        replace(path, azimuths_deg=tuple(float((path.azimuths_deg[0] + t) % 360.0) for t in turns)) for path in paths
    ]
