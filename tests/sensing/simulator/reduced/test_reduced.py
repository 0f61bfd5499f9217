"""Level 3: cubature, tangent, judged against level 2 on a path it was not trained on, and its fall-backs."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.state import Refusal, State
from sensing.simulator.reduced import press as reduced_press
from sensing.simulator.reduced.basis import ReducedModel, sparse_weights, training_states
from sensing.simulator.reduced.press import ReducedPress, trained
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell import ShellModel, shell_model

GEOMETRY, LAW = shell_geometry(130, 8), silicone().neo_hooke()
TILTED = Indenter(tilt_deg=30)
PATH = [Target(normal_n=n) for n in (6.0, 12.0, 20.0)] + [
    Target(normal_n=20.0, shift_mm=(shift, 0.0)) for shift in (0.7, 1.5, 0.2)
]


@pytest.fixture(scope="module")
def shell() -> ShellModel:
    return shell_model(GEOMETRY, LAW, "draft", half=True)


@pytest.fixture(scope="module")
def reduced(shell: ShellModel) -> Iterator[ReducedModel]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reduced_press, "JUDGES", 7)
        yield trained(shell, TILTED, states=26, modes=20)


@pytest.fixture(scope="module")
def fast(shell: ShellModel) -> FrozenPress:
    return FrozenPress(Press(shell, TILTED, 0.4))


def gap(state: State, other: State) -> float:
    """Relative rms difference of two displacements."""
    wrong = state.displacement - other.displacement
    return float(np.sqrt((wrong**2).mean() / (other.displacement**2).mean()))


def follow(press: FrozenPress | ReducedPress) -> list[State]:
    """States along the path."""
    state, found = press.start(), []
    for target in PATH:
        state = press.advance(state, target)
        found.append(state)
    return found


def test_few_weights_replace_a_planted_sum() -> None:
    rng = np.random.default_rng(0)
    table = rng.normal(size=(80, 40))
    planted = np.zeros(40)
    planted[[3, 11, 29]] = (2.0, 0.5, 7.0)
    chosen, weights = sparse_weights(table, table @ planted, 1e-9)
    assert chosen.tolist() == [3, 11, 29] and np.allclose(weights, planted[chosen])
    chosen, weights = sparse_weights(table, -table @ planted, 1e-9)  # no non-negative sum is near: still none below 0
    assert (weights > 0).all()


def test_few_elements_stand_for_all(shell: ShellModel, reduced: ReducedModel, fast: FrozenPress) -> None:
    assert len(reduced.cells) < 0.6 * len(shell.solid.mesh.cells)
    assert np.allclose(reduced.modes.T @ reduced.modes, np.eye(20), atol=1e-10)
    weights = reduced.modes.T @ shell.solid.gather(follow(fast)[-2].displacement)
    field = shell.solid.spread(reduced.modes @ weights)
    exact = reduced.modes.T @ shell.solid.gather(shell.solid.energy_and_force(field)[1])
    assert np.linalg.norm(reduced.internal(LAW, weights) - exact) < 0.02 * np.linalg.norm(exact)
    way = np.random.default_rng(1).normal(size=20)
    up, down = (reduced.internal(LAW, weights + h * way) for h in (1e-5, -1e-5))
    slope = reduced.stiffness(LAW, weights) @ way
    assert np.linalg.norm((up - down) / 2e-5 - slope) < 1e-6 * np.linalg.norm(slope)


def test_interpolated_tangent_is_near_the_assembled_one(
    shell: ShellModel, reduced: ReducedModel, fast: FrozenPress
) -> None:
    tangents = reduced.tangents
    for place in tangents.places[::7]:
        exact = reduced.stiffness(LAW, place)
        assert np.linalg.norm(tangents.at(place) - exact) < 1e-3 * np.linalg.norm(exact)
    for state in follow(fast)[1:]:  # not a training state: in the measure of the tangent itself, soft modes count
        weights = reduced.modes.T @ shell.solid.gather(state.displacement)
        root = np.linalg.inv(np.linalg.cholesky(reduced.stiffness(LAW, weights)))
        missed, crude = (
            np.linalg.norm(root @ k @ root.T - np.eye(20), 2) for k in (tangents.at(weights), tangents.mean)
        )
        assert missed < 0.5 and missed < 0.5 * crude


def test_the_tangent_steers_and_does_not_decide(fast: FrozenPress, reduced: ReducedModel) -> None:
    mean_only = replace(reduced.tangents, parts=np.zeros_like(reduced.tangents.parts))
    plain = ReducedPress(fast, replace(reduced, estimate_factor=0.0))
    crude = ReducedPress(fast, replace(reduced, estimate_factor=0.0, tangents=mean_only))
    found, other = follow(plain), follow(crude)
    assert crude.fast_steps == plain.fast_steps >= 4
    assert max(gap(a, b) for a, b in zip(other, found, strict=True)) < 2e-3
    spent, more = (sum(s.certificate.iterations for s in way if s.certificate) for way in (found, other))
    assert spent < more


def test_a_kink_that_no_search_gets_over_is_leapt(
    fast: FrozenPress, reduced: ReducedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = replace(reduced, estimate_factor=0.0)
    plain = ReducedPress(fast, own)
    found = follow(plain)
    searched = reduced_press._Step._searched
    monkeypatch.setattr(
        reduced_press._Step, "_searched", lambda self, here: searched(self, here) if self.spent > 2 else None
    )
    leaping = ReducedPress(fast, own)
    assert max(gap(a, b) for a, b in zip(follow(leaping), found, strict=True)) < 2e-3
    assert leaping.fast_steps == plain.fast_steps
    monkeypatch.setattr(reduced_press, "MAX_LEAPS", 0)
    stuck = ReducedPress(fast, own)
    follow(stuck)
    assert stuck.fast_steps == 0


def test_level_3_meets_level_2_on_a_path_it_has_not_seen(fast: FrozenPress, reduced: ReducedModel) -> None:
    level_3 = ReducedPress(fast, replace(reduced, estimate_factor=0.0))
    exact, found = follow(fast), follow(level_3)
    assert level_3.fast_steps >= 4  # otherwise this compared level 2 with itself
    assert max(gap(a, b) for a, b in zip(found, exact, strict=True)) < 0.02
    forces = [np.abs(a.wrench[:3] - b.wrench[:3]).max() / b.normal_n for a, b in zip(found, exact, strict=True)]
    assert max(forces) < 0.03


def test_what_level_3_cannot_be_trusted_with_goes_to_level_2(fast: FrozenPress, reduced: ReducedModel) -> None:
    exact = follow(fast)
    plain = ReducedPress(fast, replace(reduced, estimate_factor=1.0))
    follow(plain)
    tangents = replace(reduced.tangents, mean=0.7 * reduced.tangents.mean, parts=0.7 * reduced.tangents.parts)
    softened = replace(reduced, estimate_factor=1.0, weights=0.7 * reduced.weights, tangents=tangents)
    strict = ReducedPress(fast, softened)
    found = follow(strict)  # a wrong cubature: the residual on the full mesh gives it away
    assert strict.fast_steps == 0 < plain.fast_steps
    assert max(gap(a, b) for a, b in zip(found, exact, strict=True)) < 2e-3
    others = np.setdiff1d(np.arange(len(reduced.faces) * 2), reduced.faces)[: len(reduced.faces)]
    narrow = ReducedPress(fast, replace(reduced, estimate_factor=0.0, faces=others))
    state = narrow.advance(narrow.start(), PATH[0])
    assert narrow.attempt(state, PATH[1]) is None  # contact on faces that training is said never to have touched


def test_the_facade_trains_once_and_says_who_answered(reduced: ReducedModel, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def known(_: ShellModel, indenter: Indenter) -> ReducedModel:
        calls.append(indenter)
        return reduced

    monkeypatch.setattr("sensing.simulator.levels.trained", known)
    simulator = Simulator(GEOMETRY, LAW, "draft", level=3)
    scene = Scene(TILTED, 0.4)
    found = list(simulator.follow(scene, PATH))
    simulator.forget()
    again = list(simulator.follow(scene, PATH))
    assert len(calls) == 1 and 0 < reduced.estimate_factor < 5
    assert {3} <= {state.level for state in found} <= {1, 2, 3}
    assert all(0 < s.error_estimate < reduced_press.LIMIT for s in found if s.level == 3)
    assert np.allclose(found[-1].surface_mm, again[-1].surface_mm, atol=1e-12)
    ball = list(simulator.follow(Scene(Indenter(20.0, "sphere", 30.0), 0.4), [Target(depth_mm=1.0)]))
    assert ball[0].level in (1, 2) and len(calls) == 1


def test_a_shell_that_cannot_be_trained_is_left_to_level_2(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object) -> ReducedModel:
        raise Refusal("unconverged", "planted")

    monkeypatch.setattr("sensing.simulator.levels.trained", refused)
    simulator = Simulator(GEOMETRY, LAW, "draft", level=3)
    assert [s.level for s in simulator.follow(Scene(TILTED, 0.4), PATH[:2])] == [1, 2]


def test_training_goes_as_far_as_the_shell_bears(monkeypatch: pytest.MonkeyPatch) -> None:
    """38 N are of D=130 T=8 in Smooth-Sil 950: a soft shell is crushed by them, a thick one hardly pressed."""
    asked = {}
    for name, design, material in (("soft", (130, 8), "Ecoflex 00-30"), ("thick", (243, 21), "Smooth-Sil 950")):
        law = silicone(material).neo_hooke()
        press = FrozenPress(Press(shell_model(shell_geometry(*design), law, "draft", half=True), TILTED, 1.0))
        targets: list[Target] = []
        monkeypatch.setattr(press, "advance", lambda state, target, targets=targets: targets.append(target) or state)
        training_states(press, 40)
        asked[name] = max(target.normal_n or 0.0 for target in targets)
    assert 1.5 < asked["soft"] < 2.3 and 180 < asked["thick"] < 270  # the ranges of their weights are 2.0 and 241 N
