"""What a predicted change was worth: its factor against the sums written out."""

import numpy as np
import pytest

from sensing.wrench.trend import Trend


def test_a_factor_is_that_of_least_squares_less_two_of_its_deviations():
    """A steady ramp, y = x: of S = sum x^2 / variance, fading, (S - 2 sqrt(2 S)) / (S + 4)."""
    trend, slope, dt = Trend(), np.array([5.0, 0, 0, 0, 0, 0]), 0.03
    for k in range(40):
        trend.update(dt * k, slope * dt * k, np.full(6, 0.04), slope * dt * k, slope)
        ages_s = dt * np.arange(max(0, k - 1))  # of the comparisons with the prediction of two frames before
        total = (np.exp(-ages_s / 0.6) * (5.0 * 2 * dt) ** 2 / 0.04).sum()
        wanted = min(max((total - 2 * np.sqrt(2 * total)) / (total + 4), 0), 1)
        assert trend.factors[1, :3] == pytest.approx(np.full(3, wanted), abs=1e-9)
        assert (trend.factors[1, 3:] == 0).all()  # torques that did not move say nothing
    assert wanted > 0.1
