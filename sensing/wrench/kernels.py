"""Compiled loops of :mod:`sensing.wrench.model` and :mod:`sensing.wrench.filter` for one field at a time.

A field's wrench is a hundred small steps: in numpy their calls cost five times what they compute. N, N m, px, s.
The network's authority is :mod:`sensing.learning.net`, which is trained; tests/sensing/wrench/test_onnx.py holds what
is written here, and the ONNX graph, to it on random weights.
"""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.compiled import HELPER, KERNEL, SHORT

EXACT = {"reassoc", "contract"}  # fastmath flags that leave a / b and exp(a) what they are: zero stays exactly zero
_KERNEL, _HELPER = SHORT | {"fastmath": EXACT}, HELPER | {"fastmath": EXACT}


@numba.njit(**_KERNEL)
def answer_one(x, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits):
    """Answer of the network of :mod:`sensing.learning.net` for one field, and how unlike those of training it is.

    Args:
        x: (D,) float64, finite. cells: (D,) float32, 1 for cells that count. linear: (6, D) float32.
        principal: (K, D) float32. pattern: (K, D) float64, the field that each principal part stands for. gram: (K, K)
            float64, their inner products.
        mean: layers of the perceptron that bends the answer: first (M, K) and (M,), those after it (L, M, M) and
            (L, M), float32, the last (6, M) float64, in N and N m.
        spread: layers of the other: six. scale: (6,) float64 of the standard deviations.
        tracking: (7,) float64: standard deviations that tracking adds, and force by which half of them is there, N.
        limits: (MIN_SPREAD, MAX_SPREAD, MAX_MIX).

    Returns:
        Wrench (6,), covariance (6, 6), norm of the principal part on the cells that count, and of what it leaves (px).
    """
    return _answer(x, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits)


@numba.njit(**KERNEL | {"fastmath": EXACT})
def answer_many(inputs, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits):
    """Wrenches (N, 6) and covariances (N, 6, 6) for fields (N, D); the rest as of :func:`answer_one`.

    Args:
        inputs: (N, D) float64, finite.
        cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits: see there.
    """
    value, covariance = np.empty((len(inputs), 6)), np.empty((len(inputs), 6, 6))
    for n in range(len(inputs)):
        value[n], covariance[n], _, _ = _answer(
            inputs[n], cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits
        )
    return value, covariance


@numba.njit(**_HELPER)
def _answer(x, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits):
    count = len(principal)
    z, seen, along = np.zeros(count), np.zeros(count), np.zeros(count)
    for k in range(count):
        z[k], seen[k], along[k] = _products(principal[k], pattern[k], x, cells)
    square = 0.0
    for d in range(x.size):
        square += cells[d] * x[d] * x[d]
    value, raw = np.empty(6), np.empty(21)
    h = _units(mean[0], mean[1], z, True)
    for k in range(len(mean[2])):
        h = _units(mean[2][k], mean[3][k], h, True)
    for k in range(6):
        value[k] = _product(linear[k], x) + _product(mean[4][k], h)
    h = _units(spread[2], spread[3], _units(spread[0], spread[1], z, False), False)
    for k in range(21):
        raw[k] = _product(spread[4][k], h) + spread[5][k]
    distance, left = _range(seen, along, gram, square)
    covariance = _covariance(raw, scale, limits)
    force = math.sqrt(value[0] ** 2 + value[1] ** 2 + value[2] ** 2)
    for k in range(6):
        covariance[k, k] += (tracking[k] * force / (force + tracking[6])) ** 2
    return value, covariance, distance, left


@numba.njit(**_HELPER)
def _products(line, pattern, x, cells):
    whole = part = along = 0.0
    for d in range(x.size):
        a, counted = line[d] * x[d], cells[d] * x[d]
        whole += a
        part += cells[d] * a
        along += pattern[d] * counted
    return whole, part, along


@numba.njit(**_HELPER)
def _product(line, x):
    total = 0.0
    for d in range(x.size):
        total += line[d] * x[d]
    return total


@numba.njit(**_HELPER)
def _units(weight, bias, inputs, anchored):
    """Answers silu(a + b) of a layer's units; ``anchored``: minus silu(b)."""
    activation = np.empty(len(bias))
    for k in range(len(bias)):
        activation[k] = _silu(_product(weight[k], inputs) + bias[k])
        if anchored:
            activation[k] -= _silu(np.float64(bias[k]))
    return activation


@numba.njit(**_HELPER)
def _silu(a):
    return a / (1.0 + math.exp(-max(a, -700.0)))


@numba.njit(**_HELPER)
def _covariance(raw, scale, limits):
    """(6, 6) L L' from the (21,) raw entries of L, row by row: L = spread of each axis times a unit lower triangle."""
    least, most, mix = limits
    root, place = np.zeros((6, 6)), 0
    for k in range(6):
        a = most * math.tanh(raw[place + k] / most)
        spread = (least + max(a, 0.0) + math.log1p(math.exp(-abs(a)))) * scale[k]
        for m in range(k):
            root[k, m] = spread * mix * math.tanh(raw[place + m] / mix)
        root[k, k] = spread
        place += k + 1
    covariance = np.empty((6, 6))
    for k in range(6):
        for m in range(k + 1):
            covariance[k, m] = covariance[m, k] = _product(root[k], root[m])
    return covariance


@numba.njit(**_HELPER)
def _range(seen, along, gram, square):
    """Norm of the principal part, and of what its patterns leave of a field that has that sum of squares, and these
    products ``along`` the patterns."""
    explained = 0.0
    for k in range(len(seen)):
        explained += seen[k] * (2.0 * along[k] - _product(gram[k], seen))
    return math.sqrt(_product(seen, seen)), math.sqrt(max(square - explained, 0.0))


@numba.njit(**_KERNEL)
def contact_angles(wrenches, radius_mm, least_n):
    """Answer of :func:`sensing.wrench.range.contact_angle_deg`.

    Args:
        wrenches: (N, 6) contiguous float64, N and N m. radius_mm: of the sphere. least_n: with less force it is 0.
    """
    angle = np.zeros(len(wrenches))
    for n in range(len(wrenches)):
        size = math.sqrt(wrenches[n, 0] ** 2 + wrenches[n, 1] ** 2 + wrenches[n, 2] ** 2)
        if not size >= least_n:
            continue
        x, y, z = wrenches[n, 0] / size, wrenches[n, 1] / size, wrenches[n, 2] / size
        p, q, r = 1000 * wrenches[n, 3] / size, 1000 * wrenches[n, 4] / size, 1000 * wrenches[n, 5] / size
        a, b, c = y * r - z * q, z * p - x * r, x * q - y * p  # point of the line nearest to the centre
        height = c - z * math.sqrt(max(radius_mm**2 - (a * a + b * b + c * c), 0.0))
        angle[n] = math.degrees(math.acos(min(max(height / radius_mm, -1.0), 1.0)))
    return angle


@numba.njit(**_KERNEL)
def predict(state, covariance, step, walk, density):
    """States and covariances of M motions after a ``step``.

    Args:
        state: (M, 2, 6) values and rates. covariance: (M, 3, 6) of values, with rates, of rates. step: s.
        walk: (M, 6) noise density of the value, N^2/s. density: (M, 6) of the rate, N^2/s^3 (torques: N m for N).
    """
    value, spread = state.copy(), covariance.copy()
    for m in range(len(state)):
        for k in range(6):
            vv, vr, rr, q = covariance[m, 0, k], covariance[m, 1, k], covariance[m, 2, k], density[m, k]
            value[m, 0, k] += step * state[m, 1, k]
            spread[m, 0, k] = vv + step * (2 * vr + step * rr) + q * step**3 / 3 + walk[m, k] * step
            spread[m, 1, k] = vr + step * rr + q * step**2 / 2
            spread[m, 2, k] = rr + q * step
    return value, spread


@numba.njit(**_KERNEL)
def mode_probabilities(weight, state, covariance, measured, noise, memory, least):
    """Weights (M, 6) after a measurement, before it is taken in: Bayes' rule with a fading past, none at zero.

    Args:
        weight: (M, 6) before. state: (M, 2, 6). covariance: (M, 3, 6). measured: (6,).
        noise: (M, 6) variances that a motion counts on. memory: part of the logarithm of a weight that lasts.
        least: least weight, before they are scaled to sum 1.
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
def correct(state, covariance, measured, noise, surprise, rates, limit):
    """Takes a measurement into ``state`` and ``covariance`` of every motion.

    Where its normalised square is beyond ``surprise`` for all of them, values are widened by the innovation and rates
    by ``rates`` first; where that of an axis is beyond a motion's own ``limit``, this value of this motion is.

    Args:
        state: (M, 2, 6). covariance: (M, 3, 6). measured: (6,). noise: (M, 6) variances that a motion counts on.
        surprise: limit of the normalised square.
        rates: (M, 6) variances that the rates are widened by.
        limit: (M,) limits of the normalised square of one axis.
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
            if least > surprise:
                covariance[m, 0, k] += innovation**2
                covariance[m, 2, k] += rates[m, k]
            elif innovation**2 > limit[m] * (covariance[m, 0, k] + noise[m, k]):
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
    """Value (6,) and variance (6,) of all motions together, how far they are apart included.

    Args:
        weight: (M, 6). state: (M, 2, 6). covariance: (M, 3, 6).
        common: (M, 6) variances of values beside those of ``covariance``, such as what repeats from frame to frame.
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
