"""Quantiles of the chi-square and the binomial distribution (standard library only).

They are all that the estimator needs of a statistics library, which would double the size of what a small computer
beside the robot has to install and load.

Notes:
    The regularised lower incomplete gamma function by its series (Abramowitz, Stegun 1964, eq. 6.5.29),

        P(a, x) = x^a e^-x / Gamma(a + 1) (1 + x / (a + 1) + x^2 / ((a + 1)(a + 2)) + ...),

    whose terms are all positive, so nothing cancels; quantiles by bisection to the last bit.
"""

from __future__ import annotations

import math

from cad.errors import ParameterError


def chi_square_quantile(probability: float, freedom: float) -> float:
    """x below which a chi-square variable lies with a probability.

    Args:
        probability: in (0, 1), dimensionless. Near 1 the relative error of 1 - probability is about 1e-16 over it.
        freedom: degrees of freedom, over 0; need not be whole.

    Raises:
        ParameterError: outside those ranges.
    """
    _require("probability", probability, 0.0, 1.0)
    _require("freedom", freedom, 0.0, math.inf)
    low, high = 0.0, freedom
    while _chi_square_below(high, freedom) < probability:
        low, high = high, 2 * high
    while True:
        middle = (low + high) / 2
        if middle in (low, high):
            return middle
        if _chi_square_below(middle, freedom) < probability:
            low = middle
        else:
            high = middle


def binomial_quantile(probability: float, trials: int, rate: float) -> int:
    """Smallest k such that at most k of ``trials`` succeed with a probability of at least ``probability``.

    Args:
        probability: in (0, 1).
        trials: at least 0.
        rate: probability of success of one trial, in (0, 1).

    Raises:
        ParameterError: outside those ranges.
    """
    _require("probability", probability, 0.0, 1.0)
    _require("rate", rate, 0.0, 1.0)
    _require("trials", trials, -1, math.inf)
    below = 0.0
    for count in range(trials + 1):
        ways = math.lgamma(trials + 1) - math.lgamma(count + 1) - math.lgamma(trials - count + 1)
        below += math.exp(ways + count * math.log(rate) + (trials - count) * math.log1p(-rate))
        if below >= probability:
            return count
    return trials


def _chi_square_below(x: float, freedom: float) -> float:
    a, half = freedom / 2, x / 2
    if half <= 0:
        return 0.0
    total = term = 1.0
    divisor = a
    while term > 1e-17 * total:
        divisor += 1
        term *= half / divisor
        total += term
    return total * math.exp(a * math.log(half) - half - math.lgamma(a + 1))


def _require(name: str, value: float, low: float, high: float) -> None:
    if not low < value < high:
        raise ParameterError(f"{name}={value:g} outside {low:g}..{high:g}, ends excluded", name=name, value=value)
