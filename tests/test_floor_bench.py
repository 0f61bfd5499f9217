"""The bench of the floor on states and errors made by hand, whose slopes and laws are known."""

import numpy as np
import pytest

from bench.bench_floor import States, _near, placed
from bench.tracker_noise import Noise, _alikeness
from sensing.simulator.solid.surface import turn_wrench

RNG = np.random.default_rng(2)


def test_slopes_of_a_quadratic_are_found_and_nothing_is_left():
    place = np.column_stack([RNG.uniform(15, 35, 900), *RNG.uniform(5, 25, (1, 900)), *RNG.uniform(-6, 6, (2, 900))])
    slope, bend = RNG.normal(size=(4, 18)), RNG.normal(size=(4, 4, 18)) / 30
    at = np.array([25.0, 15.0, 1.0, -1.0])
    away = place - at
    values = 3 + away @ slope + np.einsum("si,sj,ijk->sk", away, away, bend)
    near = _near(States(place, values[:, :6], values[:, 6:].reshape(900, 4, 3)), at)
    assert np.allclose(near.operator @ near.wrench, np.vstack([np.full(6, 3.0), slope[:, :6]]), atol=1e-8)
    surfaces = np.tensordot(near.operator, near.surface_mm, axes=1).reshape(5, 12)
    assert np.allclose(surfaces[1:], slope[:, 6:], atol=1e-8)
    assert np.abs(near.wrench - near.table @ (near.fit @ near.wrench)).max() < 1e-8


def test_what_is_left_has_the_scatter_of_the_history():
    """Noise beside the quadratic comes back with its variance, the freedoms of the fit allowed for."""
    place = np.column_stack([RNG.uniform(15, 35, 4000), RNG.uniform(5, 25, 4000), *RNG.uniform(-6, 6, (2, 4000))])
    wrench = np.column_stack([place @ RNG.normal(size=(4, 5)), 0.3 * RNG.normal(size=4000)])
    near = _near(States(place, wrench, np.zeros((4000, 1, 3))), np.array([25.0, 15.0, 0.0, 0.0]))
    left = near.share[:, None] * (near.wrench - near.table @ (near.fit @ near.wrench))
    assert np.sqrt((left**2).sum(axis=0)) == pytest.approx([0, 0, 0, 0, 0, 0.3], rel=0.15, abs=1e-9)


def test_too_few_states_give_none():
    place = np.tile([[25.0, 15.0, 0.0, 0.0]], (12, 1)) + RNG.normal(size=(12, 4))
    assert _near(States(place, np.zeros((12, 6)), np.zeros((12, 1, 3))), place[0]) is None


def test_forces_are_in_the_contacts_axes():
    wrench = np.array([5.0, 0.0, -12.0, 0.1, 0.2, 0.0])
    place, still = placed(turn_wrench(wrench, 70.0), 0.0, 70.0)
    assert np.allclose(place, [0, 12, 5, 0], atol=1e-12) and np.allclose(still, wrench)


def test_the_law_of_distance_is_found():
    at = np.tile(RNG.uniform(0, 400, (60, 2)), (300, 1, 1))
    law = Noise(0.02, 0.0, 0.0, 0.6, 80.0)
    covariance = law.covariance(at[0], np.zeros(60))[::2, ::2]
    drawn = RNG.multivariate_normal(np.zeros(60), covariance, (300, 2)).transpose(0, 2, 1) / 0.02
    alike, length = _alikeness(at, drawn)
    assert alike == pytest.approx(0.6, abs=0.12) and length == pytest.approx(80, rel=0.3)
