"""Level 2 against level 1 on the same mesh, and its fall-back."""

from typing import Any

import numpy as np
import pytest

from cad.materials import silicone
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.press import condensed
from sensing.simulator.press.frozen import FrozenPress
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.secant import SecantInverse
from sensing.simulator.press.state import Refusal
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell import shell_model
from sensing.simulator.solid.surface import dot_directions, surface_sampler

PATH = [Target(normal_n=n) for n in (4.0, 8.0, 10.0)] + [
    Target(normal_n=10.0, shift_mm=shift) for shift in ((0.5, 0.0), (1.0, 0.0), (0.4, 0.0))
]


@pytest.fixture(scope="module")
def press() -> Press:
    model = shell_model(shell_geometry(130, 8), silicone().neo_hooke(), "draft", half=True)
    return Press(model, Indenter(tilt_deg=30), 0.5)


def test_level_2_meets_newton_along_a_path_with_friction(press: Press) -> None:
    fast = FrozenPress(press)
    here, there = fast.start(), press.start()
    dots = surface_sampler(press.model, dot_directions(press.model.geometry))
    for target in PATH:
        here, there = fast.advance(here, target), press.advance(there, target)
        wrong = dots.sample(here.displacement - there.displacement)
        assert np.sqrt((wrong**2).mean()) < 1e-3 * np.sqrt((dots.sample(there.displacement) ** 2).mean())
        assert np.abs(here.wrench[:3] - there.wrench[:3]).max() < 1e-3 * np.linalg.norm(there.wrench[:3])
        assert here.certificate is not None and here.certificate.wrench_gap < fast.tolerance
    assert fast.fast_steps >= 4  # otherwise this compared level 1 with itself


def test_a_step_that_level_2_cannot_do_goes_to_level_1(press: Press, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        return None

    fast = FrozenPress(press)
    state = fast.advance(fast.start(), PATH[0])
    monkeypatch.setattr(condensed.CondensedStep, "solve", fail)
    state = fast.advance(state, PATH[1])
    assert fast.fallbacks == 2 and fast.fast_steps == 0
    assert state.certificate is not None and state.certificate.residual < 1e-9


def test_contact_outside_the_patch_is_noticed(press: Press, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(condensed, "PATCH_MARGIN_MM", 0.0)  # only faces already loaded
    fast = FrozenPress(press)
    state = fast.advance(fast.start(), Target(depth_mm=0.3))
    state = fast.advance(state, Target(depth_mm=6.0))
    assert state.certificate is not None and state.certificate.residual < 1e-5
    assert state.contact is not None and state.contact.gap.min() > -0.2  # no face was let through


def test_level_2_refuses_what_level_1_refuses(press: Press) -> None:
    fast = FrozenPress(press)
    state = fast.advance(fast.start(), PATH[0])
    with pytest.raises(Refusal, match=r"^range: normal_n=-1"):
        fast.advance(state, Target(normal_n=-1.0))


def test_the_inverse_keeps_what_it_was_taught(press: Press) -> None:
    fast = FrozenPress(press)
    state = fast.advance(fast.start(), PATH[0])
    inverse = SecantInverse(fast.tangents[0])
    rows, solid = inverse.tangent.rows, press.model.solid
    force = solid.gather(solid.energy_and_force(state.displacement)[1])
    solved = inverse.solve(force)
    further = solid.gather(1.1 * state.displacement)
    changed = solid.gather(solid.energy_and_force(1.1 * state.displacement)[1]) - force
    moved = further - solid.gather(state.displacement)
    before = np.linalg.norm(inverse.solve(changed) - moved)
    assert before > 1e-3 * np.linalg.norm(moved)  # there is something to learn
    after = inverse.learn(moved, changed, solved, inverse.solve(force + changed), force + changed)
    assert np.linalg.norm(inverse.solve(changed) - moved) < 1e-3 * before
    assert np.allclose(after, inverse.solve(force + changed), rtol=0, atol=1e-5 * np.abs(after).max())
    unit = np.eye(len(rows))
    pushed = np.array([inverse.push(column)[rows] for column in unit])
    assert np.abs(pushed - inverse.compliance).max() < 1e-9 * np.abs(pushed).max()
    assert np.abs(inverse.stiffness @ inverse.compliance - unit).max() < 1e-6


def test_a_wrong_internal_force_is_not_accepted(press: Press, monkeypatch: pytest.MonkeyPatch) -> None:
    fast = FrozenPress(press)
    state = fast.advance(fast.start(), PATH[0])
    monkeypatch.setattr(SecantInverse, "push", lambda self, load: 1.05 * (self.tangent.response @ load))
    state = fast.advance(state, PATH[1])
    assert fast.fallbacks == 2  # judged by forces alone, so level 1 has answered
    assert state.certificate is not None and state.certificate.residual < 1e-9


def test_a_pass_that_moves_nothing_teaches_nothing(press: Press) -> None:
    fast = FrozenPress(press)
    fast.advance(fast.start(), PATH[0])
    inverse = SecantInverse(fast.tangents[0])
    nothing = np.zeros(len(fast.tangents[0].response))
    assert np.array_equal(inverse.learn(nothing, nothing, nothing, nothing, nothing), nothing)  # was a division by zero
