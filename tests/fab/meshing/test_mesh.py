"""Meshes: STL round trip, welding, chord tolerance and its order, manifold3d."""

from __future__ import annotations

import math
import resource
import struct
import tempfile

import numpy as np
import pytest
import trimesh
from build123d import Solid

from cad.errors import EndcapError, FileError, GeometryError
from fab.meshing.mesh import (
    from_manifold,
    is_closed,
    is_oriented,
    read_stl,
    tessellate,
    to_manifold,
    unique_rows,
    volume_mm3,
    weld,
    write_stl,
)

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.fixture(scope="module")
def ball():
    return tessellate(Solid.make_sphere(20.0), 0.1)


def test_stl_is_read_back_and_written_again_byte_for_byte(ball, tmp_path):
    write_stl(tmp_path / "a.stl", ball)
    back = read_stl(tmp_path / "a.stl")
    assert np.array_equal(back.vertices[back.faces], ball.vertices[ball.faces])
    write_stl(tmp_path / "b.stl", back)
    assert (tmp_path / "a.stl").read_bytes() == (tmp_path / "b.stl").read_bytes()


def test_another_reader_agrees(ball, tmp_path):
    write_stl(tmp_path / "a.stl", ball)
    other = trimesh.load(tmp_path / "a.stl")
    assert len(other.faces) == len(ball.faces)
    assert other.volume == pytest.approx(ball.volume, rel=1e-6)
    data = (tmp_path / "a.stl").read_bytes()
    assert not data.startswith(b"solid")  # ascii readers go by this word
    normal = np.frombuffer(data, "<f4", 3, 84)
    assert normal == pytest.approx(ball.face_normals[0], abs=1e-4)


def test_a_mesh_is_closed_and_oriented_as_trimesh_says(ball):
    faces = np.asarray(ball.faces)
    turned = faces.copy()
    turned[5] = turned[5, ::-1]
    variants = {
        "whole": faces,
        "open": faces[1:],
        "turned": turned,
        "twice": np.concatenate([faces, faces[:1]]),
        "two": np.concatenate([faces, faces[:, ::-1]]),
        "collapsed": np.concatenate([faces, [[3, 3, 4]]]),
    }
    found = {}
    for name, corners in variants.items():
        mesh = trimesh.Trimesh(ball.vertices, corners, process=False, validate=False)
        found[name] = is_closed(mesh), is_oriented(mesh)
        assert found[name] == (mesh.is_watertight, mesh.is_watertight and mesh.is_winding_consistent), name
    assert found == dict.fromkeys(variants, (False, False)) | {"whole": (True, True), "turned": (True, False)}
    empty = trimesh.Trimesh(np.empty((0, 3)), np.empty((0, 3), dtype=int), process=False, validate=False)
    assert not is_closed(empty) and not is_oriented(empty)


@pytest.mark.parametrize("keep", [0, 50, 84, 84 + 50 * 3, -1])
def test_a_cut_short_stl_is_refused(ball, tmp_path, keep):
    write_stl(tmp_path / "a.stl", ball)
    whole = (tmp_path / "a.stl").read_bytes()
    (tmp_path / "a.stl").write_bytes(whole[:keep])
    with pytest.raises(FileError, match=r"a\.stl: not a whole binary STL \(\d+ bytes\)") as caught:
        read_stl(tmp_path / "a.stl")
    assert isinstance(caught.value, EndcapError)


def test_an_stl_with_a_false_count_is_refused(ball, tmp_path):
    write_stl(tmp_path / "a.stl", ball)
    data = bytearray((tmp_path / "a.stl").read_bytes())
    data[80:84] = struct.pack("<I", len(ball.faces) + 1)
    (tmp_path / "a.stl").write_bytes(bytes(data))
    with pytest.raises(FileError):
        read_stl(tmp_path / "a.stl")


def test_weld_joins_equal_corners_and_only_those():
    soup = TETRAHEDRON[FACES].reshape(-1, 3)
    mesh = weld(soup, np.arange(12).reshape(-1, 3))
    assert len(mesh.vertices) == 4 and mesh.is_watertight
    assert mesh.volume == pytest.approx(1 / 6)
    soup[0] += 1e-3  # one corner of one triangle moves: no weld, and so an open mesh
    assert not weld(soup, np.arange(12).reshape(-1, 3)).is_watertight


def test_weld_takes_minus_zero_for_zero():
    soup = TETRAHEDRON[FACES].reshape(-1, 3)
    soup[:6] = np.where(soup[:6] == 0, -0.0, soup[:6])
    assert len(weld(soup, np.arange(12).reshape(-1, 3)).vertices) == 4


def test_distinct_rows_are_those_of_numpy_in_its_order():
    rng = np.random.default_rng(3)
    values = np.array([-np.inf, -3e38, -130.25, -1e-45, -0.0, 0.0, 1e-45, 0.1, 130.25, np.inf], dtype=np.float32)
    for rows in (rng.choice(values, (4000, 3)), rng.choice(np.array([0, 1, 2**31, 2**32 - 1]), (300, 3))):
        distinct, places = unique_rows(rows)
        wanted, back = np.unique(rows + rows.dtype.type(0), axis=0, return_inverse=True)
        assert np.array_equal(distinct, wanted) and not np.signbit(distinct[distinct == 0]).any()
        assert np.array_equal(places, back.ravel()) and np.array_equal(distinct[places], rows)


def test_weld_drops_collapsed_and_cancelling_triangles():
    flap = np.vstack([FACES, [[0, 0, 1]], [[0, 1, 4]], [[1, 0, 4]]])
    mesh = weld(np.vstack([TETRAHEDRON, [[2.0, 2.0, 2.0]]]), flap)
    assert len(mesh.faces) == 4 and mesh.is_watertight


def test_tessellation_error_is_of_first_order_in_the_tolerance_and_one_sided():
    """A chord's sagitta is the tolerance, and the volume between sphere and facets is in proportion to it."""
    exact = 4 / 3 * math.pi * 20.0**3
    tolerances = np.array([0.2, 0.1, 0.05, 0.025, 0.0125])
    solid = Solid.make_sphere(20.0)
    meshes = [tessellate(solid, tolerance, angle_rad=2.0) for tolerance in tolerances]
    lack = np.array([1 - mesh.volume / exact for mesh in meshes])
    assert (lack > 0).all()
    slope = np.polyfit(np.log(tolerances), np.log(lack), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)
    for mesh in meshes:
        assert mesh.is_watertight
        assert np.linalg.norm(mesh.vertices, axis=1) == pytest.approx(20.0, abs=1e-5)


@pytest.mark.parametrize("size", [0, 4096])
def test_a_full_temporary_folder_is_named_with_what_to_do(tmp_path, monkeypatch, size):
    solid = Solid.make_sphere(50)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))  # bytes of the largest file, as on a full disk
    try:
        with pytest.raises(FileError) as error:
            tessellate(solid, 0.1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert str(error.value).startswith(f"temporary folder {tmp_path} is full or cannot be written: free some space")
    assert "TMPDIR" in str(error.value) and list(tmp_path.iterdir()) == []


def test_a_temporary_folder_that_is_gone_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "gone"))
    with pytest.raises(FileError, match=r"temporary folder .*gone is full or cannot be written"):
        tessellate(Solid.make_box(1, 1, 1))


def test_tessellation_is_repeatable_and_faces_outward():
    solid = Solid.make_torus(20.0, 4.0)
    first, second = tessellate(solid, 0.05), tessellate(solid, 0.05)
    assert np.array_equal(first.vertices, second.vertices) and np.array_equal(first.faces, second.faces)
    assert first.volume == pytest.approx(2 * math.pi**2 * 20 * 4**2, rel=0.01)


def test_manifold_round_trip_keeps_the_volume_and_an_open_mesh_is_refused(ball):
    assert from_manifold(to_manifold(ball)).volume == pytest.approx(ball.volume, rel=1e-9)
    opened = trimesh.Trimesh(ball.vertices, ball.faces[1:], process=False)
    with pytest.raises(GeometryError, match="not a closed manifold"):
        to_manifold(opened)


def test_the_solid_that_was_asked_for_last_is_kept_longest(monkeypatch):
    monkeypatch.setattr("fab.meshing.mesh.KEPT_SOLIDS", 2)
    meshes = [trimesh.creation.box((1, 1, side)) for side in (31, 32, 33)]
    first, second = (to_manifold(mesh) for mesh in meshes[:2])
    assert to_manifold(meshes[0]) is first
    to_manifold(meshes[2])
    assert to_manifold(meshes[0]) is first and to_manifold(meshes[1]) is not second


def test_the_volume_is_that_of_the_body_wherever_it_lies(ball):
    moved = trimesh.Trimesh(ball.vertices + np.array([50.0, -20.0, 7.0]), ball.faces, process=False)
    assert volume_mm3(moved) == moved.volume  # what earlier manifests say, to the bit
    assert volume_mm3(moved) == pytest.approx(4 / 3 * math.pi * 20.0**3, rel=2e-2)
    assert volume_mm3(moved) == pytest.approx(to_manifold(ball).volume(), rel=1e-6)
