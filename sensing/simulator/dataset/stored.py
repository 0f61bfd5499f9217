"""Solved states of a set that was written without pictures, so that other sensors can render them without the solver.

    require_same_states(Path("exports/states"), request)
    states, refusals = stored_states(read_shard(shard_path(Path("exports/states"), 0)), path)

Mechanics cost much more than a picture and do not depend on paint, lamp and camera. Only states at rest can be reused:
of a motion the set holds the end of each exposure, not its beginning.
"""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError, ParameterError
from cad.identity import require_same
from cad.messages import LOG
from sensing.set_manifest import codes_of, identity_of, read_manifest, shard_path
from sensing.simulator.dataset.cluster import Origin
from sensing.simulator.dataset.request import ADDED_SINCE, DataRequest
from sensing.simulator.dataset.states import PathState
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.scene import SceneState
from sensing.simulator.solid.surface import turn_wrench

# Options that may differ between sensors; all others must be those with which the states were solved.
OF_THE_SENSOR = {"frames", "azimuths", "render", "lamp", "sensor", "unpainted", "missing", "smeared", "extra"}
OF_THE_STATES = ("silicone", "mesh")  # aspects of the identity on which states depend; they know no camera


def require_same_states(folder: Path, request: DataRequest) -> None:
    """Refuse a set whose states are not those of a request, or lack some of them; warns of those of another version.

    Args:
        folder: folder of the set; its shards hold the same paths as those of the request.
        request: request whose states are wanted.

    Raises:
        FileError: no such set, one of another mesh, or one with fewer paths.
        ParameterError: other options, other constants than the silicone has now, pictures instead of states, or a
            protocol of motions.
    """
    manifest = read_manifest(folder)
    found, wanted = ADDED_SINCE | manifest.get("request", {}), json.loads(json.dumps(request.record()))
    other = [name for name, value in wanted.items() if found.get(name) != value]
    other = [name for name in other if name not in OF_THE_SENSOR | {"noise_key"}]
    options, said, shards = {f.name for f in fields(request)}, "", request.shards()
    if other:
        fix = "give the same options" if options & set(other) else f"write it again, {request.silicone} has others now"
        said = f"was made with {', '.join(f'{name}={found.get(name)}' for name in other)}: {fix}"
    elif found.get("render") != "off":
        said = "holds pictures and no states: write one with --render off"
    elif any(path.exposure_s > 0 for path in shards[0]):
        said = f"protocol={request.protocol} smears its pictures, and the set keeps one state a frame: solve it again"
    if said:
        raise ParameterError(f"--states {folder}: {said}", name="states", value=str(folder))
    there = identity_of(folder, manifest)
    require_same(f"--states {folder}", "states", there, request.identity, "write them again", OF_THE_STATES)
    for number, paths in enumerate(shards):
        if not shard_path(folder, number).exists():
            raise FileError(f"--states {folder}: holds no path {paths[0].number}: write it with as many frames first")
    if codes_of(manifest) != [Origin.here().code]:
        LOG.warning(f"--states {folder}: another version of the toolkit solved them, whose mechanics may be others")


def stored_states(arrays: dict[str, NDArray[Any]], path: LoadPath) -> tuple[list[PathState], list[str]]:
    """States of a path and its refusals, as :func:`sensing.simulator.dataset.states.path_states` gave them.

    Args:
        arrays: content of the set's shard that holds the path.
        path: a loading path of that shard.

    Raises:
        ParameterError: the shard's path has another plane (another --azimuths).
    """
    rows = np.flatnonzero(arrays["path"] == path.number)
    there = {name: float(arrays[name][rows[0]]) for name in ("tilt_deg", "friction")}
    if any(abs(value - getattr(path, name)) > 1e-9 for name, value in there.items()):
        raise ParameterError(
            f"--states: path {path.number} has another friction there ({there['friction']:g}, here {path.friction:g}): "
            "give the same --azimuths",
            name="states",
        )
    rows = rows[arrays["azimuth_deg"][rows] == arrays["azimuth_deg"][rows[0]]]
    refusals = [str(line) for line in arrays["refusals"] if str(line).startswith(f"path {path.number} ")]
    states = [_state(arrays, row) for row in rows]
    return [
        PathState(int(arrays["step"][row]), state, state) for row, state in zip(rows, states, strict=True)
    ], refusals


def _state(arrays: dict[str, NDArray[Any]], row: int) -> SceneState:
    wrench = np.concatenate([arrays["force_n"][row], 1000 * arrays["torque_nm"][row]])
    shift = arrays["shift_mm"][row]
    return SceneState(
        level=int(arrays["level"][row]),
        depth_mm=float(arrays["depth_mm"][row]),
        shift_mm=(float(shift[0]), float(shift[1])),
        normal_n=float(arrays["normal_n"][row]),
        tangential_n=(float("nan"), float("nan")),
        wrench=turn_wrench(wrench, -float(arrays["azimuth_deg"][row])),
        surface_mm=arrays["surface_mm"][row].astype(float),
        patch_mm2=float(arrays["patch_mm2"][row]),
        slip_share=float(arrays["slip_share"][row]),
        error_estimate=float(arrays["residual"][row]),
        patch=None,
        certificate=None,
    )
