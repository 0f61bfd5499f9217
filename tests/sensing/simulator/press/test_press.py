"""Pressing the shell: equilibrium, friction, symmetry, refusals. Small meshes; accuracy is the report's matter."""

from dataclasses import replace

import numpy as np
import pytest

from cad.dots import dot_pattern, dot_position_mm
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.simulator.contact.friction import deepest_mm, free_memory
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press import newton
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import Refusal, State, contact_patch
from sensing.simulator.press.validity import has_passed, require_measured, require_outside
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import ShellGeometry, shell_geometry
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler, turn_about_axis, turn_wrench

GEOMETRY = ShellGeometry.from_params(EndcapParams(130, 8))
LAW = silicone().neo_hooke()


@pytest.fixture(scope="module")
def half() -> ShellModel:
    return shell_model(GEOMETRY, LAW, "draft", half=True)


@pytest.fixture(scope="module")
def whole() -> ShellModel:
    return shell_model(GEOMETRY, LAW, "draft")


@pytest.fixture(scope="module")
def finer() -> ShellModel:
    return shell_model(GEOMETRY, LAW, "data", half=True)


@pytest.fixture(scope="module")
def tilted(finer: ShellModel) -> tuple[Press, State]:
    press = Press(finer, Indenter(tilt_deg=30), 0.5)
    state = press.start()
    for force in (5.0, 20.0):
        state = press.advance(state, Target(normal_n=force))
    return press, state


def test_wrench_from_tractions_is_the_clamps(tilted: tuple[Press, State]) -> None:
    _, state = tilted
    load = np.linalg.norm(state.wrench[:3])
    assert np.abs(state.wrench[:3] - state.reaction[:3]).max() < 1e-6 * load
    assert np.abs(state.wrench[3:] - state.reaction[3:]).max() < 1e-6 * load * GEOMETRY.outer_radius_mm
    assert state.normal_n == pytest.approx(20.0, rel=1e-8)


def test_friction_stays_in_its_cone_and_pressure_does_not_pull(tilted: tuple[Press, State]) -> None:
    press, state = tilted
    patch = contact_patch(press.model, state)
    assert patch.pressure.min() > 0
    assert (np.linalg.norm(patch.traction, axis=1) <= 0.5 * patch.pressure * (1 + 1e-9)).all()
    assert 0 < patch.slip_share < 1  # partly stick, partly slip
    assert state.certificate is not None and state.certificate.penetration_mm < 0.01 * state.depth_mm


@pytest.mark.parametrize("kind", ["plane", "sphere", "edge"])
def test_how_deep_a_body_reaches_into_the_undeformed_dome_is_its_depth(half: ShellModel, kind: str) -> None:
    """Whatever its radius, and though no Gauss point lies at the place of first touch."""
    indenter = Indenter(tilt_deg=30, kind=kind, radius_mm=1.0)
    translation = indenter.frame() @ np.array([-0.3, 0.0, 0.0])
    reach = deepest_mm(half.surface, indenter.body(half.geometry), half.solid.mesh.points, translation)
    assert reach == pytest.approx(0.3, abs=0.02)  # the mesh follows the sphere to 0.01 mm
    measured = free_memory(half.surface, half.solid.mesh.points - translation, indenter.body(half.geometry))
    assert kind == "plane" or measured.gap.min() > 0  # the points alone would have said: no contact


def test_a_sphere_that_comes_deeper_than_its_radius_in_one_step_presses_as_in_many(half: ShellModel) -> None:
    """It once stood beyond the surface, with a residual of zero and no force."""
    press = Press(half, Indenter(30, "sphere", 8.0), 0.5)
    once = press.advance(press.start(), Target(depth_mm=17.0))
    many = press.start()
    for depth in np.linspace(1, 17, 9):
        many = press.advance(many, Target(depth_mm=float(depth)))
    assert many.normal_n > 20 and once.normal_n == pytest.approx(many.normal_n, rel=0.01)
    assert not has_passed(half, once)


@pytest.mark.parametrize("kind", ["sphere", "edge"])
def test_a_body_beyond_the_surface_is_seen(half: ShellModel, kind: str) -> None:
    """Placed there by hand: between the surfaces or inside of both, with or without contact."""
    indenter = Indenter(30, kind, 8.0)
    press, still = Press(half, indenter, 0.0), np.zeros_like(half.solid.mesh.points)
    for depth_mm, passed in ((-3.0, False), (1.0, False), (6.0, False), (10.0, True), (15.0, True), (20.0, True)):
        contact = press.problem(press.start(), Target(depth_mm=depth_mm)).contact(still, depth_mm, None, None)
        state = replace(press.start(), contact=contact, depth_mm=depth_mm)
        assert has_passed(half, state) is passed, depth_mm
    with pytest.raises(Refusal, match="mesh: the body has passed"):
        require_outside(half, state)


def test_a_small_sphere_under_a_force_is_refused_for_the_mesh_not_for_a_snap(half: ShellModel) -> None:
    press = Press(half, Indenter(30, "sphere", 2.0), 0.5)
    with pytest.raises(Refusal, match="mesh: the sphere reaches"):
        press.advance(press.start(), Target(normal_n=1.0))


def test_a_small_body_may_miss_a_part_of_its_radius_however_deep_it_is() -> None:
    for depth, missed in ((20.0, 0.74), (1.0, 0.14), (0.1, 0.09)):
        require_measured(Indenter(30, "sphere", 5.0), depth, missed)
        with pytest.raises(Refusal, match="mesh"):
            require_measured(Indenter(30, "sphere", 5.0), depth, missed + 0.02)
    with pytest.raises(
        Refusal, match=r"the plane reaches 0\.11 .*: the mesh is too coarse there; take a finer density, or"
    ):
        require_measured(Indenter(30), 0.2, 0.11)  # it has no radius to enlarge


@pytest.mark.parametrize("level", [1, 2])
def test_a_body_on_the_clamped_rim_is_refused(level: int) -> None:
    """There the clamp takes load that its reactions do not show."""
    simulator = Simulator(shell_geometry(99, 6.5), LAW, "draft", level=level)
    with pytest.raises(Refusal, match=r"range: .* of the force acts on the clamped rim .* take a smaller tilt"):
        list(simulator.follow(Scene(Indenter(tilt_deg=95), friction=0.5), [Target(normal_n=5.0)]))


@pytest.mark.parametrize("level", [1, 2])
def test_a_body_too_small_for_the_mesh_is_refused(level: int) -> None:
    simulator = Simulator(GEOMETRY, LAW, "draft", level=level)
    scene = Scene(Indenter(30, "edge", 1.0), friction=0.5)
    with pytest.raises(Refusal, match=r"mesh: the edge reaches .* take a finer density"):
        list(simulator.follow(scene, [Target(depth_mm=0.5)]))


def test_whole_and_half_model_agree(whole: ShellModel, half: ShellModel) -> None:
    press = Press(half, Indenter(tilt_deg=30), 0.5)
    of_half = press.advance(press.start(), Target(normal_n=10.0))
    press = Press(whole, Indenter(tilt_deg=30), 0.5)
    state = press.advance(press.start(), Target(normal_n=10.0))
    dots = dot_directions(GEOMETRY)
    one = surface_sampler(half, dots).sample(of_half.displacement)
    other = surface_sampler(whole, dots).sample(state.displacement)
    assert np.abs(one - other).max() < 2e-3 * np.abs(one).max()
    assert np.abs(of_half.wrench - state.wrench).max() < 2e-3 * np.abs(of_half.wrench).max()


def test_an_axial_press_is_symmetric(whole: ShellModel) -> None:
    press = Press(whole, Indenter(), 0.3)
    state = press.advance(press.start(), Target(depth_mm=2.0))
    lateral = np.delete(state.wrench, 2)
    assert np.abs(lateral[:2]).max() < 1e-6 * abs(state.wrench[2])
    dots = dot_directions(GEOMETRY)
    still = surface_sampler(whole, dots).sample(state.displacement)
    turned = surface_sampler(whole, dots, azimuth_deg=90).sample(state.displacement)
    assert np.abs(still - turned).max() < 1e-5 * np.abs(still).max()  # the mesh has fourfold symmetry


def test_an_azimuth_turns_the_result(tilted: tuple[Press, State], finer: ShellModel) -> None:
    _, state = tilted
    turn = turn_about_axis(37.0)
    dots = dot_directions(GEOMETRY)
    still = surface_sampler(finer, dots).sample(state.displacement)
    turned = surface_sampler(finer, dots @ turn.T, azimuth_deg=37.0).sample(state.displacement)
    assert np.abs(turned - still @ turn.T).max() < 1e-9
    assert np.allclose(turn_wrench(state.wrench, 37.0)[3:], turn @ state.wrench[3:])


def test_sampler_finds_the_dots_and_reproduces_positions(whole: ShellModel) -> None:
    params = EndcapParams(130, 8)
    exact = np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)])
    found = surface_sampler(whole, dot_directions(GEOMETRY)).sample(whole.solid.mesh.points)
    assert np.abs(found - exact).max() < 0.02  # the biquadratic sphere of the coarsest mesh


def test_unloading_returns_to_zero(half: ShellModel) -> None:
    press = Press(half, Indenter(tilt_deg=20), 0.6)
    state = press.advance(press.start(), Target(normal_n=10.0))
    state = press.advance(state, Target(normal_n=0.0))
    assert np.abs(state.displacement).max() < 1e-9
    assert np.abs(state.wrench).max() == 0


def test_a_closed_cycle_costs_work_with_friction_only(half: ShellModel) -> None:
    def work(friction: float) -> float:
        press = Press(half, Indenter(tilt_deg=20), friction)
        here = press.advance(press.start(), Target(depth_mm=1.5))
        total = 0.0
        for count, shift in enumerate((1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0, 0.5, 1.0)):
            there = press.advance(here, Target(depth_mm=1.5, shift_mm=(shift, 0.0)))
            force = (here.wrench[:3] + there.wrench[:3]) / 2
            if count > 0:  # the cycle proper starts and ends at shift 1
                total += float(force @ press.frame[:, 1]) * (there.shift_mm[0] - here.shift_mm[0])
            here = there
        return total

    assert work(0.3) > 0.05
    assert abs(work(0.0)) < 0.02 * work(0.3)


def test_newton_is_quadratic_at_the_end(half: ShellModel) -> None:
    press = Press(half, Indenter(tilt_deg=30), 0.4)
    state = press.advance(press.start(), Target(normal_n=8.0))
    target = Target(normal_n=9.0)
    displacement, depth = press.first_guess(state, target)
    errors = newton.solve(press.problem(state, target), displacement, depth).errors
    before, after = errors[-2], errors[-1]
    assert after < 1e-9
    assert after < max(100 * before**2, 1e-11)


def test_tangent_and_border_are_the_slope_of_the_residual(whole: ShellModel) -> None:
    press = Press(whole, Indenter(tilt_deg=30), 0.4)
    state = press.advance(press.start(), Target(normal_n=8.0))
    problem = replace(press.problem(state, Target(normal_n=9.0)), shift_mm=(0.02, 0.01))
    way = np.random.default_rng(0).normal(size=state.displacement.shape)
    way[whole.solid.fixed.reshape(-1, 3)] = 0
    h, depth = 1e-7, state.depth_mm + 0.05
    middle = newton.evaluate(problem, state.displacement, depth)
    column, row, kappa = newton.border(problem, middle.contact)
    tangent = whole.solid.assemble(newton.tangent(problem, state.displacement, middle.contact))
    up = newton.evaluate(problem, state.displacement + h * way, depth + h)
    down = newton.evaluate(problem, state.displacement - h * way, depth - h)
    slope = (up.residual - down.residual) / (2 * h)
    free = whole.solid.gather(way)
    assert np.abs(slope - (tangent @ free + column)).max() < 1e-6 * np.abs(slope).max()
    assert (up.force_gap - down.force_gap) / (2 * h) == pytest.approx(float(row @ free) + kappa, rel=1e-5)


def test_the_step_size_hardly_matters(half: ShellModel) -> None:
    press = Press(half, Indenter(tilt_deg=30), 0.5)
    once = press.advance(press.start(), Target(normal_n=10.0))
    often = press.start()
    for force in np.linspace(1, 10, 10):
        often = press.advance(often, Target(normal_n=float(force)))
    dots = surface_sampler(half, dot_directions(GEOMETRY))
    one, many = dots.sample(once.displacement), dots.sample(often.displacement)
    assert np.sqrt(((one - many) ** 2).mean()) < 0.02 * np.sqrt((many**2).mean())


@pytest.mark.parametrize("kind", ["sphere", "edge"])
def test_curved_bodies_press_too(half: ShellModel, kind: str) -> None:
    press = Press(half, Indenter(tilt_deg=20, kind=kind, radius_mm=30), 0.3)
    state = press.advance(press.start(), Target(normal_n=6.0))
    assert state.normal_n == pytest.approx(6.0, rel=1e-8)
    assert state.certificate is not None and state.certificate.wrench_gap < 1e-6
    plane = Press(half, Indenter(tilt_deg=20), 0.3)
    assert state.depth_mm > plane.advance(plane.start(), Target(normal_n=6.0)).depth_mm  # it dents deeper


def test_what_the_model_does_not_cover_is_refused(half: ShellModel) -> None:
    press = Press(half, Indenter(tilt_deg=10), 0.5)
    start = press.start()
    with pytest.raises(Refusal, match=r"^path: shift_mm=\(0.0, 1.0\) leaves the mirror plane"):
        press.advance(start, Target(normal_n=5, shift_mm=(0.0, 1.0)))
    with pytest.raises(Refusal, match=r"^range: normal_n=-1 pulls"):
        press.advance(start, Target(normal_n=-1))
    with pytest.raises(Refusal, match=r"^range: depth_mm=50 over 39"):
        press.advance(start, Target(depth_mm=50))
    with pytest.raises(Refusal, match=r"^path: .* exactly one"):
        press.advance(start, Target())
    with pytest.raises(Refusal, match=r"^range: friction=9 outside 0..5"):
        Press(half, Indenter(), 9.0)
    with pytest.raises(Refusal, match=r"^path: axis_deg=45 breaks the mirror"):
        Press(half, Indenter(kind="edge", axis_deg=45), 0.5)


@pytest.mark.long
def test_a_thin_shell_that_snaps_under_force_is_refused_not_answered() -> None:
    thin = shell_model(shell_geometry(130, 3), LAW, "draft", half=True)
    press = Press(thin, Indenter(), 0.0)
    state = press.start()
    with pytest.raises(Refusal, match=r"^(unstable|unconverged)"):
        for force in range(1, 30):
            state = press.advance(state, Target(normal_n=float(force)))


def test_a_singular_tangent_halves_the_step_and_is_refused_by_name_at_last(
    half: ShellModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A state of a data set (a far first guess, elements turned over) ended its process before."""
    press = Press(half, Indenter(20.0), 0.5)
    real, calls = newton.factorise, []

    def singular_at_first(*arguments: object, **named: object) -> object:
        calls.append(1)
        if len(calls) == 1:
            raise np.linalg.LinAlgError("tangent cannot be factorised")
        return real(*arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(newton, "factorise", singular_at_first)
    state = press.advance(press.start(), Target(depth_mm=0.5))
    assert state.certificate is not None and state.certificate.substeps == 2
    monkeypatch.setattr(newton, "factorise", lambda *_, **__: singular())
    with pytest.raises(Refusal, match=r"^unconverged: tangent cannot be factorised at depth"):
        press.advance(press.start(), Target(depth_mm=0.5))


def singular() -> None:
    raise np.linalg.LinAlgError("tangent cannot be factorised")
