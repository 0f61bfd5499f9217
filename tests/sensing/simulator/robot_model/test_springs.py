"""Springs fitted to pressed shells: their forces are the gradient of their energy, and what was held out agrees."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.simulator.robot_model.errors import fit_errors
from sensing.simulator.robot_model.model import loss_time_s, robot_model
from sensing.simulator.robot_model.pressed import PressedStates, pressed_states
from sensing.simulator.robot_model.stiffness import ShellStiffness, displacements, fitted
from sensing.simulator.solid.geometry import shell_geometry

SPRING = ShellStiffness(4.0, 0.02, 5.0, 0.01)


@pytest.fixture(scope="module")
def model():
    return robot_model(EndcapParams(130, 8))


def energy(spring: ShellStiffness, place: np.ndarray) -> float:
    square = place[0] ** 2 + place[1] ** 2
    linear = spring.radial_n_mm * square + spring.axial_n_mm * place[2] ** 2
    cubic = spring.radial_cubic_n_mm3 * square**2 + spring.axial_cubic_n_mm3 * place[2] ** 4
    return linear / 2 + cubic / 4


def test_forces_are_the_gradient_of_the_energy():
    step = 1e-4
    for place in np.random.default_rng(5).uniform(-8, 8, (6, 3)):
        slope = [(energy(SPRING, place + e) - energy(SPRING, place - e)) / (2 * step) for e in step * np.eye(3)]
        assert SPRING.force_n(place) == pytest.approx(slope, rel=1e-7, abs=1e-6)


def made_states(spring: ShellStiffness) -> PressedStates:
    tilt, depth = (a.ravel() for a in np.meshgrid([0.0, 25.0, 50.0], np.linspace(2, 10, 9)))
    zero = np.zeros((len(tilt), 3))
    states = PressedStates(tilt, depth, zero[:, :2], zero, zero, zero[:, 0])
    return PressedStates(tilt, depth, zero[:, :2], spring.force_in_contact(states), zero, zero[:, 0])


def test_the_fit_finds_the_springs_that_made_the_states():
    found = fitted(made_states(SPRING))
    assert np.array(list(vars(found).values())) == pytest.approx(list(vars(SPRING).values()), rel=1e-6)


def test_a_plane_presses_inward_and_shears_along_its_travel():
    states = PressedStates(*(np.array(a, float) for a in ([30], [5], [[1, -2]], [[0] * 3], [[0] * 3], [0])))
    assert displacements(states)[0] @ [math.sin(math.radians(30)), 0, math.cos(math.radians(30))] == pytest.approx(-5)
    force = ShellStiffness(4, 0, 4, 0).force_in_contact(states)[0]
    assert force == pytest.approx([-20, 4, -8])


def test_held_out_tilts_of_the_shell_are_within_the_goal(model):
    errors = fit_errors(model)
    assert errors.fitted < 0.05 and errors.held_out < 0.10
    assert set(errors.by_tilt) >= {0.0, 3.0, 18.0, 25.0, 32.0, 46.0, 50.0, 54.0}
    assert errors.torque_same_force > 0.9 > errors.torque_same_motion


def test_forces_go_with_the_modulus(model):
    soft = robot_model(EndcapParams(130, 8), "Dragon Skin 20")
    ratio = silicone("Dragon Skin 20").neo_hooke().shear_mpa / model.shear_mpa
    assert soft.stiffness.axial_n_mm / model.stiffness.axial_n_mm == pytest.approx(ratio, rel=1e-6)
    assert soft.damping_s == 0 and model.damping_s > 0


def test_damping_is_the_loss_of_the_series():
    rate, tau, g = 20.0, 0.1, 0.2
    b = g / (1 - g)
    loss = b * rate * tau / (1 + (rate * tau) ** 2)  # G'' over the long-term modulus of one Maxwell element
    assert loss_time_s(((g, tau),), rate) == pytest.approx(loss / rate)


def test_a_shell_that_snaps_early_is_refused(model):
    few = model.states.where(model.states.depth_mm < 2.3)
    with pytest.raises(ParameterError, match="states of 2 to 10 mm"):
        fitted(few)


def test_no_state_that_slipped_or_came_back_is_kept():
    states = pressed_states(shell_geometry(130, 8), 0.68)
    along = np.hypot(*states.force_n[:, 1:].T)
    known = np.isfinite(along)
    assert (along[known] < 0.7 * 0.98 * states.normal_n[known]).all()
    pressed = states.where(states.is_pressed_only).between(1, 12)
    for tilt in np.unique(pressed.tilt_deg):
        rows = pressed.where(pressed.tilt_deg == tilt)
        secant = rows.normal_n / rows.depth_mm
        curve = np.polyval(np.polyfit(rows.depth_mm, secant, 2), rows.depth_mm)
        assert secant == pytest.approx(curve, rel=0.05)  # one curve, whatever path it is from
