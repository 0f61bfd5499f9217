"""The gyroid: field and area against closed forms, the mesh against its own checks, the checks against faults."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import manifold3d
import numpy as np
import pytest
import trimesh
from skimage.measure import marching_cubes

from cad import interface
from cad.interface import build_flange, zone_radii_mm, zone_volume_mm3
from cad.params import EndcapParams
from fab.checks import gyroid as gyroid_checks
from fab.checks.check import Check
from fab.checks.nuts import nut_checks
from fab.meshing import cast_space, gyroid
from fab.meshing.gyroid import InterfaceMesh, gyroid_distance_mm, interface_mesh, volume_above
from fab.meshing.gyroid_sheet import sheet_mesh
from fab.meshing.mesh import from_manifold, read_stl, tessellate, to_manifold, write_stl
from fab.meshing.self_intersections import self_intersections
from fab.meshing.zone_grid import zone_grid

PARAMS = EndcapParams(98.9, 7)  # the smallest parts: quick


@pytest.fixture(scope="module")
def built() -> InterfaceMesh:
    return interface_mesh(PARAMS)


@pytest.fixture(scope="module")
def printed(built: InterfaceMesh, tmp_path_factory: pytest.TempPathFactory) -> trimesh.Trimesh:
    """The mesh as the slicer reads it."""
    path = tmp_path_factory.mktemp("stl") / "interface.stl"
    write_stl(path, built.mesh)
    return read_stl(path)


def by_name(checks: list[Check]) -> dict[str, Check]:
    return {check.name: check for check in checks}


# --- field ---------------------------------------------------------------------------------------------------------


def test_gradient_is_the_fields_slope() -> None:
    phase = np.random.default_rng(1).uniform(0, 6, (50, 3))
    _, gradient = gyroid._gyroid(phase)
    for axis in range(3):
        step = np.eye(3)[axis] * 1e-6
        slope = (gyroid._gyroid(phase + step)[0] - gyroid._gyroid(phase - step)[0]) / 2e-6
        assert gradient[:, axis] == pytest.approx(slope, abs=1e-8)


def foot_points(period: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on the gyroid (bisection along rays) and their unit normals."""
    rng = np.random.default_rng(2)
    low, high = rng.uniform(0, 2 * math.pi, (2, 20 * count, 3))
    low_value, high_value = gyroid._gyroid(low)[0], gyroid._gyroid(high)[0]
    low, high = (p[low_value * high_value < 0][:count] for p in (low, high))
    sign = np.sign(gyroid._gyroid(low)[0])
    for _ in range(60):
        middle = (low + high) / 2
        same = (gyroid._gyroid(middle)[0] * sign > 0)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    gradient = gyroid._gyroid(low)[1]
    scale = period / (2 * math.pi)
    return low * scale + gyroid.PHASE_MM, gradient / np.linalg.norm(gradient, axis=1, keepdims=True)


def test_distance_is_exact_along_normals_and_second_step_is_the_better() -> None:
    points, normals = foot_points(13.9, 400)
    offset = gyroid.WALL_MM / 2
    error = {
        steps: np.abs(gyroid_distance_mm(points + offset * normals, 13.9, 1.8, steps) / offset - 1).max()
        for steps in (1, 2)
    }
    assert error[2] < 1e-3
    assert error[1] > 10 * error[2]  # so the second step earns its time


def test_area_of_the_gyroid_is_the_constant_of_the_density_law() -> None:
    areas = []
    for count in (32, 64):
        axis = np.linspace(0, 2 * math.pi, count + 1)
        grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
        value = gyroid._gyroid(grid.reshape(-1, 3))[0].reshape(grid.shape[:3])
        points, faces, _, _ = marching_cubes(value + 1e-9, 0.0, spacing=(1 / count,) * 3)
        areas.append(trimesh.Trimesh(points, faces, process=False).area)
    assert (4 * areas[1] - areas[0]) / 3 == pytest.approx(gyroid.AREA_PER_PERIOD, rel=5e-4)  # Richardson


# --- sheet ---------------------------------------------------------------------------------------------------------


def test_sheet_of_a_plane_distance_has_the_closed_form_volume() -> None:
    grid = zone_grid(PARAMS, 1.0)
    height = 17.3
    mesh = sheet_mesh(grid, grid.points()[..., 2] - height, 0.4)
    inner, outer = (radius**2 - (height - PARAMS.centre_height_mm) ** 2 for radius in zone_radii_mm(PARAMS))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(math.pi * (outer - inner) * 0.8, rel=2e-3)  # chords of a 1 mm grid


@pytest.mark.long
def test_sheet_volume_converges_with_the_square_of_the_step() -> None:
    volumes = []
    for step in (1.2, 0.6, 0.3):
        grid = zone_grid(PARAMS, step)
        distance = gyroid_distance_mm(grid.points(), 13.9, 3 * step)
        volumes.append(volume_above(sheet_mesh(grid, distance, 0.225), PARAMS.flange_thickness_mm))
    order = math.log2((volumes[0] - volumes[1]) / (volumes[1] - volumes[2]))
    assert order == pytest.approx(2, abs=0.3)


def test_interface_is_ten_per_cent_dense_and_repeats_byte_for_byte(built: InterfaceMesh) -> None:
    assert built.density == pytest.approx(0.10, abs=5e-5)
    assert built.zone_volume_mm3 == pytest.approx(zone_volume_mm3(PARAMS))
    assert built.wall_mm == pytest.approx(gyroid.WALL_MM, rel=0.01)
    cut = to_manifold(built.mesh).trim_by_plane([0, 0, 1], 6.0).volume()
    assert cut / built.zone_volume_mm3 == pytest.approx(built.density, rel=1e-4)
    again = interface_mesh(PARAMS, flange=tessellate(build_flange(PARAMS)))
    assert again.mesh.vertices.tobytes() == built.mesh.vertices.tobytes()
    assert again.mesh.faces.tobytes() == built.mesh.faces.tobytes()


def test_printed_mesh_is_closed_one_body_and_free_of_self_intersections(printed: trimesh.Trimesh) -> None:
    assert printed.is_watertight and printed.is_winding_consistent
    assert len(to_manifold(printed).decompose()) == 1
    assert self_intersections(printed) == 0


def test_islands_are_dropped_and_counted() -> None:
    stands = trimesh.creation.box((2, 2, 10)).apply_translation((0, 0, 5))
    floats = trimesh.creation.box((1, 1, 1)).apply_translation((5, 0, 9))
    kept, dropped = gyroid.drop_islands(trimesh.util.concatenate([stands, floats]), 6.0)
    assert dropped == pytest.approx(1.0)
    assert kept.volume == pytest.approx(40.0)


def test_volume_above_a_plane_is_that_of_the_cut_body() -> None:
    ball = trimesh.creation.icosphere(3, 5.0).apply_translation((1, 2, 0.3))
    assert volume_above(ball, 1.7) == pytest.approx(to_manifold(ball).trim_by_plane([0, 0, 1], 1.7).volume(), rel=1e-5)


# --- checks, and faults that they must see -------------------------------------------------------------------------


def test_all_checks_of_the_printed_mesh_hold(printed: trimesh.Trimesh) -> None:
    checks = gyroid_checks.gyroid_checks(PARAMS, printed) + nut_checks(PARAMS, printed)
    assert [check for check in checks if not check.ok] == []


@pytest.mark.long
def test_the_zones_inner_cylinder_is_no_wall_of_the_sheet() -> None:
    """A thick wall clips the zone at a cylinder, whose facets have TPU of any depth behind them."""
    thick = EndcapParams(130, 13)
    assert interface.zone_clip_radius_mm(thick) > 0 == interface.zone_clip_radius_mm(PARAMS)
    walls = gyroid_checks.sheet_walls_mm(thick, interface_mesh(thick).mesh)
    assert walls.max() < 1.3 * gyroid.WALL_MM


def skin(low: float, high: float, floor: float, top: float) -> manifold3d.Manifold:
    """A closed spherical skin between two radii, from one height to another."""
    heights = np.linspace(floor, top, 60)
    offsets = (heights - PARAMS.centre_height_mm) ** 2
    outside, inside_ = np.sqrt(high**2 - offsets), np.sqrt(low**2 - offsets)
    profile = [*zip(outside, heights, strict=True), *zip(inside_[::-1], heights[::-1], strict=True)]
    return manifold3d.Manifold.revolve(manifold3d.CrossSection([np.array(profile)]), 360)


def closed_faces(printed: trimesh.Trimesh, all_of_them: bool) -> trimesh.Trimesh:
    inner, outer = zone_radii_mm(PARAMS)
    body = to_manifold(printed) + skin(outer - 0.45, outer, 5.9, 31.0)
    if all_of_them:
        body = body + skin(inner, inner + 0.45, 5.9, 31.0) + skin(inner, outer, 30.5, 31.0)
    return from_manifold(body)


def test_every_closed_face_is_seen_and_a_ball_alone_in_the_mold_lies_on_the_flange() -> None:
    inner, outer = zone_radii_mm(PARAMS)
    tiny = trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation((0, 0, 20.0))  # no TPU in the zone
    cast = cast_space.cast_space(PARAMS, tiny, 0.4)
    assert gyroid_checks.closed_face_share(PARAMS, cast) == 0
    covered, gap = cast_space.ball_reach(PARAMS, cast)
    assert covered == 1.0 and 0 <= gap <= 0.4
    for face in (cast.radius < inner + 0.45, cast.radius > outer - 0.45, cast.height > PARAMS.interlock_top_mm - 0.45):
        tpu = np.broadcast_to(face, cast.radius.shape)
        assert gyroid_checks.closed_face_share(PARAMS, replace(cast, tpu=tpu)) > 0.99


@pytest.mark.parametrize("beyond_mm", [0.05, 0.3])
def test_a_corner_outside_the_zone_is_seen_on_every_side(beyond_mm: float) -> None:
    inner, outer = zone_radii_mm(PARAMS)
    centre, top = PARAMS.centre_height_mm, PARAMS.interlock_top_mm

    def at(radius: float, height: float) -> tuple[float, float, float]:
        return (math.sqrt(radius**2 - (height - centre) ** 2), 0.0, height)

    well = [at(inner, 10.0), at(outer, 10.0), at((inner + outer) / 2, top)]
    assert gyroid_checks.outside_zone_mm(PARAMS, trimesh.Trimesh(well, [[0, 1, 2]])) == pytest.approx(0, abs=1e-9)
    for corner in (at(inner - beyond_mm, 10.0), at(outer + beyond_mm, 10.0), at((inner + outer) / 2, top + beyond_mm)):
        mesh = trimesh.Trimesh([*well, corner], [[0, 1, 2], [0, 1, 3]], process=False)
        assert gyroid_checks.outside_zone_mm(PARAMS, mesh) == pytest.approx(beyond_mm)


@pytest.mark.long
def test_one_closed_face_is_seen(printed: trimesh.Trimesh) -> None:
    cast = cast_space.cast_space(PARAMS, closed_faces(printed, all_of_them=False))
    assert gyroid_checks.closed_face_share(PARAMS, cast) > 0.9
    assert gyroid_checks.trapped_void_mm3(PARAMS, cast) < 1e-2 * zone_volume_mm3(PARAMS)  # still open inward


@pytest.mark.long
def test_a_zone_closed_all_round_traps_both_labyrinths(printed: trimesh.Trimesh) -> None:
    cast = cast_space.cast_space(PARAMS, closed_faces(printed, all_of_them=True))
    trapped = gyroid_checks.trapped_void_mm3(PARAMS, cast)
    assert trapped > 0.5 * zone_volume_mm3(PARAMS)
    covered, gap = cast_space.ball_reach(PARAMS, cast)
    assert covered < cast_space.COVERED_SHARE
    assert gap > gyroid_checks.FLOOR_GAP_MM


@pytest.mark.long
def test_a_double_wall_and_a_scaled_part_are_seen() -> None:
    grid = zone_grid(PARAMS, 0.6)
    fat, _ = gyroid.standing_sheet(grid, grid.points(), 13.9, PARAMS.flange_thickness_mm, 2 * gyroid.WALL_MM)
    checks = by_name(gyroid_checks.gyroid_checks(PARAMS, fat))
    for name in ("gyroid.density_error_ratio", "gyroid.wall_p99_mm", "gyroid.wall_mean_error_ratio"):
        assert not checks[name].ok
    moved = fat.copy()
    moved.apply_translation((0.3, 0, 0))
    assert gyroid_checks.outside_zone_mm(PARAMS, moved) > 0.2


def test_crossing_boxes_intersect_themselves(tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 1, 1))
    other = box.copy().apply_translation((0.4, 0.3, 0.2))
    assert self_intersections(box) == 0
    assert self_intersections(trimesh.util.concatenate([box, other])) > 0
