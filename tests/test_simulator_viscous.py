"""Prony series: relaxation against the closed form, slow and fast limits, second order in the time step."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.materials import hyperelastic_law, silicone
from sensing.simulator import viscous
from sensing.simulator.geometry import shell_geometry
from sensing.simulator.indenter import Indenter
from sensing.simulator.mesh import box_mesh
from sensing.simulator.press import Press, Target
from sensing.simulator.shell import shell_model
from sensing.simulator.system import Solid, build_solid

LAW = hyperelastic_law(0.34, 0.49, 0.05)
PRONY = ((0.2, 0.5), (0.1, 4.0))
SHEAR = np.array([[0.0, 0.3, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
UNIAXIAL = np.diag([1.2 - 1, 1.2**-0.5 - 1, 1.2**-0.5 - 1])


@pytest.fixture(scope="module")
def cube() -> Solid:
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    fixed = np.zeros(mesh.points.shape, dtype=bool)
    fixed[:3] = True
    return build_solid(mesh, LAW, fixed)


def stress(solid: Solid, displacement: np.ndarray) -> np.ndarray:
    """First Piola-Kirchhoff stress (3, 3) of a homogeneous state, from the nodal forces on the cube."""
    _, force = solid.energy_and_force(displacement)
    return force.T @ solid.mesh.points


def follow(solid: Solid, prony: viscous.Prony, path: list[tuple[np.ndarray, float]]) -> list[np.ndarray]:
    """Stress at the end of each step of a strain history ``(displacement gradient, dt)``."""
    history, found = viscous.rest(solid, prony), []
    for gradient, dt in path:
        displacement = solid.mesh.points @ gradient.T
        found.append(stress(viscous.step_solid(solid, history, prony, dt), displacement))
        history = viscous.remember(solid, history, prony, dt, displacement)
    return found


@pytest.mark.parametrize("gradient", [SHEAR, UNIAXIAL], ids=["shear", "uniaxial"])
def test_a_sudden_strain_relaxes_as_the_series_says(cube: Solid, gradient: np.ndarray) -> None:
    displacement = cube.mesh.points @ gradient.T
    slow = stress(cube, displacement)
    found = follow(cube, PRONY, [(gradient, 1e-9), (gradient, 0.3), (gradient, 0.7), (gradient, 9.0)])
    for time, now in zip((0.0, 0.3, 1.0, 10.0), found, strict=True):
        share = 1 + (0.2 * math.exp(-time / 0.5) + 0.1 * math.exp(-time / 4.0)) / 0.7
        assert viscous.relaxed_share(PRONY, time) == pytest.approx(share, rel=1e-12)
        assert np.abs(now - share * slow).max() < 1e-6 * np.abs(slow).max()  # both strains keep the volume
    wrong = follow(cube, ((0.2, 1.0), (0.1, 4.0)), [(gradient, 1e-9), (gradient, 0.3)])[-1]
    assert np.abs(wrong - found[1]).max() > 0.02 * np.abs(slow).max()  # another time constant is noticed


def test_a_ramp_converges_at_second_order(cube: Solid) -> None:
    time, strain = 2.0, 1e-4
    shear = LAW.shear_mpa * strain
    exact = shear + sum(g / 0.7 * shear * tau / time * (1 - math.exp(-time / tau)) for g, tau in PRONY)
    errors = []
    for steps in (4, 8, 16):
        path = [(SHEAR / 0.3 * strain * k / steps, time / steps) for k in range(1, steps + 1)]
        errors.append(abs(follow(cube, PRONY, path)[-1][0, 1] / exact - 1))
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_prestress_force_and_tangent_are_slopes(cube: Solid) -> None:
    rng = np.random.default_rng(1)
    q = rng.normal(0, 0.1, (1, 27, 3, 3))
    stressed = replace(cube, prestress=q + q.transpose(0, 1, 3, 2))
    u, way, h = rng.normal(0, 0.03, cube.mesh.points.shape), rng.normal(size=cube.mesh.points.shape), 1e-6
    (up, force_up), (down, force_down) = (stressed.energy_and_force(u + s * h * way) for s in (1, -1))
    assert (up - down) / (2 * h) == pytest.approx(float((stressed.energy_and_force(u)[1] * way).sum()), rel=1e-7)
    nodes = cube.mesh.cells[0]
    exact = (stressed.tangent(u)[0] @ way[nodes].ravel()).reshape(27, 3)
    slope = ((force_up - force_down) / (2 * h))[nodes]
    assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()


def test_a_pressed_shell_relaxes_between_fast_and_slow() -> None:
    table = silicone()
    model = shell_model(shell_geometry(130, 8), table.neo_hooke(), "draft", half=True)
    press = Press(model, Indenter(20.0), 0.4)
    slow = press.advance(press.start(), Target(depth_mm=2.0)).normal_n
    soft = viscous.ViscousPress(press, table.prony)
    state = soft.advance(soft.start(), Target(depth_mm=2.0), 1e-6)
    fast = state.normal_n
    later = soft.advance(state, Target(depth_mm=2.0), 0.2).normal_n
    end = soft.advance(soft.advance(state, Target(depth_mm=2.0), 3.0), Target(depth_mm=2.0), 60.0)
    assert fast / slow == pytest.approx(viscous.relaxed_share(table.prony, 0.0), rel=0.02)
    assert slow < later < fast
    assert end.normal_n == pytest.approx(slow, rel=5e-3)
    assert end.certificate is not None and end.certificate.wrench_gap < 1e-6


def test_what_is_no_series_is_refused() -> None:
    for bad in ((), ((0.5, 1.0), (0.6, 2.0)), ((0.1, 0.0),), ((-0.1, 1.0),)):
        with pytest.raises(ParameterError, match="is no series"):
            viscous.checked(bad)
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    solid = build_solid(mesh, LAW, np.zeros(mesh.points.shape, dtype=bool))
    with pytest.raises(ParameterError, match="dt_s=0 is not positive"):
        viscous.step_solid(solid, viscous.rest(solid, PRONY), PRONY, 0.0)
