"""What another clearance takes from the cache is what would have been made, bit for bit; other inputs make it anew."""

from __future__ import annotations

import math
import tempfile

import numpy as np
import pytest
import trimesh

from cad.params import EndcapParams
from fab import kept
from fab.cache import Cache
from fab.checks.check import Check
from fab.exports.part_3mf import write_3mf
from fab.kept import kept_checks, kept_file, kept_interface_mesh
from fab.meshing.gyroid import InterfaceMesh


@pytest.fixture
def cache(tmp_path):
    return Cache(tmp_path / "cache")


def test_an_interface_comes_back_to_the_bit(cache, monkeypatch, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=math.pi)
    vertices = np.asarray(ball.vertices).astype(np.float32).astype(np.float64)
    made = InterfaceMesh(trimesh.Trimesh(vertices, ball.faces, process=False), 13.9, 0.45, 0.1 + 1e-17, 0.01 / 3, 5e4)
    calls = []
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "full"))  # nothing can be written there
    monkeypatch.setattr(kept, "interface_mesh", lambda params, flange: calls.append(flange) or made)
    for _ in range(2):
        again = kept_interface_mesh(EndcapParams(130, 8), cache, ball)
        assert np.array_equal(again.mesh.vertices, vertices) and np.array_equal(again.mesh.faces, ball.faces)
        assert again.mesh.vertices.dtype == np.float64
        assert {k: v for k, v in vars(again).items() if k != "mesh"} == {
            k: v for k, v in vars(made).items() if k != "mesh"
        }
    assert len(calls) == 1 and calls[0] is ball
    kept_interface_mesh(EndcapParams(130, 8.5), cache)
    kept_interface_mesh(EndcapParams(130, 8), None)
    assert len(calls) == 3


def test_checks_come_back_with_their_limits_and_only_for_the_same_inputs(cache):
    checks = [Check("a", 1 / 3, low=0.1), Check("b", math.inf, high=2.0), Check("c", 1.0, 1, 1)]
    made = []

    def make():
        made.append(True)
        return checks

    assert kept_checks(cache, "files", {"stl": "1"}, make) == kept_checks(cache, "files", {"stl": "1"}, make) == checks
    assert len(made) == 1
    kept_checks(cache, "files", {"stl": "2"}, make)
    kept_checks(cache, "nuts", {"stl": "1"}, make)
    kept_checks(None, "files", {"stl": "1"}, make)
    assert len(made) == 4


def test_a_file_of_a_mesh_comes_back_to_the_byte_and_only_for_that_mesh_and_name(cache, tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=math.pi)
    other = trimesh.Trimesh(ball.vertices * (1 + 1e-15), ball.faces, process=False)
    written = []

    def make(mesh, name, path):
        written.append(name)
        write_3mf(mesh, name, path)

    def bytes_of(keeper, mesh, stem, run):
        folder = tmp_path / run
        folder.mkdir(exist_ok=True)
        kept_file(keeper, "3MF", mesh, folder / f"{stem}.3mf", make)
        return (folder / f"{stem}.3mf").read_bytes()

    first = bytes_of(cache, ball, "interface", "first")
    assert bytes_of(cache, ball, "interface", "second") == first and written == ["interface"]
    bytes_of(cache, other, "interface", "third")
    bytes_of(cache, ball, "base", "third")
    assert bytes_of(None, ball, "interface", "fourth") == first
    assert written == ["interface", "interface", "base", "interface"]
