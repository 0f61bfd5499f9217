"""Shared designs, built once for each test process."""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import pytest


@pytest.fixture(scope="session")
def released_mold():
    """Layout, parts by name and meshes by name of cup and core at D=130 T=8."""
    from cad.mold_core import core_body, core_parts
    from cad.mold_cup import cup_parts
    from cad.mold_layout import MoldLayout
    from cad.params import EndcapParams
    from fab.meshing.parts import PartMeshes

    layout = MoldLayout(EndcapParams(130.0, 8.0))
    made = [*core_parts(layout, core_body(layout)), *cup_parts(layout)]
    meshes = PartMeshes()
    return layout, {part.name: part for part in made}, {part.name: meshes.of(part) for part in made}


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
