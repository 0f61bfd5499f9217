"""A data set small enough for tests, and runs of it that end badly (``python tests/small_data.py MODE DIR``)."""

from __future__ import annotations

import io
import os
import resource
import signal
import struct
import sys
import threading
import time
import zipfile
from dataclasses import replace
from pathlib import Path

from cad.errors import FileError
from sensing.set_manifest import shard_path
from sensing.simulator.__main__ import main
from sensing.simulator.dataset import local_workers
from sensing.simulator.dataset import request as data_request
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.writer import write_dataset
from sensing.simulator.press.press import Target
from sensing.simulator.protocols import catalogue as protocols
from sensing.simulator.protocols.loading import LoadPath, Waypoint, timed

ROOT = Path(__file__).resolve().parent.parent


def short_path(_: int, number: int, azimuths: int) -> LoadPath:
    """Three states in the mirror plane, so that the tests stay quick."""
    points = [
        Waypoint("approach", None, 2.0),
        Waypoint("load", Target(normal_n=8.0 + number)),
        Waypoint("drag", Target(normal_n=8.0, shift_mm=(0.5, 0.0))),
    ]
    return LoadPath(number, 20.0, 0.5, tuple(30.0 * (k + 1) for k in range(azimuths)), timed(points))


def small_request() -> DataRequest:
    """Two shards of one path each; needs :func:`short_path` under its name."""
    protocols.PROTOCOLS["short"] = short_path
    data_request.PATHS_PER_SHARD = 1
    return DataRequest(frames=12, density="draft", protocol="short", azimuths=2, render="draft")


def same(first: Path, second: Path) -> bool:
    a, b = ([shard_path(folder, k).read_bytes() for k in range(2)] for folder in (first, second))
    return [content(x) for x in a] == [content(x) for x in b]


def content(data: bytes) -> dict[str, bytes]:
    """Members of a zip by name (its time stamps may differ)."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def command(mode: str, folder: Path) -> list[str]:
    """This file as a command; see its end."""
    return [sys.executable, __file__, mode, str(folder)]


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT)}


def group_lives(group: int) -> bool:
    """Whether any process of the group is left."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def kill_in_second_shard(folder: str) -> int:
    """SIGKILL after the second shard's bytes are in its temporary file."""
    plain, calls = os.fsync, []

    def fsync(number: int) -> None:
        calls.append(number)
        if len(calls) == 4:  # dots, manifest, first shard, second
            os.kill(os.getpid(), signal.SIGKILL)
        plain(number)

    os.fsync = fsync
    write_dataset(small_request(), Path(folder))
    return 0


def fill_disk_in_second_shard(folder: str) -> int:
    """A file size limit that the second shard exceeds, through the command line's handling of errors."""
    request = small_request()
    write_dataset(replace(request, frames=6), Path(folder))
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    try:
        write_dataset(request, Path(folder))
    except FileError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def write_long(folder: str) -> int:
    """More shards than will be waited for, by two workers, through the command line."""
    small_request()
    plain = ["--density", "draft", "--protocol", "short", "--render", "draft", "--azimuths", "2"]
    return main(["data", "--frames", "3000", "--workers", "2", "--out", folder, *plain])


def begin_a_result(mark: str) -> None:
    """A worker's job that is in the middle of writing its result for ever."""
    pipe = sys._getframe(1).f_locals["result_queue"]._writer
    os.write(pipe.fileno(), struct.pack("!i", 1000) + b"the first bytes of a thousand")
    Path(mark).touch()
    time.sleep(600)


def cut_result(mark: str) -> int:
    """Ctrl-C while a worker writes its result."""

    def interrupt() -> None:
        while not Path(mark).exists():
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    try:
        list(local_workers.results(begin_a_result, [(mark,)], 2))
    except KeyboardInterrupt:
        return 0
    return 1


if __name__ == "__main__":
    mode, where = sys.argv[1:]
    runs = {"kill": kill_in_second_shard, "full": fill_disk_in_second_shard, "long": write_long, "cut": cut_result}
    sys.exit(runs[mode](where))
