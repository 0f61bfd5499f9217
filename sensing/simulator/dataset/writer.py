"""Writes a data set: workers make the missing shards, and one process writes each of them whole or not at all.

The folder is described in :mod:`sensing.records_labelled`. Every shard depends on the request and its own number alone,
so a killed run can be continued and ends with the same bytes. Workers are processes of this machine, or those of a
Dask cluster; they return the bytes of shards, so only the calling machine needs the folder.
"""

from __future__ import annotations

import io
import json
import time
import zipfile
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from cad.errors import FileError, ParameterError
from cad.identity import require_same
from cad.messages import LOG, transient
from cad.whole_file import hold_lock, put_file
from sensing.records_labelled import read_shard, shard_files
from sensing.set_manifest import FORMAT, codes_of, identity_of, read_manifest, shard_path
from sensing.simulator.dataset import cluster, local_workers
from sensing.simulator.dataset.card import NAME as CARD
from sensing.simulator.dataset.card import write_card
from sensing.simulator.dataset.frames import SIMULATED, rest_arrays, shard_bytes, studio
from sensing.simulator.dataset.request import ADDED_SINCE, NOISE_KEY, DataRequest
from sensing.simulator.dataset.stored import require_same_states
from sensing.simulator.protocols.loading import PHASES, LoadPath

MAX_WORKERS = 1024  # most processes of --workers
Work = tuple[DataRequest, int, list[LoadPath], Path | None]  # request, number of the shard, its paths, their states
MANIFEST, OWN_FILES = "manifest.json", ("camera.json", "dots.npz")  # names of the files beside the shards


def write_dataset(
    request: DataRequest, folder: Path, workers: int = 1, scheduler: str | None = None, stored: Path | None = None
) -> int:
    """Write the missing shards.

    Args:
        request: options of the data set.
        folder: folder of the set; an unfinished set of the same request is completed, and a larger one keeps its size.
        workers: number of processes on this machine.
        scheduler: address of a Dask scheduler to use instead.
        stored: set whose solved states are taken instead of solving them (:mod:`sensing.simulator.dataset.stored`).

    Returns:
        Number of shards written in this call.

    Raises:
        FileError: the folder holds another set, is being written, or cannot be written (what is there stays readable).
        ParameterError: no such scheduler, or stored states of another request.
    """
    if stored is not None:
        require_same_states(stored, request)
    if not 1 <= workers <= MAX_WORKERS:
        raise ParameterError(f"workers={workers} outside 1..{MAX_WORKERS}", name="workers", value=workers)
    _require_free(folder)
    shards = request.shards()
    try:
        (folder / "shards").mkdir(parents=True, exist_ok=True)
        with _locked(folder):
            whole = _begin(request, folder, len(shards), stored)
            missing = [k for k in range(len(shards)) if not _is_whole(shard_path(folder, k))]
            begin = time.monotonic()
            states = None if stored is None else stored.resolve()  # workers of a cluster start elsewhere
            work = [(request, k, shards[k], None if states is None else shard_path(states, k)) for k in missing]
            for count, (number, data) in enumerate(_made(work, workers, scheduler), 1):
                put_file(shard_path(folder, number), data, durable=True)
                _progress(count, len(missing), begin)
            if len(shard_files(folder)) >= whole:
                write_card(folder)
    except BrokenProcessPool as error:
        raise FileError(
            f"{folder}: a worker was killed (out of memory?): the shards there stay readable; run the same command "
            "again, with fewer workers"
        ) from error
    except OSError as error:
        raise FileError(
            f"{folder}: cannot be written ({error.strerror or error}): the shards there stay readable; free some space "
            "or repair the folder and run the same command again"
        ) from error
    return len(missing)


def refusals(folder: Path) -> list[str]:
    """One line for each state that the simulator refused, over all shards.

    Raises:
        FileError: a corrupt shard.
    """
    return [line for path in shard_files(folder) for line in read_shard(path, ("refusals",))["refusals"].tolist()]


def _made(work: list[Work], workers: int, scheduler: str | None) -> Iterator[tuple[int, bytes]]:
    """(number, bytes) of each shard when it is finished, in any order."""
    workers = min(workers, len(work))
    if scheduler is None and workers <= 1:
        yield from (_job(*each) for each in work)
        return
    if scheduler is None:
        yield from local_workers.results(_job, work, workers)
        return
    yield from cluster.results(_job, work, scheduler)


def _job(request: DataRequest, number: int, paths: list[LoadPath], stored: Path | None) -> tuple[int, bytes]:
    return number, shard_bytes(request, paths, stored)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock of the folder for one writer; it is released when the process ends."""
    try:
        stream = hold_lock(folder / ".lock")
    except BlockingIOError:
        raise FileError(f"{folder}: another run is writing there; wait for it or choose another folder") from None
    except OSError as error:
        raise FileError(f"{folder / '.lock'}: {error.strerror or error}: choose another folder") from None
    with stream:
        yield


def _begin(request: DataRequest, folder: Path, shards: int, stored: Path | None) -> int:
    """Write manifest, camera and rest positions of a new folder; check those of an old one; remove partial files.

    Args:
        request: options of the data set.
        folder: folder of the set.
        shards: number of shards of the request.
        stored: set whose solved states are taken.

    Returns:
        Number of shards of the complete set: of the larger request, where the set was requested twice.
    """
    wanted, solved = _manifest(request, shards), [] if stored is None else codes_of(read_manifest(stored))
    codes = list(dict.fromkeys([cluster.Origin.here().code, *solved]))
    if (folder / MANIFEST).exists():
        manifest = read_manifest(folder)
        frames = _require_continued(request, folder, manifest, wanted["request"])
        if frames > request.frames:  # a part of the larger set must not count as complete
            larger = replace(request, frames=frames)
            wanted = _manifest(larger, len(larger.shards()))
        codes = _codes(folder, shards, codes_of(manifest), codes)
    wanted["code"] = codes
    np.savez(buffer := io.BytesIO(), **cast(dict[str, Any], rest_arrays(studio(request).simulator)))
    (folder / CARD).unlink(missing_ok=True)  # written again when the set is complete
    for litter in (path for place in (folder, folder / "shards") for path in place.glob(".*.????????.part")):
        litter.unlink()
    put_file(folder / MANIFEST, (json.dumps(wanted, indent=1) + "\n").encode(), durable=True)
    put_file(folder / "dots.npz", buffer.getvalue(), durable=True)
    request.mounted.save(folder / "camera.json", request.identity)
    return int(wanted["shards"])


def _require_free(folder: Path) -> None:
    """Refuse a folder of no set in which a file has the name of one of a set, before anything is written there."""
    if (folder / MANIFEST).exists():
        read_manifest(folder)  # refuses that of an export, and of others
        return
    for name in OWN_FILES:
        if (folder / name).exists():
            raise FileError(f"{folder / name}: is there, and is of no set: choose an empty folder")


def _require_continued(request: DataRequest, folder: Path, manifest: dict[str, Any], wanted: dict[str, Any]) -> int:
    """Refuse a set of other options, columns, noise or constants; returns the number of frames it was requested with.

    Args:
        request: options wanted now.
        folder: folder of the set.
        manifest: its manifest.
        wanted: the options as they are written into a manifest.
    """
    found = ADDED_SINCE | manifest.get("request", {})
    free = ("frames", "noise_key")
    other = [name for name, value in wanted.items() if found.get(name) != value and name not in free]
    if other:
        said = ", ".join(f"{name}={found.get(name)}" for name in other)
        raise FileError(f"{folder}: holds a set made with {said}: choose an empty folder or the same options")
    if manifest.get("columns", {}).keys() != SIMULATED.keys():
        raise FileError(f"{folder}: holds a set of other columns, of an earlier version: choose an empty folder")
    _require_noise(request, folder, found.get("noise_key"))
    require_same(folder, "holds a set", identity_of(folder, manifest), request.identity, "choose an empty folder")
    frames = found.get("frames")
    if not isinstance(frames, int):
        raise FileError(f"{folder / MANIFEST}: frames={frames!r} is no count: choose an empty folder")
    return frames


def _codes(folder: Path, shards: int, known: list[str], here: list[str]) -> list[str]:
    """Digests of the code of all runs that made shards; warns where this run adds to those of another version.

    Args:
        folder: folder of the set.
        shards: number of shards that are wanted now.
        known: digests in the manifest.
        here: digest of this version, and of those that solved the states which it takes.
    """
    there = len(shard_files(folder))
    if not there:
        return here
    if set(here) <= set(known) or all(shard_path(folder, number).exists() for number in range(shards)):
        return known
    LOG.warning(
        f"{folder}: its {there} shards were made by another version of the toolkit, which may solve or draw otherwise "
        "than this one, which adds the missing ones: choose an empty folder for a set of one version"
    )
    return list(dict.fromkeys([*known, *here]))


def _require_noise(request: DataRequest, folder: Path, key: object) -> None:
    """Refuse to continue pictures whose noise has another numbering; with seed 0 both numberings agree."""
    if key != NOISE_KEY and request.render != "off" and request.seed != 0:
        raise FileError(
            f"{folder}: holds pictures of another version, with noise_key={key} where this one has {NOISE_KEY} (seed="
            f"{request.seed} was not part of the noise): choose an empty folder"
        )


def _manifest(request: DataRequest, shards: int) -> dict[str, Any]:
    """The request as it is written into the manifest."""
    wanted = {"format": FORMAT, "phases": list(PHASES), "columns": SIMULATED, "request": request.record()}
    wanted |= {"shards": shards, "identity": request.identity.record()}
    return dict(json.loads(json.dumps(wanted)))


def _is_whole(path: Path) -> bool:
    if not path.exists():
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            if archive.testzip() is None:
                return True
    except (zipfile.BadZipFile, OSError):
        pass
    LOG.warning(f"{path}: corrupt shard, made again")
    return False


def _progress(done: int, total: int, begin: float) -> None:
    left = (time.monotonic() - begin) / done * (total - done)
    transient(f"{done}/{total} shards, {left:.0f} s left", done=done == total)
