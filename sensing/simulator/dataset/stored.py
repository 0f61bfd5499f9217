"""Solved states of a set that was written without pictures, so that other sensors can render them without the solver.

    states, refusals = stored_states(Path("exports/states"), request, path)

Mechanics cost much more than a picture and do not depend on paint, lamp and camera. Only states at rest can be reused:
of a motion the set holds the end of each exposure, not its beginning.
"""

from __future__ import annotations

import json
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError, ParameterError
from sensing.records_labelled import LabelledSet, read_shard
from sensing.set_manifest import read_manifest
from sensing.simulator.dataset.request import ADDED_SINCE, DataRequest
from sensing.simulator.dataset.states import PathState
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.scene import SceneState
from sensing.simulator.solid.surface import turn_wrench

# Options that may differ between sensors; all others must be those with which the states were solved.
OF_THE_SENSOR = {"frames", "azimuths", "render", "lamp", "sensor", "unpainted", "missing", "smeared", "extra"}
OF_THE_SILICONE = ("c10_mpa", "bulk_mpa", "poisson", "prony")  # numbers of its row that decide the states


def require_same_states(folder: Path, request: DataRequest) -> None:
    """Refuse a set whose states are not those of a request.

    Args:
        folder: of the set.
        request: whose states are wanted.

    Raises:
        FileError: no such set.
        ParameterError: other options, other numbers of the silicone, pictures instead of states, or a protocol of
            motions.
    """
    found = ADDED_SINCE | read_manifest(folder)["request"]
    other = [f.name for f in fields(request) if found.get(f.name) != getattr(request, f.name)]
    other = [name for name in other if name not in OF_THE_SENSOR]
    here = json.loads(json.dumps(request.record()))
    law = [name for name in OF_THE_SILICONE if name in found and found[name] != here[name]]
    said = ""
    if law and not other:
        said = (
            f"was solved with {', '.join(f'{name}={found[name]}' for name in law)} of {request.silicone}, and its row "
            f"of cad/materials.csv has {', '.join(f'{name}={here[name]}' for name in law)} now: solve it again"
        )
    elif other:
        said = f"was made with {', '.join(f'{name}={found.get(name)}' for name in other)}: give the same options"
    elif found.get("render") != "off":
        said = "holds pictures and no states: write one with --render off"
    elif any(path.exposure_s > 0 for path in request.shards()[0]):
        said = f"protocol={request.protocol} smears its pictures, and the set keeps one state a frame: solve it again"
    if said:
        raise ParameterError(f"--states {folder}: {said}", name="states", value=str(folder))


def stored_states(folder: Path, path: LoadPath) -> tuple[list[PathState], list[str]]:
    """States of a path and its refusals, as :func:`sensing.simulator.dataset.states.path_states` gave them.

    Args:
        folder: folder of the set.
        path: a loading path of the set.

    Raises:
        FileError: the set does not hold the path.
        ParameterError: the shard's path has another plane (another --azimuths).
    """
    file = _shard_of_path(folder).get(path.number)
    if file is None:
        raise FileError(f"--states {folder}: holds no path {path.number}: write it with as many frames first")
    arrays = _arrays(file)
    rows = np.flatnonzero(arrays["path"] == path.number)
    same = [abs(float(arrays[name][rows[0]]) - getattr(path, name)) < 1e-9 for name in ("tilt_deg", "friction")]
    if not all(same):
        raise ParameterError(
            f"--states {folder}: path {path.number} has another friction there: give the same --azimuths",
            name="states",
            value=str(folder),
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


@lru_cache(maxsize=1)
def _shard_of_path(folder: Path) -> dict[int, Path]:
    files = LabelledSet(folder).shards
    return {int(number): file for file in files for number in np.unique(read_shard(file, ("path",))["path"])}


@lru_cache(maxsize=1)
def _arrays(file: Path) -> dict[str, NDArray[Any]]:
    return read_shard(file)
