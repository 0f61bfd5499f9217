"""Compiled predict step of the robot's filter: in numpy, its many small calls would take over a tenth of a core.

The error state holds three numbers each, in this order: rotations of the B bars (rad, world axes), positions (m),
velocities (m/s), gyroscope biases (rad/s), accelerometer biases (m/s^2), the E anchors (m); then delay (s), creep and
softness, one number each. The error of a position, a velocity or an anchor x is
``x_true - exp(rotation of the leading bar) x``. A rotation of the whole robot about the vertical, which no sensor
measures, is then the same vector at every estimate, so that the covariance of the heading does not shrink falsely
(invariant extended Kalman filter: Barrau and Bonnabel 2017, doi:10.1109/TAC.2016.2594085).
"""

# mypy: ignore-errors
from __future__ import annotations

import math

import numba
import numpy as np

from sensing.compiled import SHORT

EXACTLY = SHORT | {"fastmath": False}  # bits do not depend on what is inlined: helpers need not be


@numba.njit(**EXACTLY | {"cache": False})  # lies in its callers' files: it has a signature for each literal k
def _skew(out, k, x, y, z, scale):
    """Write scale * [x y z] x into out[k]."""
    out[k, 0, 0] = out[k, 1, 1] = out[k, 2, 2] = 0.0
    out[k, 0, 1], out[k, 0, 2] = -scale * z, scale * y
    out[k, 1, 0], out[k, 1, 2] = scale * z, -scale * x
    out[k, 2, 0], out[k, 2, 1] = -scale * y, scale * x


@numba.njit(**EXACTLY)
def turned_by(turn, x, y, z):
    """(3, 3) exp([x y z] x) turn: a rotation matrix after a rotation by a vector (Rodrigues' formula).

    Args:
        turn: (3, 3) rotation matrix.
        x, y, z: rotation vector, rad.
    """
    angle = math.sqrt(x * x + y * y + z * z)
    if angle > 1e-7:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / (angle * angle)
    else:
        a, b = 1.0, 0.5
    out = np.empty((3, 3))
    for k in range(3):
        u, v, w = turn[0, k], turn[1, k], turn[2, k]
        cx, cy, cz = y * w - z * v, z * u - x * w, x * v - y * u
        out[0, k] = u + a * cx + b * (y * cz - z * cy)
        out[1, k] = v + a * cy + b * (z * cx - x * cz)
        out[2, k] = w + a * cz + b * (x * cy - y * cx)
    return out


@numba.njit(**EXACTLY)
def _times(a, b):
    """(3, 3) a b; numba's own product needs scipy."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]
    return out


@numba.njit(**EXACTLY)
def times_vector(a, x):
    """(3,) a x."""
    out = np.empty(3)
    for i in range(3):
        out[i] = a[i, 0] * x[0] + a[i, 1] * x[1] + a[i, 2] * x[2]
    return out


@numba.njit(**EXACTLY)
def predict_step(
    covariance, turn, place, velocity, anchor, normal, anchored, rate, force, has_force, leader, endcap_bar, radius,
    roll, noise, walk, fade, step_s, gravity,
):  # fmt: skip
    """Predict step: moves state and covariance by a time step, in place.

    Args:
        covariance: (N, N) of the error state.
        turn: (B, 3, 3) bar to world.
        place, velocity: (B, 3) of each bar's reference point, world, m and m/s.
        anchor, normal: (E, 3) anchors, m, and unit normals, world.
        anchored: (E,) 1 where the endcap has an anchor, else 0.
        rate, force: (B, 3) angular velocity, rad/s, and specific force, m/s^2, without bias, bar axes.
        has_force: (B,) 1 where the bar has an accelerometer, 2 where the leading bar's is used, 0 without any.
        leader: number of the leading bar.
        endcap_bar: (E,) bar of each endcap.
        radius: (E,) of the spheres, m.
        roll: (E,) 1 where the sphere rolls, 0 where its anchor stands.
        noise: (B, 3) variances per second of angle, velocity, and velocity common to bars that use the leader's force.
        walk: (B, 2) variances per second of the gyroscope and accelerometer biases.
        fade: (B,) decay rate of the gyroscope biases, 1/s; the caller lets its own estimates decay likewise.
        step_s: time step.
        gravity: m/s^2.
    """
    bars, endcaps, size = len(turn), len(anchor), len(covariance)
    at, blocks = np.zeros((8 * bars + 4 * endcaps, 2), np.int64), np.zeros((8 * bars + 4 * endcaps, 3, 3))
    middle, spin, push = np.empty((bars, 3, 3)), np.empty((bars, 3)), np.zeros((bars, 3))
    for b in range(bars):
        spin[b] = times_vector(turn[b], rate[b])
        middle[b] = turned_by(turn[b], 0.5 * step_s * spin[b, 0], 0.5 * step_s * spin[b, 1], 0.5 * step_s * spin[b, 2])
        if has_force[b] == 1:
            push[b] = times_vector(middle[b], force[b])
    drive = np.zeros((bars, size, 3))  # Jacobian of the error state by a rotation of a bar, as rate noise causes
    for i in range(3 * bars):
        drive[i // 3, i, i % 3] = 1.0
    count = _bar_blocks(at, blocks, drive[leader], middle, push, place, velocity, has_force, leader, step_s, gravity)
    count = _fade(at, blocks, count, fade, step_s)
    moved = np.zeros((endcaps, 3))
    for e in range(endcaps):
        if anchored[e] != 0:
            row, b = 3 * (5 * bars + e), endcap_bar[e]
            count = _follow(at, blocks, drive[leader], count, row, anchor[e], middle[leader], leader, bars, step_s)
            if roll[e] != 0:
                _add_cross(drive[b], row, normal[e], -radius[e])
                reach = radius[e] * step_s
                count = _roll(at, blocks, count, row, moved[e], normal[e], spin[b], middle[b], b, leader, bars, reach)
    _congruence(covariance, at, blocks, count)
    _add_noise(covariance, drive, noise, walk, leader, step_s)
    for b in range(bars):
        change = np.zeros(3)
        if has_force[b] > 0:
            f = push[b] if has_force[b] == 1 else push[leader]
            change[0], change[1], change[2] = step_s * f[0], step_s * f[1], step_s * (f[2] - gravity)
        turn[b] = turned_by(turn[b], step_s * spin[b, 0], step_s * spin[b, 1], step_s * spin[b, 2])
        for k in range(3):
            place[b, k] += step_s * (velocity[b, k] + 0.5 * change[k])
            velocity[b, k] += change[k]
    anchor += moved


@numba.njit(**EXACTLY)
def _add_cross(out, row, n, scale):
    """Add scale * [n] x to three rows of out."""
    out[row, 1] -= scale * n[2]
    out[row, 2] += scale * n[1]
    out[row + 1, 0] += scale * n[2]
    out[row + 1, 2] -= scale * n[0]
    out[row + 2, 0] -= scale * n[1]
    out[row + 2, 1] += scale * n[0]


@numba.njit(**EXACTLY)
def _follow(at, blocks, drive, count, row, x, middle, leader, bars, step_s):
    """Write blocks of the error of x, which rotates with the leader, by bias and noise of the leader's gyroscope."""
    at[count, 0], at[count, 1] = row, 3 * (3 * bars + leader)
    _skew(blocks, count, x[0], x[1], x[2], 1.0)
    drive[row : row + 3] = blocks[count]
    blocks[count] = -step_s * _times(blocks[count], middle)
    return count + 1


@numba.njit(**EXACTLY)
def _bar_blocks(at, blocks, drive, middle, push, place, velocity, has_force, leader, step_s, gravity):
    """Write blocks of all bars: rotations by biases, positions by velocities, velocities by rotations and biases."""
    bars, count = len(middle), 0
    for b in range(bars):
        p, v = 3 * (bars + b), 3 * (2 * bars + b)
        at[count, 0], at[count, 1] = 3 * b, 3 * (3 * bars + b)
        blocks[count] = -step_s * middle[b]
        at[count + 1, 0], at[count + 1, 1] = p, v
        for k in range(3):
            blocks[count + 1, k, k] = step_s
        count = _follow(at, blocks, drive, count + 2, p, place[b], middle[leader], leader, bars, step_s)
        count = _follow(at, blocks, drive, count, v, velocity[b], middle[leader], leader, bars, step_s)
        if has_force[b] == 0:
            continue
        source = b if has_force[b] == 1 else leader
        f = push[source]
        at[count, 0], at[count, 1] = v, 3 * (4 * bars + source)
        blocks[count] = -step_s * middle[source]
        at[count + 1, 0], at[count + 1, 1] = v, 3 * source
        _skew(blocks, count + 1, f[0], f[1], f[2], -step_s)
        at[count + 2, 0], at[count + 2, 1] = v, 3 * leader
        _skew(blocks, count + 2, f[0], f[1], f[2] - gravity, step_s)
        count += 3
    return count


@numba.njit(**EXACTLY)
def _fade(at, blocks, count, fade, step_s):
    """Write blocks of gyroscope biases that decay."""
    bars = len(fade)
    for b in range(bars):
        if fade[b] > 0.0:
            at[count, 0] = at[count, 1] = 3 * (3 * bars + b)
            for k in range(3):
                blocks[count, k, k] = math.expm1(-step_s * fade[b])
            count += 1
    return count


@numba.njit(**EXACTLY)
def _roll(at, blocks, count, row, moved, n, w, middle, bar, leader, bars, length):
    """Write blocks of an anchor that moves by w x n times a length, and the motion itself."""
    mx, my, mz = w[1] * n[2] - w[2] * n[1], w[2] * n[0] - w[0] * n[2], w[0] * n[1] - w[1] * n[0]
    moved[0], moved[1], moved[2] = length * mx, length * my, length * mz
    across = np.empty((3, 3, 3))
    _skew(across, 0, n[0], n[1], n[2], 1.0)
    _skew(across, 1, w[0], w[1], w[2], 1.0)
    _skew(across, 2, mx, my, mz, 1.0)
    at[count, 0], at[count, 1] = row, 3 * (3 * bars + bar)
    blocks[count] = length * _times(across[0], middle)  # d(w x n) = -n x dw, dw = -turn times the bias's error
    at[count + 1, 0], at[count + 1, 1] = row, 3 * bar
    blocks[count + 1] = length * _times(across[0], across[1])  # dw = error of the turn x w
    at[count + 2, 0], at[count + 2, 1] = row, 3 * leader  # the normal turns with the leader, and so does the anchor
    blocks[count + 2] = length * (across[2] - _times(across[1], across[0]))
    return count + 3


@numba.njit(**EXACTLY)
def _add_noise(covariance, drive, noise, walk, leader, step_s):
    """Add the process noise of one step."""
    bars, size = len(noise), len(covariance)
    for b in range(bars):
        turns, quiet = drive[b], noise[b, 0] * step_s
        for i in range(size):
            if turns[i, 0] != 0.0 or turns[i, 1] != 0.0 or turns[i, 2] != 0.0:
                for j in range(size):
                    dot = turns[i, 0] * turns[j, 0] + turns[i, 1] * turns[j, 1] + turns[i, 2] * turns[j, 2]
                    covariance[i, j] += quiet * dot
        for k in range(3):
            i = 3 * (2 * bars + b) + k
            covariance[i, i] += noise[b, 1] * step_s
            for c in range(bars):
                if noise[b, 2] > 0.0 and noise[c, 2] > 0.0:
                    covariance[i, 3 * (2 * bars + c) + k] += noise[leader, 2] * step_s
            i = 3 * (3 * bars + b) + k
            covariance[i, i] += walk[b, 0] * step_s
            i = 3 * (4 * bars + b) + k
            covariance[i, i] += walk[b, 1] * step_s


@numba.njit(**EXACTLY)
def _congruence(covariance, at, blocks, count):
    """(1 + A) P (1 + A)' in place; A has ``blocks`` at the rows and columns ``at``."""
    size = len(covariance)
    left = covariance.copy()
    for k in range(count):
        for i in range(3):
            for j in range(3):
                x = blocks[k, i, j]
                if x != 0.0:
                    target, source = left[at[k, 0] + i], covariance[at[k, 1] + j]
                    for c in range(size):
                        target[c] += x * source[c]
    across = left.T.copy()
    covariance[:] = across
    for k in range(count):
        for i in range(3):
            for j in range(3):
                x = blocks[k, i, j]
                if x != 0.0:
                    target, source = covariance[at[k, 0] + i], across[at[k, 1] + j]
                    for c in range(size):
                        target[c] += x * source[c]
    for i in range(size):
        for j in range(i):
            covariance[i, j] = covariance[j, i] = 0.5 * (covariance[i, j] + covariance[j, i])
