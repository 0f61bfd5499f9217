"""The solid without contact: kernels by finite differences, patch test, exact solutions, locking."""

import math

import numpy as np
import pytest

from cad.errors import GeometryError, ParameterError
from cad.materials import HyperelasticLaw, hyperelastic_law, silicone, silicones
from sensing.simulator.solid import closed_forms
from sensing.simulator.solid import elasticity as elastic
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import DENSITIES, HexMesh, box_mesh, shell_mesh
from sensing.simulator.verification import solid as verify_solid

YEOH = hyperelastic_law(0.34, 0.49, 0.05, 0.01)


@pytest.fixture(scope="module")
def warped() -> tuple[HexMesh, np.ndarray]:
    """Two distorted elements and a large random displacement of them."""
    rng = np.random.default_rng(3)
    mesh = box_mesh((2, 1, 1), (2.0, 1.0, 1.0))
    mesh = HexMesh(mesh.points + rng.normal(0, 0.03, mesh.points.shape), mesh.cells, mesh.outer, mesh.inner)
    return mesh, rng.normal(0, 0.05, mesh.points.shape)[mesh.cells]


def test_force_is_the_slope_of_the_energy(warped: tuple[HexMesh, np.ndarray]) -> None:
    mesh, u = warped
    data = elastic.element_data(mesh)
    way = np.random.default_rng(4).normal(size=u.shape)
    _, force = elastic.energy_and_force(YEOH, data, u)
    h = 1e-6
    up, down = (elastic.energy_and_force(YEOH, data, u + sign * h * way)[0] for sign in (1, -1))
    slope = (up - down) / (2 * h)
    assert slope == pytest.approx(float((force * way).sum()), rel=1e-8)


def test_tangent_is_the_slope_of_the_force(warped: tuple[HexMesh, np.ndarray]) -> None:
    mesh, u = warped
    data = elastic.element_data(mesh)
    way = np.random.default_rng(5).normal(size=u.shape)
    tangent = elastic.tangent(YEOH, data, u)
    h = 1e-6
    up, down = (elastic.energy_and_force(YEOH, data, u + sign * h * way)[1] for sign in (1, -1))
    slope = (up - down) / (2 * h)
    exact = np.einsum("eab,eb->ea", tangent, way.reshape(len(u), 81)).reshape(u.shape)
    assert np.abs(slope - exact).max() < 1e-7 * np.abs(exact).max()
    assert np.abs(tangent - tangent.transpose(0, 2, 1)).max() < 1e-14 * np.abs(tangent).max()


def test_a_turned_frame_changes_nothing(warped: tuple[HexMesh, np.ndarray]) -> None:
    mesh, u = warped
    data = elastic.element_data(mesh)
    turn, _ = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    points = mesh.points[mesh.cells]
    energy, force = elastic.energy_and_force(YEOH, data, u)
    turned_energy, turned_force = elastic.energy_and_force(YEOH, data, (points + u) @ turn.T - points)
    assert turned_energy == pytest.approx(energy, rel=1e-12)
    assert np.abs(turned_force - force @ turn.T).max() < 1e-11 * np.abs(force).max()


def test_inside_out_elements_cost_infinite_energy(warped: tuple[HexMesh, np.ndarray]) -> None:
    mesh, _ = warped
    points = mesh.points[mesh.cells]
    energy, _ = elastic.energy_and_force(YEOH, elastic.element_data(mesh), -2 * points)
    assert energy == math.inf


def test_patch_test_is_exact() -> None:
    assert verify_solid.patch_error() < 1e-10


def test_lame_sphere_converges_at_third_order_when_nearly_incompressible() -> None:
    errors = [verify_solid.lame_error(across, across, poisson=0.4999) for across in (2, 4, 6)]
    assert math.log(errors[1] / errors[2]) / math.log(6 / 4) == pytest.approx(3.0, abs=0.1)
    assert math.log2(errors[0] / errors[1]) > 2.7
    assert errors[2] < 3e-4


def test_inflated_sphere_meets_the_closed_form() -> None:
    pressure, exact = verify_solid.inflated_sphere(inner_stretch=1.3, across=2, layers=2)
    assert pressure == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("poisson", [0.3, 0.49, 0.4999])
def test_bending_does_not_lock(poisson: float) -> None:
    assert verify_solid.cantilever_ratio(poisson) == pytest.approx(1.0, abs=0.01)


def test_shell_volume_is_the_closed_form() -> None:
    geometry = shell_geometry(130, 8)
    whole = elastic.element_data(shell_mesh(geometry, DENSITIES["data"])).weight.sum()
    half = elastic.element_data(shell_mesh(geometry, DENSITIES["data"], half=True)).weight.sum()

    def endcap(radius: float) -> float:  # of the ball above the clamp plane
        height = geometry.centre_height_mm - geometry.clamp_height_mm + radius
        return math.pi * height**2 * (3 * radius - height) / 3

    assert whole == pytest.approx(endcap(65) - endcap(57), rel=1e-4)
    assert half == pytest.approx(whole / 2, rel=1e-12)


def test_yeoh_constants_meet_the_data_sheet() -> None:
    for entry in silicones().values():
        if entry.yeoh_mpa is None:
            continue
        c10, c20, c30 = entry.yeoh_mpa
        x = 4 + 1 / 2 * 2 - 3  # I1 - 3 of an incompressible bar at stretch 2
        stress = 2 * (2 - 1 / 4) * (c10 + 2 * c20 * x + 3 * c30 * x**2)
        assert stress == pytest.approx(entry.modulus_100_mpa, rel=0.01), entry.name


def test_bad_constants_and_geometry_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"poisson=0.5 outside 0..0.49999"):
        hyperelastic_law(0.34, 0.5)
    with pytest.raises(ParameterError, match=r"c10_mpa=-1 is not positive"):
        HyperelasticLaw(-1, 0, 0, 10)
    with pytest.raises(ParameterError, match="Yeoh stiffness vanish"):
        hyperelastic_law(0.34, 0.49, -0.4)
    with pytest.raises(ParameterError, match=r"silicone='Jelly' is not in"):
        silicone("Jelly")
    with pytest.raises(ParameterError, match=r"wall_mm=40 outside"):
        shell_geometry(130, 40)
    with pytest.raises(ParameterError, match=r"diameter_mm=20 below"):
        shell_geometry(20, 2)
    box = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    with pytest.raises(GeometryError, match="1 of 1 elements"):
        HexMesh(-box.points, box.cells, box.outer, box.inner)


def test_a_flattened_dome_takes_a_force_in_proportion_and_a_first_touch_that_of_hertz() -> None:
    """F = k d of Reissner's k; F = 4/3 E* sqrt(R) d^1.5, by hand for E* = 4 MPa, R = 64 mm, d = 1 mm: 128/3 N."""
    geometry, law = shell_geometry(130, 8), silicone().neo_hooke()
    force = closed_forms.flattening_force_n(geometry, law, 2.5)
    assert force == pytest.approx(2.5 * closed_forms.point_stiffness_n_mm(geometry, law))
    assert closed_forms.hertz_force_n(3.0, 0.5, 64.0, 1.0) == pytest.approx(128 / 3)


def test_lames_sphere_is_a_membrane_where_it_is_thin() -> None:
    """u = p R^2 (1 - nu) / (2 E t)."""
    thin = closed_forms.lame_displacement_mm(1e-3, 2.0, 0.49, 99.95, 100.05, 100.0)
    assert thin == pytest.approx(1e-3 * 100**2 * 0.51 / (2 * 2.0 * 0.1), rel=5e-3)
