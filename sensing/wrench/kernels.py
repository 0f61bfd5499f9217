"""Compiled loops of :mod:`sensing.wrench.model` and :mod:`sensing.wrench.range` for one field at a time.

A field's wrench takes a hundred small steps: in numpy their calls cost five times the arithmetic. N, N m, px.
The reference implementation is :mod:`sensing.learning.net`, which is trained; tests/sensing/wrench/test_onnx.py
compares these loops, and the ONNX graph, with it on random weights.
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
def estimate_one(x, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits):
    """Wrench by the network of :mod:`sensing.learning.net` from one field, and its distance from the training data.

    Args:
        x: (D,) float64, finite; the field, px.
        cells: (D,) float32, 1 for cells that count for the distance, 0 for others.
        linear: (6, D) float32.
        principal: (K, D) float32.
        pattern: (K, D) float64, the field that each principal part stands for.
        gram: (K, K) float64, their inner products.
        mean: layers of the perceptron that corrects the linear map: first (M, K) and (M,), those after it (L, M, M)
            and (L, M), float32, the last (6, M) float64, in N and N m.
        spread: weights and biases of the three layers of the perceptron for the covariance.
        scale: (6,) float64 of the standard deviations.
        tracking: (7,) float64: standard deviations that tracking adds, and force by which half of them is there, N.
        limits: (MIN_SPREAD, MAX_SPREAD, MAX_MIX).

    Returns:
        Wrench (6,), covariance (6, 6), norm of the principal part on the cells that count, and norm of the rest, px.
    """
    return _estimate(x, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits)


@numba.njit(**KERNEL | {"fastmath": EXACT})
def estimate_many(inputs, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits):
    """Wrenches (N, 6) and covariances (N, 6, 6) of fields (N, D).

    Args:
        inputs: (N, D) float64, finite.
        cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits: see :func:`estimate_one`.
    """
    value, covariance = np.empty((len(inputs), 6)), np.empty((len(inputs), 6, 6))
    for n in range(len(inputs)):
        value[n], covariance[n], _, _ = _estimate(
            inputs[n], cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits
        )
    return value, covariance


@numba.njit(**_HELPER)
def _estimate(x, cells, linear, principal, pattern, gram, mean, spread, scale, tracking, limits):
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
    """Activations silu(a + b) of a layer's units; if ``anchored``, minus silu(b), so that a = 0 gives 0."""
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
    """Norm of the principal part, and norm of the rest of the field.

    ``square`` is the field's sum of squares, ``along`` holds its inner products with the patterns.
    """
    explained = 0.0
    for k in range(len(seen)):
        explained += seen[k] * (2.0 * along[k] - _product(gram[k], seen))
    return math.sqrt(_product(seen, seen)), math.sqrt(max(square - explained, 0.0))


@numba.njit(**_KERNEL)
def input_of(channels, valid, cells):
    """Input of the network from a field.

    Args:
        channels: (2, H, W) float32 shear, px.
        valid: (H, W) bool.
        cells: (H, W) bool, those that count.

    Returns:
        (2 H W,) float64 with zero for what is not finite, its largest absolute value, the number of valid cells, and
        the number of valid cells that count.
    """
    flat, x, largest = channels.ravel(), np.empty(channels.size), 0.0
    for d in range(x.size):
        x[d] = flat[d] if np.isfinite(flat[d]) else 0.0
        largest = max(largest, abs(x[d]))
    seen, counting, of_valid, of_cells = 0, 0, valid.ravel(), cells.ravel()
    for c in range(of_valid.size):
        seen += of_valid[c]
        counting += of_valid[c] and of_cells[c]
    return x, largest, seen, counting


@numba.njit(**_KERNEL)
def contact_angles(wrenches, radius_mm, least_n):
    """Compiled loop of :func:`sensing.wrench.range.contact_angle_deg`.

    Args:
        wrenches: (N, 6) contiguous float64, N and N m.
        radius_mm: of the sphere.
        least_n: with less force it is 0.
    """
    angle = np.zeros(len(wrenches))
    for n in range(len(wrenches)):
        angle[n] = _contact_angle(wrenches[n], radius_mm, least_n)
    return angle


@numba.njit(**_KERNEL)
def beyond(wrenches, covariances, radius_mm, least_n, limits):
    """Compiled loop of :meth:`sensing.wrench.range.Range.is_beyond`.

    Args:
        wrenches: (N, 6) contiguous float64, N and N m.
        covariances: (N, 6, 6) contiguous.
        radius_mm: of the sphere.
        least_n: with less force the contact's angle is 0.
        limits: largest force in N, angle in degrees, and standard deviation of a force in N.
    """
    force_n, tilt_deg, spread_n = limits
    result = np.empty(len(wrenches), np.bool_)
    for n in range(len(wrenches)):
        w = wrenches[n]
        outside = math.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2) > force_n
        outside = outside or _contact_angle(w, radius_mm, least_n) > tilt_deg
        for k in range(3):
            outside = outside or not math.sqrt(covariances[n, k, k]) <= spread_n
        result[n] = outside
    return result


@numba.njit(**_HELPER)
def _contact_angle(wrench, radius_mm, least_n):
    size = math.sqrt(wrench[0] ** 2 + wrench[1] ** 2 + wrench[2] ** 2)
    if not size >= least_n:
        return 0.0
    x, y, z = wrench[0] / size, wrench[1] / size, wrench[2] / size
    p, q, r = 1000 * wrench[3] / size, 1000 * wrench[4] / size, 1000 * wrench[5] / size
    a, b, c = y * r - z * q, z * p - x * r, x * q - y * p  # point of the line nearest to the centre
    height = c - z * math.sqrt(max(radius_mm**2 - (a * a + b * b + c * c), 0.0))
    return math.degrees(math.acos(min(max(height / radius_mm, -1.0), 1.0)))
