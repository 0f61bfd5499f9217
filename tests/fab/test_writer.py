"""Solids as STEP, meshes as 3MF: equal bytes from equal parts, sound for other readers; a full disk is one line."""

from __future__ import annotations

import re
from types import SimpleNamespace
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pytest
import trimesh
from build123d import Box, Compound, Solid, import_step
from strict_3mf import read_strictly

from cad.errors import FileError
from fab.coupons.__main__ import write_parts
from fab.exports.part_3mf import CORE, write_3mf
from fab.exports.writer import write_shape, write_solids

FULL = "/dev/full"  # every write fails with "No space left on device"


def one_part(name: str) -> SimpleNamespace:
    return SimpleNamespace(parts={name: SimpleNamespace(role="printed", solid=Box(1, 2, 3))})


def test_a_solid_comes_back_and_a_second_time_gives_the_same_bytes(tmp_path):
    for folder in (tmp_path / "a", tmp_path / "b"):
        folder.mkdir()
        write_solids(one_part("base"), folder)
    assert import_step(tmp_path / "a/base.step").volume == pytest.approx(6)
    assert (tmp_path / "a/base.step").read_bytes() == (tmp_path / "b/base.step").read_bytes()


@pytest.mark.parametrize("shape", [Box(1, 2, 3), Compound([Solid.make_box(1, 2, 3), Solid.make_box(3, 2, 1)])])
def test_the_product_of_a_file_is_named_as_its_part(shape, tmp_path):
    write_shape(shape, tmp_path / "hanger.step")
    products = re.findall(r"= PRODUCT\('([^']*)','([^']*)'", (tmp_path / "hanger.step").read_text())
    assert products == [("hanger", "hanger")] and shape.label == ""
    assert import_step(tmp_path / "hanger.step").volume == pytest.approx(shape.volume)


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


def test_a_3mf_has_every_coordinate_in_full_and_any_name(tmp_path):
    ball = trimesh.creation.icosphere(1, 75.0 / 7)
    write_3mf(ball, 'a "b" & <c>', tmp_path / "part.3mf")
    model = ElementTree.fromstring(ZipFile(tmp_path / "part.3mf").read("3D/3dmodel.model"))
    rows = {tag: model.iter(f"{{{CORE}}}{tag}") for tag in ("vertex", "triangle")}
    points = [[float(row.get(axis)) for axis in "xyz"] for row in rows["vertex"]]
    corners = [[int(row.get(corner)) for corner in ("v1", "v2", "v3")] for row in rows["triangle"]]
    assert np.array_equal(points, ball.vertices) and np.array_equal(corners, ball.faces)
    assert {row.get("name") for row in model.iter(f"{{{CORE}}}object")} == {'a "b" & <c>'}


def test_a_full_disk_is_one_line_with_what_to_do(tmp_path):
    (tmp_path / "base.step").symlink_to(FULL)
    message = r"^base\.step: cannot be written .*: free some space or name another folder with exports=DIR$"
    with pytest.raises(FileError, match=message):
        write_solids(one_part("base"), tmp_path)
    with pytest.raises(FileError, match=message):
        write_parts(one_part("base").parts, {"base": trimesh.creation.box((1.0, 2.0, 3.0))}, tmp_path)
