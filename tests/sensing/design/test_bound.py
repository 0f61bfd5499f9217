"""The Cramer-Rao bound against linear Gaussian toys, whose best estimator is known in closed form."""

import numpy as np
import pytest

from sensing.design.bound import Bound, _seen, smallest_covariance

RNG = np.random.default_rng(5)
SLOPES = RNG.normal(size=(3, 40)) * np.array([[1.0], [20.0], [0.01]])  # parameters of very different units
BY_ANSWER = RNG.normal(size=(3, 2))
ROOT = RNG.normal(size=(40, 40)) / 8 + np.eye(40)
NOISE = ROOT @ ROOT.T


def test_it_is_the_inverse_of_the_information():
    exact = BY_ANSWER.T @ np.linalg.inv(SLOPES @ np.linalg.inv(NOISE) @ SLOPES.T) @ BY_ANSWER
    assert np.allclose(smallest_covariance(SLOPES, NOISE, BY_ANSWER), exact, rtol=1e-9)
    variances = np.diag(NOISE)
    alone = BY_ANSWER.T @ np.linalg.inv((SLOPES / variances) @ SLOPES.T) @ BY_ANSWER
    assert np.allclose(smallest_covariance(SLOPES, variances, BY_ANSWER), alone, rtol=1e-9)


def test_generalised_least_squares_reaches_it():
    truth = np.array([1.0, -0.2, 30.0])
    weighted = SLOPES @ np.linalg.inv(NOISE)
    seen = truth @ SLOPES + RNG.normal(size=(20000, 40)) @ ROOT.T
    answers = np.linalg.solve(weighted @ SLOPES.T, weighted @ seen.T).T @ BY_ANSWER
    bound = smallest_covariance(SLOPES, NOISE, BY_ANSWER)
    assert np.allclose(np.cov(answers.T), bound, rtol=0.05, atol=0.03 * np.sqrt(np.outer(*[np.diag(bound)] * 2)))


def test_a_nuisance_with_a_prior_is_as_much_noise():
    """A history that moves the dots, and not the answers, is the same as noise of that covariance."""
    histories = RNG.normal(size=(5, 40))
    stacked, known = np.vstack([SLOPES, histories]), np.diag([0.0] * 3 + [1.0] * 5)
    asked = np.vstack([BY_ANSWER, np.zeros((5, 2))])
    found = smallest_covariance(stacked, NOISE, asked, known)
    assert np.allclose(found, smallest_covariance(SLOPES, NOISE + histories.T @ histories, BY_ANSWER), rtol=1e-9)
    assert (np.diag(found) > np.diag(smallest_covariance(SLOPES, NOISE, BY_ANSWER))).all()


def test_what_nothing_shows_keeps_its_prior():
    blind = np.vstack([SLOPES, np.zeros(40)])
    answer = np.vstack([np.zeros((3, 1)), [[2.0]]])
    known = np.diag([0.0, 0.0, 0.0, 4.0])
    assert smallest_covariance(blind, NOISE, answer, known)[0, 0] == pytest.approx(2.0**2 / 4.0)


def test_what_is_blind_on_a_scaled_copy_is_the_same():
    """Torques grow with the radius: weighed as those of 130 mm, they looked the weakest of every large endcap."""
    root = RNG.normal(size=(6, 6)) * np.repeat([0.05, 0.007], 3)[:, None]
    larger = np.repeat([1.0, 2.0], 3)[:, None] * root
    one, other = (Bound(50.0, 5.0, np.zeros(6), r @ r.T, 1.0, 90) for r in (root, larger))
    assert np.allclose(np.abs(one.weakest(65.0)), np.abs(other.weakest(130.0)))


def test_dots_are_whole_within_the_same_border_on_all_four_sides():
    pixels = np.random.default_rng(0).uniform([-5, -5], [645, 485], (4000, 2))
    seen = _seen(pixels)
    assert (seen == _seen(np.array([639.0, 479.0]) - pixels)).all() and 0.5 < seen.mean() < 0.95
    assert pixels[seen].min() > 8.5 and pixels[seen, 0].max() < 630.5 and pixels[seen, 1].max() < 470.5
