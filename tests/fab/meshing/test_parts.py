"""Which meshes count as searched for crossings: those that were searched and have none, and no other."""

from __future__ import annotations

import pytest
import trimesh
from build123d import Solid

from cad.part import Part, Recipe
from fab.meshing import parts as module
from fab.meshing.mesh import mesh_sha256, read_stl, write_stl
from fab.meshing.parts import PartMeshes


@pytest.fixture
def piece() -> Part:
    ball, prism = Solid.make_sphere(10.0), Solid.make_box(20.0, 20.0, 20.0)
    return Part("piece", "printed", "PLA", ball & prism, (0.5, 0.5, 0.5), recipe=Recipe(ball, (prism,)))


def test_a_mesh_without_crossings_is_known_by_its_content_read_back_too(piece, tmp_path):
    maker = PartMeshes(0.1)
    mesh = maker.of(piece)
    write_stl(tmp_path / "piece.stl", mesh)
    assert maker.uncrossed == {mesh_sha256(read_stl(tmp_path / "piece.stl"))}
    moved = mesh.vertices.copy()
    moved[7, 1] += 1e-4
    write_stl(tmp_path / "piece.stl", trimesh.Trimesh(moved, mesh.faces, process=False))
    assert mesh_sha256(read_stl(tmp_path / "piece.stl")) not in maker.uncrossed


def test_a_repaired_mesh_is_searched_again(piece, monkeypatch):
    monkeypatch.setattr(module, "without_crossings", lambda mesh: mesh.copy())
    maker = PartMeshes(0.1)
    maker.of(piece)
    assert maker.uncrossed == set()
