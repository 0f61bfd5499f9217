"""Compiled measurements of the robot's filter: points, their slopes, and the update step (error state: see kernels)."""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.robot.kernels import EXACTLY, times_vector, turned_by


@numba.njit(**EXACTLY)
def update_step(covariance, slopes, innovation, variance, limit, found):
    """Update step of independent measurements, one after the other; the covariance changes in place.

    Args:
        covariance: (N, N) covariance of the error state.
        slopes: (M, N) slopes of the measurements by the error state.
        innovation, variance: (M,) innovations and variances of independent measurements; NaN is left out.
        limit: squared innovation over its variance above which a measurement is left out.
        found: (M,) receives that ratio; negative where the measurement was left out.

    Returns:
        (N,) correction of the error state.
    """
    size = len(covariance)
    change, gain = np.zeros(size), np.empty(size)
    for m in range(len(innovation)):
        found[m] = -1.0
        if innovation[m] - innovation[m] != 0.0:  # NaN
            continue
        row = slopes[m]
        total, left = variance[m], innovation[m]
        for i in range(size):
            value = 0.0
            for j in range(size):
                if row[j] != 0.0:
                    value += covariance[i, j] * row[j]
            gain[i] = value
        for i in range(size):
            if row[i] != 0.0:
                total += row[i] * gain[i]
                left -= row[i] * change[i]
        ratio = left * left / total
        if not ratio <= limit:
            found[m] = -1.0 - ratio
            continue
        found[m] = ratio
        for i in range(size):
            change[i] += gain[i] * left / total
        for i in range(size):
            for j in range(size):
                covariance[i, j] -= gain[i] * gain[j] / total
    return change


@numba.njit(**EXACTLY)
def correct(change, turn, place, velocity, rate_bias, force_bias, anchor, normal, delay, creep, softness, leader):
    """Add the error state to the state, in place.

    Args:
        change: (N,) correction of the error state.
        turn, place, velocity, anchor, normal: as in :func:`predict_step`.
        rate_bias, force_bias: (B, 3) biases of gyroscopes, rad/s, and accelerometers, m/s^2.
        delay, creep, softness: (1,) delay, s, creep and softness.
        leader: number of the bar whose rotation the errors of positions refer to.
    """
    bars = len(turn)
    lx, ly, lz = change[3 * leader], change[3 * leader + 1], change[3 * leader + 2]
    whole = turned_by(np.eye(3), lx, ly, lz)
    for b in range(bars):
        turn[b] = turned_by(turn[b], change[3 * b], change[3 * b + 1], change[3 * b + 2])
        place[b] = times_vector(whole, place[b]) + change[3 * (bars + b) : 3 * (bars + b) + 3]
        velocity[b] = times_vector(whole, velocity[b]) + change[3 * (2 * bars + b) : 3 * (2 * bars + b) + 3]
        rate_bias[b] += change[3 * (3 * bars + b) : 3 * (3 * bars + b) + 3]
        force_bias[b] += change[3 * (4 * bars + b) : 3 * (4 * bars + b) + 3]
    for e in range(len(anchor)):
        anchor[e] = times_vector(whole, anchor[e]) + change[3 * (5 * bars + e) : 3 * (5 * bars + e) + 3]
        normal[e] = times_vector(whole, normal[e])
    delay[0] += change[len(change) - 3]
    creep[0] += change[len(change) - 2]
    softness[0] += change[len(change) - 1]


@numba.njit(**EXACTLY)
def _add_cross(out, row, column, x, y, z, scale):
    """Add scale * (-[x y z] x), the slope of a point at a lever by a rotation, to a (3, 3) part of out."""
    out[row, column + 1] += scale * z
    out[row, column + 2] -= scale * y
    out[row + 1, column] -= scale * z
    out[row + 1, column + 2] += scale * x
    out[row + 2, column] += scale * y
    out[row + 2, column + 1] -= scale * x


@numba.njit(**EXACTLY)
def point_slopes(turn, place, bar, lever, leader, size):
    """Position of a point of a bar, and its slopes by the error state.

    Args:
        turn, place: rotations and reference points of the bars.
        bar: number of the bar.
        lever: (3,) from its reference point, bar axes.
        leader: number of the bar whose rotation the errors of positions refer to.
        size: size N of the error state.

    Returns:
        (3,) position, world, m; (3, N) slopes.
    """
    bars = len(turn)
    out = np.zeros((3, size))
    arm = times_vector(turn[bar], lever)
    here = place[bar]
    for k in range(3):
        out[k, 3 * (bars + bar) + k] = 1.0
    _add_cross(out, 0, 3 * leader, here[0], here[1], here[2], 1.0)
    _add_cross(out, 0, 3 * bar, arm[0], arm[1], arm[2], 1.0)
    return here + arm, out


@numba.njit(**EXACTLY)
def length_slopes(turn, place, pairs, levers, leader, size):
    """Cable lengths and their slopes by the error state.

    Args:
        turn, place: rotations and reference points of the bars.
        pairs: (C, 2) bars of each cable.
        levers: (C, 2, 3) attachments from the reference points, bar axes.
        leader: as in :func:`point_slopes`.
        size: size N of the error state.

    Returns:
        (C,) lengths, m; (C, N) slopes.
    """
    bars, cables = len(turn), len(pairs)
    length, slopes = np.empty(cables), np.zeros((cables, size))
    for c in range(cables):
        first, second = pairs[c, 0], pairs[c, 1]
        one, two = times_vector(turn[first], levers[c, 0]), times_vector(turn[second], levers[c, 1])
        along = place[second] + two - place[first] - one
        length[c] = math.sqrt(along[0] * along[0] + along[1] * along[1] + along[2] * along[2])
        along = along / max(length[c], 1e-9)
        for bar, arm, sign in ((first, one, -1.0), (second, two, 1.0)):
            x, y, z = sign * along[0], sign * along[1], sign * along[2]
            here = place[bar]
            for column, lever in ((3 * leader, here), (3 * bar, arm)):
                slopes[c, column] += lever[1] * z - lever[2] * y
                slopes[c, column + 1] += lever[2] * x - lever[0] * z
                slopes[c, column + 2] += lever[0] * y - lever[1] * x
            slopes[c, 3 * (bars + bar)] += x
            slopes[c, 3 * (bars + bar) + 1] += y
            slopes[c, 3 * (bars + bar) + 2] += z
    return length, slopes


@numba.njit(**EXACTLY)
def between_variances(
    rows, turned, moved, has_force, place, velocity, anchor, normal, anchored, endcap_bar, radius, leader
):  # fmt: skip
    """(n,) variances of measurements by errors of bars that have turned and moved since their last inertial samples.

    Args:
        rows: (n, N) slopes of the measurements by the error state.
        turned: (B,) variance of each bar's turn about an axis, rad^2.
        moved: (B, 2) standard deviations of velocity, m/s, and place, m, by each bar's accelerometer.
        has_force: (B,) 1 where the bar has an accelerometer; the leading one's moves the bars without, too.
        place, velocity: (B, 3) of each bar's reference point, world, m and m/s.
        anchor, normal: (E, 3) anchors, m, and unit normals, world.
        anchored: (E,) 1 where the endcap has an anchor, else 0.
        endcap_bar: (E,) bar of each endcap.
        radius: (E,) of the spheres, m.
        leader: number of the leading bar.
    """
    bars, out, slopes = len(turned), np.zeros(len(rows)), np.empty(3)
    for i in range(len(rows)):
        for b in range(bars):
            if turned[b] > 0.0:
                slopes[:] = rows[i, 3 * b : 3 * b + 3]
                for e in range(len(anchor)):
                    at = 3 * (5 * bars + e)
                    if anchored[e] != 0 and endcap_bar[e] == b:
                        _add_product(slopes, rows[i, at : at + 3], normal[e], -radius[e])
                    if anchored[e] != 0 and b == leader:
                        _add_product(slopes, rows[i, at : at + 3], anchor[e], 1.0)
                if b == leader:
                    for c in range(bars):
                        p, v = 3 * (bars + c), 3 * (2 * bars + c)
                        _add_product(slopes, rows[i, p : p + 3], place[c], 1.0)
                        _add_product(slopes, rows[i, v : v + 3], velocity[c], 1.0)
                out[i] += turned[b] * (slopes[0] ** 2 + slopes[1] ** 2 + slopes[2] ** 2)
            for k in range(3):
                slope = 0.0
                for c in range(bars):
                    if c == b or (b == leader and has_force[c] == 0):
                        p, v = 3 * (bars + c) + k, 3 * (2 * bars + c) + k
                        slope += moved[b, 0] * rows[i, v] + moved[b, 1] * rows[i, p]
                out[i] += slope * slope
    return out


@numba.njit(**EXACTLY)
def _add_product(out, a, b, scale):
    """Add scale * a x b to a vector."""
    out[0] += scale * (a[1] * b[2] - a[2] * b[1])
    out[1] += scale * (a[2] * b[0] - a[0] * b[2])
    out[2] += scale * (a[0] * b[1] - a[1] * b[0])
