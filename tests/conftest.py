"""Shared designs, built once for each test process."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest
from run_cache import FOLDER, shared

LONGEST_FIRST = (  # 115 to 15 s of processor time: must not be the last thing that one process does alone
    "test_kernels.py",  # what it compiles, the others load
    "fab/test_molds.py",
    "docs/test_tutorials.py",  # compiles most kernels, while the others make parts
    "fab/test_steps.py",  # makes the released mold that others read
    "sensing/robot/test_anew.py",  # compiles the robot's kernels
    "cad/test_base.py",
    "cad/test_mold.py",
    "fab/meshing/test_gyroid.py",
    "fab/checks/test_extraction.py",
    "fab/checks/test_gates.py",
)


def pytest_configure(config: pytest.Config) -> None:
    """Give the tests a cache folder of their own, the same to all test processes, and no setting of the user's.

    What an earlier run kept must not answer a test, nor what this user trained or the camera module of this shell, and
    what tests keep must not reach the user. Signals, too, are what a terminal gives: tests that stop a program work in
    the background.
    """
    os.environ.pop("ENDCAP_CAMERA", None)
    # Test modules with their asserts taken apart, and modules that a started program loads, are compiled once.
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    for number in (signal.SIGINT, signal.SIGHUP):  # ignored under nohup and in the background: programs inherit that
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
    if FOLDER not in os.environ:
        folder = tempfile.mkdtemp(prefix="endcap-tests-cache-")
        os.environ[FOLDER] = os.environ["XDG_CACHE_HOME"] = folder
        os.environ["XDG_DATA_HOME"] = str(Path(folder) / "data")
        # Compiled kernels stay for the next run: numba looks at the source's date.
        if cache := getattr(config, "cache", None):
            os.environ["NUMBA_CACHE_DIR"] = str(cache.mkdir("numba"))
        config.add_cleanup(lambda: _remove_cache(folder))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first; `make test` keeps this order (``--no-loadscope-reorder``)."""
    rank = {Path(__file__).parent / name: number for number, name in enumerate(LONGEST_FIRST)}
    if gone := [path.name for path in rank if not path.exists()]:
        raise pytest.UsageError(f"LONGEST_FIRST of tests/conftest.py names {', '.join(gone)}: no such file")
    items.sort(key=lambda item: rank.get(item.path, len(rank)))


def _remove_cache(folder: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    os.environ.pop(FOLDER, None)


@pytest.fixture(scope="session")
def released_mold():
    """Layout, parts by name and meshes by name of cup and core at D=130 T=8."""
    from cad.mold.layout import MoldLayout
    from cad.params import EndcapParams

    layout = MoldLayout(EndcapParams(130.0, 8.0))
    made = [part.unpacked() for part in shared("released_mold", lambda: packed_mold(layout))]
    return layout, {part.name: part for part, _ in made}, {part.name: mesh for part, mesh in made}


def packed_mold(layout):
    """Cup and core with their meshes."""
    from cad.mold.core import core_body, core_parts
    from cad.mold.cup import cup_parts
    from fab.meshing.mesh import TOLERANCE_MM
    from fab.packed import _packed

    return _packed([*core_parts(layout, core_body(layout)), *cup_parts(layout)], TOLERANCE_MM)


@pytest.fixture
def short_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """A protocol of short paths, one path a shard."""
    from small_data import short_path

    from sensing.simulator.dataset import request as data_request
    from sensing.simulator.protocols import catalogue as protocols

    monkeypatch.setitem(protocols.PROTOCOLS, "short", short_path)
    monkeypatch.setattr(data_request, "PATHS_PER_SHARD", 1)


@pytest.fixture(scope="session")
def small_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A labelled set of two shards, written by one process."""
    from small_data import small_request

    from sensing.simulator.dataset import request as data_request
    from sensing.simulator.dataset.writer import write_dataset

    kept = data_request.PATHS_PER_SHARD
    folder = tmp_path_factory.mktemp("set")
    assert write_dataset(small_request(), folder) == 2
    data_request.PATHS_PER_SHARD = kept
    return folder
