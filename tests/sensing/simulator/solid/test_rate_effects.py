"""Prony series: relaxation against the closed form, slow and fast limits, order in the time step, level 2 against 1."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.materials import hyperelastic_law, silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.solid import elasticity as elastic
from sensing.simulator.solid import rate_effects as viscous
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.mesh import box_mesh
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler
from sensing.simulator.solid.system import Solid, build_solid

LAW = hyperelastic_law(0.34, 0.49, 0.05)
PRONY = ((0.2, 0.5), (0.1, 4.0))
SHEAR = np.array([[0.0, 0.3, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
UNIAXIAL = np.diag([1.2 - 1, 1.2**-0.5 - 1, 1.2**-0.5 - 1])
GEOMETRY = shell_geometry(130, 8)
SLIDE = [  # press, drag, back, hold: with friction, so that the path matters
    Target(normal_n=4.0, time_s=0.1),
    Target(normal_n=9.0, time_s=0.2),
    Target(normal_n=9.0, shift_mm=(0.8, 0.0), time_s=0.25),
    Target(normal_n=8.0, shift_mm=(0.2, 0.0), time_s=0.3),
    Target(normal_n=8.0, shift_mm=(0.2, 0.0), time_s=1.3),
]


@pytest.fixture(scope="module")
def cube() -> Solid:
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    fixed = np.zeros(mesh.points.shape, dtype=bool)
    fixed[:3] = True
    return build_solid(mesh, LAW, fixed)


@cache
def shell() -> ShellModel:
    return shell_model(GEOMETRY, silicone().neo_hooke(), "draft", half=True)


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


def pressed(solver: Press | FrozenPress, path: list[Target], began_s: float = 0.0) -> list[State]:
    state, found = replace(solver.start(), time_s=began_s), []
    for target in path:
        state = solver.advance(state, target)
        found.append(state)
    return found


def gap(found: State, exact: State) -> float:
    """Difference of the dots' displacements, relative, rms."""
    dots = surface_sampler(shell(), dot_directions(GEOMETRY))
    wrong, size = (dots.sample(field) for field in (found.displacement - exact.displacement, exact.displacement))
    return float(np.sqrt((wrong**2).mean() / (size**2).mean()))


def relaxed_share(time_s: float) -> float:
    """G(t) over the long-term modulus after a sudden strain, of PRONY."""
    return 1 + (0.2 * math.exp(-time_s / 0.5) + 0.1 * math.exp(-time_s / 4.0)) / 0.7


@pytest.mark.parametrize("gradient", [SHEAR, UNIAXIAL], ids=["shear", "uniaxial"])
def test_a_sudden_strain_relaxes_as_the_series_says(cube: Solid, gradient: np.ndarray) -> None:
    displacement = cube.mesh.points @ gradient.T
    slow = stress(cube, displacement)
    found = follow(cube, PRONY, [(gradient, 1e-9), (gradient, 0.3), (gradient, 0.7), (gradient, 9.0)])
    for time, now in zip((0.0, 0.3, 1.0, 10.0), found, strict=True):
        assert (
            np.abs(now - relaxed_share(time) * slow).max() < 1e-6 * np.abs(slow).max()
        )  # both strains keep the volume
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
    stressed = replace(cube, prestress=elastic.prestress(q + q.transpose(0, 1, 3, 2), cube.data))
    u, way, h = rng.normal(0, 0.03, cube.mesh.points.shape), rng.normal(size=cube.mesh.points.shape), 1e-6
    (up, force_up), (down, force_down) = (stressed.energy_and_force(u + s * h * way) for s in (1, -1))
    assert (up - down) / (2 * h) == pytest.approx(float((stressed.energy_and_force(u)[1] * way).sum()), rel=1e-7)
    nodes = cube.mesh.cells[0]
    exact = (stressed.tangent(u)[0] @ way[nodes].ravel()).reshape(27, 3)
    slope = ((force_up - force_down) / (2 * h))[nodes]
    assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()


def test_prestress_is_the_stress_that_it_says(cube: Solid) -> None:
    """F Q of a homogeneous strain, from the nodal forces."""
    q = np.array([[0.3, 0.1, 0.0], [0.1, -0.2, 0.05], [0.0, 0.05, 0.4]])
    stressed = replace(cube, prestress=elastic.prestress(np.broadcast_to(q, (1, 27, 3, 3)), cube.data))
    displacement = cube.mesh.points @ SHEAR.T
    found = stress(stressed, displacement) - stress(cube, displacement)
    assert np.abs(found - (np.eye(3) + SHEAR) @ q).max() < 1e-12
    exact = 0.5 * np.sum(((np.eye(3) + SHEAR).T @ (np.eye(3) + SHEAR) - np.eye(3)) * q)
    both = stressed.energy_and_force(displacement)[0] - cube.energy_and_force(displacement)[0]
    assert both == pytest.approx(exact, rel=1e-12)


@pytest.mark.long
def test_a_pressed_shell_relaxes_as_the_series_says() -> None:
    """A small press of a nearly incompressible shell on a hard plane: the force follows G(t)."""
    model = shell_model(GEOMETRY, hyperelastic_law(0.34, 0.4999), "draft", half=True, penalty_ratio=1000.0)
    held = [Target(depth_mm=0.3, time_s=time) for time in (1e-7, 0.2, 0.5, 1.0, 2.0, 6.0, 60.0)]
    slow = pressed(Press(model, Indenter(20.0), 0.0), held[:1])[0].normal_n
    press = Press(model, Indenter(20.0), 0.0, PRONY)
    for solver in (press, FrozenPress(press)):
        for state in pressed(solver, held):
            assert state.normal_n / slow == pytest.approx(relaxed_share(state.time_s), rel=2e-3)
            assert state.certificate is not None and state.certificate.wrench_gap < 2e-3


@pytest.mark.long
def test_a_slow_path_is_elastic_and_a_fast_one_has_the_instantaneous_modulus() -> None:
    scene, slow = (Indenter(20.0), 0.5), shell()
    law = slow.solid.law
    fast = replace(slow, solid=replace(slow.solid, law=replace(law, c10_mpa=law.c10_mpa / (1 - 0.3))))
    for step_s, model in ((1e6, slow), (1e-9, fast)):
        timed = [replace(target, time_s=k * step_s) for k, target in enumerate(SLIDE, 1)]
        exact = pressed(Press(model, *scene), SLIDE)
        for found, state in zip(pressed(Press(slow, *scene, PRONY), timed), exact, strict=True):
            assert gap(found, state) < 1e-6
            assert np.abs(found.wrench - state.wrench).max() < 1e-6 * 65 * 9


@pytest.mark.long
def test_level_2_meets_level_1_with_rate_effects() -> None:
    model = shell()
    press = Press(model, Indenter(20.0), 0.5, PRONY)
    fast = FrozenPress(press)
    elastic_states = pressed(Press(model, Indenter(20.0), 0.5), SLIDE)
    for found, exact, still in zip(pressed(fast, SLIDE), pressed(press, SLIDE), elastic_states, strict=True):
        assert gap(found, exact) < 1e-3 < 0.05 < gap(still, exact)
        assert np.abs(found.wrench[:3] - exact.wrench[:3]).max() < 1e-3 * np.linalg.norm(exact.wrench[:3])
        assert found.certificate is not None and found.certificate.wrench_gap < fast.tolerance
    assert fast.fast_steps >= 3  # otherwise this compared level 1 with itself


def test_a_released_shell_comes_back_slowly_and_remembers() -> None:
    press = Press(shell(), Indenter(20.0), 0.5, PRONY)
    clear = [Target(depth_mm=-1.0, time_s=time) for time in (1.1, 1.6, 60.0)]
    path = [Target(depth_mm=2.0, time_s=0.1), Target(depth_mm=2.0, time_s=1.0), *clear]
    states = pressed(press, path)
    sizes = [float(np.abs(state.displacement).max()) for state in states]
    assert 0.5 > sizes[2] > 1.5 * sizes[3] > 0.01 and sizes[4] < 1e-4
    assert all(state.normal_n == 0 for state in states[2:])
    again = Target(depth_mm=2.0, time_s=1.7)
    virgin = pressed(press, [again], began_s=1.6)[-1]
    assert press.advance(states[3], again).normal_n < 0.99 * virgin.normal_n


def test_what_is_no_series_or_has_no_time_is_refused() -> None:
    for bad in ((), ((0.5, 1.0), (0.6, 2.0)), ((0.1, 0.0),), ((-0.1, 1.0),)):
        with pytest.raises(ParameterError, match="is no series"):
            viscous.checked(bad)
    mesh = box_mesh((1, 1, 1), (1.0, 1.0, 1.0))
    solid = build_solid(mesh, LAW, np.zeros(mesh.points.shape, dtype=bool))
    with pytest.raises(ParameterError, match="dt_s=0 is not positive"):
        viscous.step_solid(solid, viscous.rest(solid, PRONY), PRONY, 0.0)
    press = Press(shell(), Indenter(20.0), 0.5, PRONY)
    for solver in (press, FrozenPress(press)):
        with pytest.raises(Refusal, match=r"^path: .* has no time_s"):
            solver.advance(solver.start(), Target(depth_mm=1.0))
        with pytest.raises(Refusal, match=r"^path: time_s=0 is not after the last state, at 0 s"):
            solver.advance(solver.start(), Target(depth_mm=1.0, time_s=0.0))
    for level in (3, 4):
        with pytest.raises(ParameterError, match=f"level={level} has no rate effects: choose 1 or 2"):
            Simulator(GEOMETRY, LAW, "draft", level=level, prony=PRONY)
