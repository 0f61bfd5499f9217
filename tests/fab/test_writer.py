"""Solids as STEP, meshes as 3MF: equal bytes from equal parts, sound for other readers; a full disk is one line."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import trimesh
from build123d import Box, import_step
from strict_3mf import read_strictly

from cad.errors import FileError
from fab.coupons.__main__ import write_parts
from fab.exports.writer import write_3mf, write_solids

FULL = "/dev/full"  # every write fails with "No space left on device"


def one_part(name: str) -> SimpleNamespace:
    return SimpleNamespace(parts={name: SimpleNamespace(role="printed", solid=Box(1, 2, 3))})


def test_a_solid_comes_back_and_a_second_time_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_solids(one_part(name), tmp_path)
    assert import_step(tmp_path / "a.step").volume == pytest.approx(6)
    assert (tmp_path / "a.step").read_bytes() == (tmp_path / "b.step").read_bytes()


def test_a_mesh_as_3mf_is_sound_for_the_consortiums_strict_reader(tmp_path):
    ball = trimesh.creation.icosphere(2, 75.0)
    path = tmp_path / "shell.3mf"
    write_3mf(ball, "shell", path)
    first = path.read_bytes()
    write_3mf(ball, "shell", path)
    assert path.read_bytes() == first
    found = read_strictly(path).GetMeshObjects()
    assert found.Count() == 1 and found.MoveNext()
    mesh = found.GetCurrentMeshObject()
    assert (mesh.GetName(), mesh.GetTriangleCount()) == ("shell", len(ball.faces)) and mesh.IsManifoldAndOriented()
    assert trimesh.load_mesh(path).volume == pytest.approx(ball.volume)


def test_a_full_disk_is_one_line_with_what_to_do(tmp_path):
    (tmp_path / "base.step").symlink_to(FULL)
    message = r"^base\.step: cannot be written .*: free some space or name another folder with exports=DIR$"
    with pytest.raises(FileError, match=message):
        write_solids(one_part("base"), tmp_path)
    with pytest.raises(FileError, match=message):
        write_parts(one_part("base").parts, {"base": trimesh.creation.box((1.0, 2.0, 3.0))}, tmp_path)
