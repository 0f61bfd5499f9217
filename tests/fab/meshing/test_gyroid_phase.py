"""Which phase the gyroid takes, what a ball reaches in its voids, and the voxels by which that is measured."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.ndimage import distance_transform_edt

from cad.errors import GeometryError
from cad.params import EndcapParams
from fab.checks.gyroid import gyroid_checks
from fab.meshing import gyroid
from fab.meshing.cast_space import COVERED_SHARE, ball_reach, cast_space
from fab.meshing.gyroid import InterfaceMesh
from fab.meshing.voxels import VoxelBox, inside, within


def test_voxels_of_a_ball_are_those_within_its_radius() -> None:
    ball = trimesh.creation.icosphere(5, 4.0)
    box = VoxelBox.around(np.full(3, -5.0), np.full(3, 5.0), 0.23)
    x, y, z = np.meshgrid(*(box.axis(k) for k in range(3)), indexing="ij")
    radius = np.sqrt(x**2 + y**2 + z**2)
    sure = np.abs(radius - 4.0) > 0.01  # the icosphere's chords
    assert (inside(ball, box) == (radius < 4.0))[sure].all()


def test_capped_distance_is_the_exact_one() -> None:
    solid = np.random.default_rng(3).random((40, 30, 20)) > 0.995
    assert (within(solid, 5.5) == (distance_transform_edt(~solid) < 5.5)).all()


def test_tuning_gives_up_with_a_message_when_nothing_helps() -> None:
    def stuck(period_mm: float, wall_mm: float, phase_mm: gyroid.Phase) -> InterfaceMesh:
        return InterfaceMesh(trimesh.Trimesh(), period_mm, wall_mm, 0.2, 0.0, 1.0)

    with pytest.raises(GeometryError, match=r"density 0\.20000 outside 0\.1"):
        next(gyroid.tuned(stuck))


@pytest.mark.parametrize(("excess", "wall_mm"), [(1.2e-3, 0.44946), (-0.7e-3, 0.45032), (-1.2e-3, 0.45)])
def test_the_wall_makes_up_for_the_last_of_the_density_less_so_by_growing(excess: float, wall_mm: float) -> None:
    """Facets make the sheet thicker already, by up to 0.83 of the gate's limit (D=230.8 with 11.4 % of TPU)."""
    start_mm = gyroid.AREA_PER_PERIOD * gyroid.WALL_MM / 0.1

    def trial(period_mm: float, wall_mm: float, phase_mm: gyroid.Phase) -> InterfaceMesh:
        density = 0.1 * (1 + excess) * wall_mm / gyroid.WALL_MM * start_mm / period_mm
        return InterfaceMesh(trimesh.Trimesh(), period_mm, wall_mm, density, 0.0, 1.0)

    assert next(gyroid.tuned(trial, 0.1)).wall_mm == pytest.approx(wall_mm, abs=1e-5)


def test_a_phase_that_misses_the_density_is_passed_over() -> None:
    def trial(period_mm: float, wall_mm: float, phase_mm: gyroid.Phase) -> InterfaceMesh:
        missed = phase_mm[2] < gyroid.PHASE_MM[2] + 3  # at the first two phases
        return InterfaceMesh(trimesh.Trimesh(), period_mm, wall_mm, 0.2 if missed else 0.1, 0.0, 1.0)

    assert len(list(gyroid.tuned(trial, 0.1))) == len(gyroid.PHASE_SHIFTS_MM) - 2


def reach_of(params: EndcapParams, mesh: trimesh.Trimesh) -> float:
    return ball_reach(params, cast_space(params, mesh))[0]


def failed(params: EndcapParams, mesh: trimesh.Trimesh) -> set[str]:
    return {check.name for check in gyroid_checks(params, mesh) if not check.ok}


@pytest.mark.long
def test_a_thin_walls_gyroid_is_moved_to_where_the_ball_reaches_its_voids(monkeypatch: pytest.MonkeyPatch) -> None:
    """D=99.2 T=6.5: at the first phase a row of passages is as narrow as the ball, with voxels of any size."""
    params = EndcapParams(99.2, 6.5)
    moved = gyroid.gyroid_sheet(params)
    assert reach_of(params, moved.mesh) > COVERED_SHARE
    assert abs(moved.density / 0.1 - 1) <= gyroid.DENSITY_TOLERANCE
    monkeypatch.setattr(gyroid, "ROOMY_WALL_MM", 6.5)
    assert "gyroid.ball_covered_share" in failed(params, gyroid.gyroid_sheet(params).mesh)


@pytest.mark.long
def test_a_passage_as_wide_as_the_ball_is_measured_with_finer_voxels() -> None:
    """Coarse ones close it by chance, at every phase: D=98.86 T=6.5 can be filled."""
    params = EndcapParams(98.86, 6.5)
    mesh = gyroid.gyroid_sheet(params).mesh
    assert reach_of(params, mesh) < COVERED_SHARE
    assert failed(params, mesh) == set()


def sheet_named(name: float) -> InterfaceMesh:
    return InterfaceMesh(trimesh.Trimesh(), name, 0.45, 0.1, 0.0, 1.0)


@pytest.mark.parametrize(
    ("shares", "chosen"), [((0.9, 0.95), 0), ((0.802, 0.81, 0.95), 1), ((0.7, 0.79, 0.75), 1), ((0.3,), 0)]
)
def test_the_first_phase_with_something_to_spare_is_taken_else_the_best(shares: tuple[float, ...], chosen: int) -> None:
    looked = []

    def covered(sheet: InterfaceMesh) -> float:
        looked.append(sheet.period_mm)
        return shares[int(sheet.period_mm)]

    assert gyroid.roomy(map(sheet_named, range(len(shares))), covered).period_mm == chosen
    assert len(looked) == (chosen + 1 if shares[chosen] > 0.805 else len(shares))
