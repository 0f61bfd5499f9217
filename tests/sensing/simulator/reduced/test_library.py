"""Level 4: fitted on a coarse mesh, judged on states of another path; ranges, fall-back, files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.press.state import Refusal
from sensing.simulator.reduced.library import fit as library_fit
from sensing.simulator.reduced.library.library import Library, lagrange_terms, polynomial_terms
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import dot_directions

GEOMETRY, LAW = shell_geometry(130, 8), silicone().neo_hooke()
TILT, FRICTION = 25.0, 0.9
RNG = np.random.default_rng(5)


@pytest.fixture(scope="module")
def exact() -> Simulator:
    return Simulator(GEOMETRY, LAW, "draft", level=2)


@pytest.fixture(scope="module")
def library(exact: Simulator) -> Library:
    return library_fit.fit(exact, library_fit.sample_tilt(exact, TILT, 34, 0, FRICTION), degree=3)


@pytest.fixture(scope="module")
def judge(exact: Simulator) -> list[library_fit.Sample]:
    return library_fit.sample_tilt(exact, TILT, 8, 77, FRICTION)


def errors(library: Library, judge: list[library_fit.Sample]) -> np.ndarray:
    """Relative error of the surface field of each state."""
    states = [sample.state for sample in judge]
    normal = np.array([s.normal_n for s in states])
    found = library.states(np.full(len(normal), TILT), normal, np.array([s.tangential_n for s in states]))
    fields = library.fields(found.weights)
    return np.array(
        [np.linalg.norm(f - s.surface_mm) / np.linalg.norm(s.surface_mm) for f, s in zip(fields, states, strict=True)]
    )


def claimed(library: Library, judge: list[library_fit.Sample]) -> np.ndarray:
    """Error estimate of each state."""
    normal = np.array([s.state.normal_n for s in judge])
    pull = np.array([s.state.tangential_n for s in judge])
    return library.states(np.full(len(normal), TILT), normal, pull).error_estimate


def test_unseen_states_are_met_and_a_planted_fault_is_seen(library: Library, judge: list[library_fit.Sample]) -> None:
    wrong = errors(library, judge)
    assert wrong.mean() < 0.05
    assert 0.5 < wrong.mean() / claimed(library, judge).mean() < 2  # the stated error is of the right size
    assert errors(replace(library, even=1.1 * library.even), judge).mean() > 0.09
    assert errors(replace(library, odd=-library.odd), judge).mean() > 0.1  # lateral forces the wrong way round


def test_wrench_follows_from_the_forces_asked_for(library: Library, judge: list[library_fit.Sample]) -> None:
    state = judge[3].state
    found = library.states([TILT], [state.normal_n], [state.tangential_n])
    assert np.allclose(found.wrench[0, :3], state.wrench[:3], atol=1e-6)
    assert np.abs(found.wrench[0, 3:] - state.wrench[3:]).max() < 0.05 * 65 * state.normal_n
    assert found.depth_mm[0] == pytest.approx(state.depth_mm, rel=0.1)


def test_the_mirror_image_is_the_mirrored_field(library: Library, exact: Simulator) -> None:
    one, other = (library.states([TILT], [20.0], [[3.0, side]]) for side in (4.0, -4.0))
    directions = dot_directions(GEOMETRY)
    here = exact.surface.sampler(directions).sample(library.fields(one.weights)[0])
    there = exact.surface.sampler(directions * [1, -1, 1]).sample(library.fields(other.weights)[0])
    assert np.abs(here - there * [1, -1, 1]).max() < 1e-9 * np.abs(here).max()
    assert one.wrench[0, 3] == pytest.approx(-other.wrench[0, 3])


@pytest.mark.parametrize("states", ["0", "20"])
def test_too_few_states_are_refused_before_the_solver_runs(states, tmp_path, monkeypatch, capsys) -> None:
    """20 states were solved at seven tilts, for minutes, and then refused; none ended in a traceback."""
    monkeypatch.setattr(library_fit, "sample_tilt", lambda *_: pytest.fail("the solver runs"))
    assert library_fit.main(["--out", str(tmp_path / "library.npz"), "--density", "draft", "--states", states]) == 2
    error = capsys.readouterr().err
    assert f"states={states} at a tilt under 51" in error and error.count("\n") == 1


def test_out_of_range_goes_to_level_2(library: Library) -> None:
    simulator = Simulator(GEOMETRY, LAW, "draft", level=4, library=library)
    scene = Scene(Indenter(TILT), FRICTION)
    inside, beyond = Target(10.0, tangential_n=(1.0, 0.0)), Target(45.0, tangential_n=(1.0, 0.0))
    assert [s.level for s in simulator.follow(scene, [inside])] == [4]
    found = list(simulator.follow(scene, [inside, beyond]))[-1]
    assert found.level in (1, 2) and found.certificate is not None
    assert not library.inside(np.array([TILT + 1, TILT]), np.full(2, 10.0), np.array([[0, 0], [9.0, 0]])).any()
    many = simulator.bulk(np.full(3, TILT), np.array([5.0, 10.0, 0.5]), np.zeros((3, 2)), FRICTION)
    assert many.level[:2].tolist() == [4, 4] and many.level[2] in (1, 2)
    assert np.isfinite(many.marker_mm).all() and many.error_estimate[0] > many.error_estimate[2]


def test_a_state_that_falls_back_is_pressed_in_steps_then_pulled(library: Library, exact: Simulator) -> None:
    """In one step to force and pull at once it was 1 % off, and its torque by 0.02 N m, which no certificate showed."""
    simulator = Simulator(GEOMETRY, LAW, "draft", level=4, library=library)
    found = simulator.bulk(np.array([TILT]), np.array([45.0]), np.array([[0.0, 10.0]]), 0.5)
    steps = [Target(force) for force in np.linspace(5.0, 45.0, 9).tolist()]
    *_, state = map(exact.walk(Scene(Indenter(TILT), 0.5)), [*steps, Target(45.0, tangential_n=(0.0, 10.0))])
    moved = exact.markers(state)
    assert found.level[0] in (1, 2)
    assert np.linalg.norm(found.marker_mm[0] - moved) < 2e-3 * np.linalg.norm(moved)


def test_an_estimate_over_the_limit_falls_back(library: Library) -> None:
    vague = replace(library, even_below=2 * library.even)
    simulator = Simulator(GEOMETRY, LAW, "draft", level=4, library=vague)
    state = next(iter(simulator.follow(Scene(Indenter(TILT), FRICTION), [Target(10.0, tangential_n=(1.0, 0.0))])))
    assert state.level in (1, 2)


def test_a_library_survives_its_file_and_others_are_refused(
    library: Library, exact: Simulator, judge: list[library_fit.Sample], tmp_path: Path
) -> None:
    path = tmp_path / "library.npz"
    library.save(path)
    again = Library.load(path)
    assert np.array_equal(again.even, library.even) and np.array_equal(again.modes, library.modes)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(FileError, match="not a library"):
        Library.load(path)
    with pytest.raises(ParameterError, match="library of the shell"):
        Simulator(shell_geometry(130, 9), LAW, "draft", level=4, library=library)
    with pytest.raises(ParameterError, match="library=None"):
        Simulator(GEOMETRY, LAW, "draft", level=4)
    with pytest.raises(ParameterError, match=r"states=3 at a tilt under"):
        library_fit.fit(exact, judge[:3])


def test_terms_are_the_polynomials_they_name() -> None:
    x = RNG.uniform(-1, 1, (7, 3))
    powers = np.array([[0, 0, 0], [3, 0, 2], [1, 4, 0]])
    exact = np.stack(
        [np.ones(7), np.cos(3 * np.arccos(x[:, 0])) * np.cos(2 * np.arccos(x[:, 2])),
         x[:, 0] * np.cos(4 * np.arccos(x[:, 1]))], axis=1)  # fmt: skip
    assert np.allclose(polynomial_terms(powers, x), exact)
    nodes = np.array([0.0, 1.0, 4.0])
    assert np.allclose(lagrange_terms(nodes, x[:, 0]) @ nodes**2, x[:, 0] ** 2)


def test_a_soft_shell_is_fitted_in_its_own_newtons(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def refused(target: Target) -> None:
        asked.append(target.normal_n or 0.0)
        raise Refusal("range", "asked only")

    soft = Simulator(GEOMETRY, silicone("Ecoflex 00-30").neo_hooke(), "draft", level=2)
    monkeypatch.setattr(soft, "walk", lambda *_, **__: refused)
    with pytest.raises(Refusal, match="only 0 of 8 states"):
        library_fit.sample_tilt(soft, TILT, 8, 0, FRICTION)
    assert min(asked) > 0.05 and max(asked) < 2.3  # its range ends at 2.0 N


def test_a_place_for_the_library_is_made_or_refused_before_minutes_are_spent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], library: Library
) -> None:
    monkeypatch.setattr(library_fit, "fit_library", lambda *_: library)
    assert library_fit.main(["--density", "draft", "--out", str(tmp_path / "build" / "library.npz")]) == 0
    monkeypatch.setattr(library_fit, "fit_library", lambda *_: pytest.fail("fitted, and nowhere to put it"))
    assert library_fit.main(["--density", "draft", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith(f"sensing.simulator.reduced.library.fit: {tmp_path}: ")
