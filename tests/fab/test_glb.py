"""The GLB assembly: metres with y up, names, offsets, the very meshes; equal bytes from equal meshes."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import trimesh

from cad.errors import FileError
from fab.exports.glb import write_glb


def small_design():
    """Two boxes in the endcap frame, one above the other."""
    base = trimesh.creation.box((20.0, 10.0, 4.0))
    shell = trimesh.creation.icosphere(subdivisions=3, radius=10.0).apply_translation((0.0, 0.0, 30.0))
    parts = {"base": SimpleNamespace(color=(0.2, 0.4, 0.6)), "shell": SimpleNamespace(color=(1.0, 0.5, 0.0))}
    return SimpleNamespace(meshes={"base": base, "shell": shell}, parts=parts)


def test_glb_reads_back_in_metres_with_y_up_and_the_meshes_volumes(tmp_path):
    design = small_design()
    write_glb(design, ("base", "shell"), {"shell": (0.0, 0.0, 5.0)}, tmp_path / "a.glb")
    scene = trimesh.load(tmp_path / "a.glb")
    assert set(scene.geometry) == {"base", "shell"}
    assert scene.bounds[:, 1] * 1000 == pytest.approx([-2.0, 45.0], abs=1e-4)
    assert scene.bounds[:, 2] * 1000 == pytest.approx([-10.0, 10.0], abs=1e-4)
    for name, mesh in scene.geometry.items():
        assert mesh.volume * 1e9 == pytest.approx(design.meshes[name].volume, rel=1e-5)  # not mirrored


def test_equal_meshes_give_equal_bytes(tmp_path):
    for name in ("a.glb", "b.glb"):
        write_glb(small_design(), ("base", "shell"), {}, tmp_path / name)
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def test_a_folder_that_is_gone_is_named_and_nothing_stays(tmp_path):
    with pytest.raises(FileError, match=r"gone"):
        write_glb(small_design(), ("base",), {}, tmp_path / "gone" / "a.glb")
    assert list(tmp_path.iterdir()) == []
