"""Friction of the supports, learned from contacts that hold and from contacts that slip.

Notes:
    The state is a distribution over coefficients. The ratio of a slipping contact is the coefficient; that of a holding
    one lies anywhere below it, with density one over the coefficient: the least coefficient that explains all ratios is
    the likeliest, which is the conservative side. Whether a contact slips is itself uncertain; its probability weights
    both cases. Samples of one contact are too correlated to count as independent: each has a weight below one.
    The logistic function approximates the normal distribution's.
"""

from __future__ import annotations

import numpy as np

from sensing.tensegrity.description import Array

COEFFICIENTS = np.linspace(0.05, 1.5, 59)  # coefficients of the distribution
FIRST = np.exp(-0.5 * ((np.log(COEFFICIENTS) - np.log(0.7)) / 0.5) ** 2)  # E: distribution before any sample
FIRST /= FIRST.sum()
WEIGHT = 0.15  # E: weight of one sample
FORGET = 5e-4  # E: part by which each sample moves the distribution back to the first
OFTEN = 0.1  # E: least part of the contacts that slip
SPREAD = 0.05  # E: standard deviation of the ratio at which a contact slips
LOGISTIC = 1.702  # logistic(1.702 x) is within 0.01 of the normal distribution's


def slip_probability(weights: Array, ratio: float, ratio_sd: float) -> float:
    """Probability that a contact at a friction ratio slips.

    Args:
        weights: (59,) probabilities of the coefficients.
        ratio, ratio_sd: measured friction ratio and its standard deviation.
    """
    spread = np.hypot(SPREAD * (0.3 + COEFFICIENTS), ratio_sd)
    return float(weights @ _logistic((ratio - (1 - SPREAD) * COEFFICIENTS) / spread))


def learned(weights: Array, ratio: float, ratio_sd: float, slips: float) -> Array:
    """The distribution after one more sample.

    Args:
        weights: (59,) probabilities of the coefficients before.
        ratio, ratio_sd: measured friction ratio and its standard deviation.
        slips: probability that the contact slips.
    """
    spread = np.hypot(SPREAD * (0.3 + COEFFICIENTS), ratio_sd)
    away = (COEFFICIENTS - ratio) / spread
    slips = max(slips, OFTEN)
    likelihood = (1 - slips) * _logistic(away) / COEFFICIENTS + slips * 0.4 / spread * np.exp(-0.5 * away**2) + 1e-2
    new = weights * likelihood**WEIGHT
    return np.asarray((1 - FORGET) * new / new.sum() + FORGET * FIRST)


def moments(weights: Array) -> tuple[float, float]:
    """(mean, standard deviation) of the coefficient."""
    mean = float(weights @ COEFFICIENTS)
    return mean, max(0.0, float(weights @ (COEFFICIENTS - mean) ** 2)) ** 0.5


def _logistic(x: Array) -> Array:
    return np.asarray(1 / (1 + np.exp(-LOGISTIC * np.clip(x, -40, 40))))
