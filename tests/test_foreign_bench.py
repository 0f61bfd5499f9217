"""The mesh, the ink and the planes of the foreign world against closed forms; solving and rendering are its bench's."""

import numpy as np
import pytest

from bench.bench_foreign import renewed
from bench.foreign.forces import OUR_FAMILY, OURS, THEIRS, _limits, _ours, extrapolated
from bench.foreign.ink import TEXELS, Hand, map_places, texture
from bench.foreign.mesh import GRAINS, Shell, brick_mesh
from bench.foreign.press import PlanePath, Pressed
from bench.foreign.world import Look, _plane, turn, whole_surface
from cad.params import EndcapParams

SHELL = Shell(65, 57, 38.37, 6)


def below(radius):
    """Volume of a ball above the clamp."""
    height = radius - (SHELL.clamp_mm - SHELL.centre_mm)
    return np.pi * height**2 * (3 * radius - height) / 3


@pytest.fixture(scope="module")
def mesh():
    return brick_mesh(SHELL, 25, GRAINS["draft"])


def test_the_mesh_fills_half_the_shell_and_lies_on_it(mesh):
    corner = mesh.points[mesh.bricks[:, :8]]
    tetrahedra = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
    edges = [[corner[:, k] - corner[:, part[0]] for k in part[1:]] for part in tetrahedra]
    volume = np.array([np.einsum("ij,ij->i", np.cross(p, q), r) / 6 for p, q, r in edges])
    assert volume.min() > 0
    assert volume.sum() == pytest.approx((below(65) - below(57)) / 2, rel=0.03)  # straight edges
    radius = np.linalg.norm(mesh.points - [0, 0, SHELL.centre_mm], axis=1)
    assert np.allclose(radius[mesh.inner], 57, atol=1e-9) and np.allclose(radius[mesh.bricks[mesh.top][:, 4:8]], 65)
    assert np.allclose(mesh.points[mesh.clamp, 2], SHELL.clamp_mm, atol=1e-9)
    assert (mesh.points[:, 1] > -1e-9).all() and np.abs(mesh.points[mesh.mirror, 1]).max() < 1e-9


def test_a_field_on_the_half_is_seen_on_the_whole(mesh):
    nodes, back = np.unique(mesh.inner, return_inverse=True)
    rest = mesh.points[nodes]
    linear = np.array([[0.02, 0, 0.01], [0, -0.03, 0], [0.005, 0, 0.04]])  # keeps y = 0
    state = Pressed(back.reshape(mesh.inner.shape), rest, (rest @ linear)[None], np.zeros((1, 6)))
    surface = whole_surface(state, SHELL.centre_mm, 57)
    assert np.abs(surface.moved[0] - surface.rest @ linear).max() < 0.02  # the rest lies on the sphere, not on chords
    assert surface.rest[:, 1].min() < -50 and len(np.unique(surface.rest.round(3), axis=0)) == len(surface.rest)


@pytest.mark.long
def test_a_dot_lies_where_the_map_says():
    direction = np.array([[np.sin(1.2) * np.cos(2.0), np.sin(1.2) * np.sin(2.0), np.cos(1.2)]])
    _, ink = texture(direction, 57.0, Hand(beside_mm=0, missing=0, ragged=0, radius_sd=0), 0)
    row, column = np.nonzero(ink > 0.5)
    assert np.allclose(map_places(direction)[0] * TEXELS - 0.5, [column.mean(), row.mean()], atol=0.6)
    across = np.sqrt(len(row) * np.sin(1.2) / 1.2 / np.pi) * 2 * 2.05 * 57 / TEXELS  # area, the map's stretch undone
    assert across == pytest.approx(1.9, rel=0.02)


def test_the_plane_touches_where_it_is_said_to():
    params, R = EndcapParams(130, 8), turn(70.0)
    pose = _plane(PlanePath(30, 0.5, ((2.0, 0.0),)), 0, R, params)
    outward = R @ [0.5, 0, np.sqrt(0.75)]
    deepest = np.array([0, 0, params.centre_height_mm]) + 63 * outward
    assert (pose @ [*deepest, 1])[2] == pytest.approx(0) and np.allclose(pose[:3, :3] @ outward, [0, 0, -1])
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)


def test_the_true_camera_has_the_lens_of_the_renderer():
    camera = Look("equisolid", 245.0).camera(EndcapParams(130, 8)).camera
    angle = np.radians([10, 50, 85])
    assert np.allclose(camera.radius(angle), 2 * np.sin(angle / 2), atol=2e-5)


def test_the_limit_of_three_meshes_and_its_order():
    sizes = [7.0, 5.0, 3.6]
    limit, order = extrapolated(sizes, np.array([30.0 + 0.02 * h**1.7 for h in sizes]))
    assert limit == pytest.approx(30.0, abs=1e-9) and order == pytest.approx(1.7, abs=1e-9)
    swinging, unknown = extrapolated(sizes, np.array([30.0, 30.2, 30.1]))
    assert swinging == 30.1 and np.isnan(unknown)


def test_limits_are_of_meshes_that_differ_in_size_alone():
    ours, theirs = [OURS[name] for name in OUR_FAMILY], [GRAINS[grain] for grain in THEIRS]
    for layers, sizes in (
        ({mesh.layers for mesh in ours}, [1 / mesh.core for mesh in ours]),
        ({grain.layers for grain in theirs}, [grain.touch_mm for grain in theirs]),
    ):
        assert layers == {2} and sizes == sorted(sizes, reverse=True) and len(sizes) == 3


def test_a_mesh_of_other_layers_moves_no_limit():
    """One layer is softer: `fine` and `reference` beside `converged` gave an order that was that of the layers."""
    path, rng = PlanePath(30, 0.5, ((1.5, 0.0), (3.5, 0.0), (6.5, 0.0))), np.random.default_rng(0)
    forces = {name: 30.0 + (0.0 if name in OUR_FAMILY else rng.normal(size=3)) for name in OURS}
    forces |= {name: 30.0 + 2.0 / np.full(3, OURS[name].core) ** 2 for name in OUR_FAMILY}
    rows = {row["mesh"]: row["force_n_at_6.5_mm"] for row in _ours(path, forces)}
    assert rows["limit"] == pytest.approx(30.0) and rows["order"] == pytest.approx(2.0)
    assert list(rows) == [*OURS, "limit", "order", "scatter"]
    assert rows["scatter"] == pytest.approx((2 / 8**2 - 2 / 14**2) / 2)
    swinging = _limits("ours", path, [3.0, 2.0, 1.0], [np.full(3, 30.0), np.full(3, 30.2), np.full(3, 30.1)])
    assert [row["force_n_at_1.5_mm"] for row in swinging] == pytest.approx([30.1, np.nan, 0.1], nan_ok=True)


def test_our_rows_are_renewed_where_they_stood(tmp_path):
    (tmp_path / "a.csv").write_text("what,mesh\nCalculiX,draft\nours,data\nours,limit\nweights,draft\n")
    found = renewed(tmp_path / "a.csv", [{"what": "ours", "mesh": "fine"}])
    assert [(row["what"], row["mesh"]) for row in found] == [
        ("CalculiX", "draft"), ("ours", "fine"), ("weights", "draft")
    ]  # fmt: skip
