"""Jobs on a Dask cluster: on its workers and no others, from the same version and camera, and every end is one line."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

from cad.errors import FileError, ParameterError
from cad.lens import RELEASED_MODULE, VARIABLE, camera_modules
from sensing.simulator.dataset import cluster
from sensing.simulator.dataset.cluster import Origin, results

distributed = pytest.importorskip("distributed")
OTHER_MODULE = next(name for name in camera_modules() if name != RELEASED_MODULE)


@pytest.fixture(scope="module")
def one_worker() -> Iterator[Any]:
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as made:
        yield made


def test_a_single_worker_does_the_work_and_not_the_computer_that_asks(one_worker: Any) -> None:
    done = list(results(os.getpid, [(), ()], one_worker.scheduler_address))
    assert len(done) == 2 and os.getpid() not in done


def test_errors_of_a_job_are_raised_where_it_was_asked_for(one_worker: Any) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        list(results(os.stat, [("/nowhere",)], one_worker.scheduler_address))


def test_a_worker_with_another_camera_is_refused(one_worker: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would render the released lens's pictures into a set whose camera file says another one."""
    monkeypatch.setenv(VARIABLE, OTHER_MODULE)
    with pytest.raises(FileError, match=rf"another camera module \({VARIABLE}\)"):
        list(results(os.getpid, [()], one_worker.scheduler_address))


def test_a_worker_of_another_version_is_refused() -> None:
    with pytest.raises(FileError, match="another version of the toolkit"):
        cluster._checked(replace(Origin.here(), code="of yesterday"), os.getpid)
    assert cluster._checked(Origin.here(), os.getpid) == os.getpid()


def test_a_version_is_all_code_that_makes_data() -> None:
    """What reads manifests and files makes none."""
    script = "import sys, sensing.simulator.dataset.frames as f; print(*sorted(m for m in sys.modules))"
    names = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    own = [f"{name.replace('.', '/')}" for name in names if name.split(".")[0] in ("cad", "sensing")]
    known = ("sensing", "sensing/code_digest", "sensing/npz", "sensing/set_manifest")
    places = [place.removesuffix(".py") for place in cluster.SOURCES]
    assert "sensing/records" in own
    assert not [name for name in own if name not in known and not any(f"{name}/".startswith(f"{p}/") for p in places)]


def test_a_scheduler_without_workers_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 1)
    empty = distributed.LocalCluster(n_workers=0, processes=True, host="127.0.0.1", dashboard_address="127.0.0.1:0")
    with empty, pytest.raises(ParameterError, match=r"has no worker; start dask worker tcp://127\.0\.0\.1"):
        list(results(os.getpid, [()], empty.scheduler_address))


def test_no_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 1)
    with pytest.raises(ParameterError, match=r"no Dask scheduler answers there"):
        list(results(os.getpid, [()], "tcp://127.0.0.1:9"))
