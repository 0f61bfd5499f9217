"""Compiled loops of :mod:`sensing.wrench.filter` and :mod:`sensing.wrench.trend`. N, N m, s."""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.compiled import SHORT
from sensing.wrench.kernels import EXACT

_KERNEL = SHORT | {"fastmath": EXACT}


@numba.njit(**_KERNEL)
def predict(state, covariance, step, walk, density):
    """Predict step of M motions, each axis apart: x' = F x, P' = F P F' + Q (Bar-Shalom, Li, Kirubarajan 2001, 5.2).

    Args:
        state: (M, 2, 6) values, N, and rates, N/s (torques: N m for N).
        covariance: (M, 3, 6) of the value, of value with rate, of the rate.
        step: time, s.
        walk: (M, 6) noise density of the value, N^2/s.
        density: (M, 6) noise density of the rate, N^2/s^3.

    Returns:
        Predicted states (M, 2, 6) and covariances (M, 3, 6).
    """
    value, predicted = state.copy(), covariance.copy()
    for m in range(len(state)):
        for k in range(6):
            vv, vr, rr, q = covariance[m, 0, k], covariance[m, 1, k], covariance[m, 2, k], density[m, k]
            value[m, 0, k] += step * state[m, 1, k]
            predicted[m, 0, k] = vv + step * (2 * vr + step * rr) + q * step**3 / 3 + walk[m, k] * step
            predicted[m, 1, k] = vr + step * rr + q * step**2 / 2
            predicted[m, 2, k] = rr + q * step
    return value, predicted


@numba.njit(**_KERNEL)
def mode_probabilities(weight, state, covariance, measured, noise, memory, least):
    """(M, 6) mode probabilities after a measurement: Bayes' rule with a fading prior, none at zero.

    Args:
        weight: (M, 6) mode probabilities before.
        state: (M, 2, 6) predicted values and rates.
        covariance: (M, 3, 6) of them, as in :func:`predict`.
        measured: (6,) wrench, N and N m.
        noise: (M, 6) measurement variances that each motion assumes.
        memory: factor on the logarithm of the prior, (0, 1].
        least: least probability, before they are scaled to sum 1.
    """
    count, probability = len(weight), np.empty(weight.shape)
    for k in range(6):
        best, total, kept = -math.inf, 0.0, 0.0
        for m in range(count):
            spread = covariance[m, 0, k] + noise[m, k]
            innovation = measured[k] - state[m, 0, k]
            probability[m, k] = memory * math.log(weight[m, k]) - 0.5 * (
                innovation * innovation / spread + math.log(spread)
            )
            best = max(best, probability[m, k])
        for m in range(count):
            probability[m, k] = math.exp(probability[m, k] - best)
            total += probability[m, k]
        for m in range(count):
            probability[m, k] = max(probability[m, k] / total, least)
            kept += probability[m, k]
        for m in range(count):
            probability[m, k] /= kept
    return probability


@numba.njit(**_KERNEL)
def correct(state, covariance, measured, noise, nis_limit, rates, axis_limit):
    """Update step of every motion in Joseph's form; changes ``state`` and ``covariance``.

    Where the normalised innovation squared exceeds ``nis_limit`` for all motions, the variances of values are first
    increased by the squared innovation and those of rates by ``rates``. Where only that of one axis exceeds a motion's
    ``axis_limit``, the variance of this value of this motion is increased.

    Args:
        state: (M, 2, 6) predicted values and rates.
        covariance: (M, 3, 6) of them, as in :func:`predict`.
        measured: (6,) wrench, N and N m.
        noise: (M, 6) measurement variances that each motion assumes.
        nis_limit: limit of the normalised innovation squared over six axes.
        rates: (M, 6) variances added to those of the rates.
        axis_limit: (M,) limits of the normalised innovation squared of one axis.
    """
    least = math.inf
    for m in range(len(state)):
        square = 0.0
        for k in range(6):
            square += (measured[k] - state[m, 0, k]) ** 2 / (covariance[m, 0, k] + noise[m, k])
        least = min(least, square)
    for m in range(len(state)):
        for k in range(6):
            innovation = measured[k] - state[m, 0, k]
            if least > nis_limit:
                covariance[m, 0, k] += innovation**2
                covariance[m, 2, k] += rates[m, k]
            elif innovation**2 > axis_limit[m] * (covariance[m, 0, k] + noise[m, k]):
                covariance[m, 0, k] += innovation**2
            vv, vr, rr, own = covariance[m, 0, k], covariance[m, 1, k], covariance[m, 2, k], noise[m, k]
            keep, g, h = own / (vv + own), vv / (vv + own), vr / (vv + own)
            state[m, 0, k] += g * innovation
            state[m, 1, k] += h * innovation
            covariance[m, 0, k] = keep * vv * keep + g * own * g
            covariance[m, 1, k] = keep * (vr - h * vv) + g * own * h
            covariance[m, 2, k] = rr - 2 * h * vr + h * vv * h + h * own * h


@numba.njit(**_KERNEL)
def mixture(weight, state, covariance, common):
    """Mean (6,) and variance (6,) of the mixture of all motions, the spread of their means included.

    Args:
        weight: (M, 6) mode probabilities.
        state: (M, 2, 6) values and rates.
        covariance: (M, 3, 6) of them, as in :func:`predict`.
        common: (M, 6) further variances of the values, such as that of errors which repeat from frame to frame.
    """
    value, variance = np.zeros(6), np.zeros(6)
    for m in range(len(weight)):
        for k in range(6):
            value[k] += weight[m, k] * state[m, 0, k]
    for m in range(len(weight)):
        for k in range(6):
            off = state[m, 0, k] - value[k]
            variance[k] += weight[m, k] * (covariance[m, 0, k] + common[m, k] + off * off)
    return value, variance


@numba.njit(**_KERNEL)
def rate_factors(past_s, past, first, following, time_s, measured, variance, horizons_s, sums, law):
    """Regression factors of measured on predicted changes, for every delay (see :mod:`sensing.wrench.trend`).

    Args:
        past_s: (R,) times of earlier estimates, a ring buffer: number n at place n % R.
        past: (R, 2, 6) values and rates of these estimates.
        first, following: numbers of the oldest prediction and of the one after the newest.
        time_s, measured, variance: of the measurement, (6,) each.
        horizons_s: (H,) delays, rising.
        sums: (2, H, 2) of x y and of x x over forces and torques; faded and added to.
        law: (memory in s, caution, pseudo-count, noise) of :mod:`sensing.wrench.trend`.

    Returns:
        Factors (H, 6), and the number of the oldest prediction that is still needed.
    """
    memory_s, caution, least, noise = law
    room, factors = len(past_s), np.empty((len(horizons_s), 6))
    if following > first:
        sums *= math.exp(-(time_s - past_s[(following - 1) % room]) / memory_s)
    while following - first > 1 and time_s - past_s[(first + 1) % room] >= horizons_s[-1]:
        first += 1
    number = following - 1
    for h in range(len(horizons_s)):
        while number >= first and time_s - past_s[number % room] < horizons_s[h]:
            number -= 1
        for part in range(2):
            if number >= first:
                old, delay_s = past[number % room], time_s - past_s[number % room]
                for k in range(3 * part, 3 * part + 3):
                    x, y = old[1, k] * delay_s, measured[k] - old[0, k]
                    sums[0, h, part] += x * y / variance[k]
                    sums[1, h, part] += x * x / variance[k]
            xy, xx = sums[0, h, part], sums[1, h, part]
            lowered = (xy - caution * math.sqrt(noise * xx)) / (xx + least)
            factors[h, 3 * part : 3 * part + 3] = min(max(lowered, 0.0), 1.0)
    return factors, first
