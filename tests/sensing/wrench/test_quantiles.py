"""The two quantiles against SciPy, which is an implementation of its own, and against their definitions."""

from __future__ import annotations

import math

import pytest
from scipy import stats

from cad.errors import ParameterError
from sensing.wrench.quantiles import binomial_quantile, chi_square_quantile


@pytest.mark.parametrize("freedom", [0.3, 1.0, 2.0, 6.0, 7.7, 60.0, 599.0])
@pytest.mark.parametrize("probability", [1e-9, 1e-3, 0.05, 0.5, 0.95, 1 - 1e-5])
def test_chi_square_against_scipy(probability, freedom):
    expected = stats.chi2.ppf(probability, freedom)
    assert chi_square_quantile(probability, freedom) == pytest.approx(expected, rel=1e-10)


def test_chi_square_of_two_degrees_is_exponential():
    assert chi_square_quantile(0.95, 2.0) == pytest.approx(-2 * math.log(0.05), rel=1e-14)


@pytest.mark.parametrize("trials", [0, 1, 29, 2995, 100_000])
@pytest.mark.parametrize("rate", [1e-4, 1e-3, 0.3])
@pytest.mark.parametrize("probability", [0.05, 0.5, 0.999])
def test_binomial_against_scipy(probability, trials, rate):
    assert binomial_quantile(probability, trials, rate) == int(stats.binom.ppf(probability, trials, rate))


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: chi_square_quantile(1.0, 3), "probability"),
        (lambda: chi_square_quantile(0.5, 0), "freedom"),
        (lambda: chi_square_quantile(math.nan, 3), "probability"),
        (lambda: binomial_quantile(0.5, 10, 0.0), "rate"),
        (lambda: binomial_quantile(0.5, -1, 0.5), "trials"),
    ],
)
def test_what_is_outside_is_refused_by_name(call, name):
    with pytest.raises(ParameterError, match=name):
        call()
