"""The compiled fits against numpy's own solvers: dots lost, dots far off, few dots."""

from __future__ import annotations

import numpy as np
import pytest

from sensing.tracking.motion_kernels import fitted_change, similarity

CENTRE = np.array([319.5, 239.5])


def fitted_by_numpy(before, after):
    """Shift, turn, scale and what is left, by numpy's least squares: scale cos, scale sin, shift x, shift y."""
    z, w = before - CENTRE, after - CENTRE
    keep = np.ones(len(z), bool)
    for _ in range(3):
        ones, zeros = np.ones(len(z)), np.zeros(len(z))
        rows = np.concatenate(
            [np.stack([z[:, 0], -z[:, 1], ones, zeros], 1), np.stack([z[:, 1], z[:, 0], zeros, ones], 1)]
        )
        both = np.tile(keep, 2)
        cos, sin, *shift = np.linalg.lstsq(rows[both], w.T.ravel()[both], rcond=None)[0]
        left = np.linalg.norm((w.T.ravel() - rows @ [cos, sin, *shift]).reshape(2, -1), axis=0)
        keep = left <= 2.5 * np.median(left)
    return (*shift, np.arctan2(sin, cos), np.hypot(cos, sin), np.sort(left)[-3])


@pytest.mark.parametrize("seed", range(20))
def test_a_similarity_is_that_of_numpys_least_squares(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(12, 300))
    before = rng.uniform(0, 480, (count, 2))
    turn, scale = rng.uniform(-0.1, 0.1), rng.uniform(0.95, 1.05)
    turned = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    after = (before - CENTRE) @ turned.T + CENTRE + rng.normal(0, 3, 2) + rng.normal(0, 0.3, (count, 2))
    after[: count // 7] += rng.normal(0, 20, (count // 7, 2))
    lost = rng.random(count) < 0.1
    found = similarity(before, after, lost, *CENTRE)
    assert found == pytest.approx(fitted_by_numpy(before[~lost], after[~lost]), abs=1e-9)


def test_four_dots_moved_as_one_leave_nothing():
    before = np.array([[100.0, 100.0], [400.0, 120.0], [300.0, 400.0], [200.0, 250.0]])
    shift_x, shift_y, turn, scale, left = similarity(before, before + np.array((2.0, -1.0)), np.zeros(4, bool), *CENTRE)
    assert (shift_x, shift_y, turn, scale, left) == pytest.approx((2.0, -1.0, 0.0, 1.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_a_change_of_gravity_is_that_of_numpys_least_squares(seed):
    rng = np.random.default_rng(seed)
    modes, moved = rng.normal(size=(200, 2, 3)) * [1.0, 1.0, 0.15], rng.normal(size=(200, 2))
    used, before = rng.random(200) < 0.9, rng.normal(size=3)
    change, *lengths = fitted_change(moved, modes, used, before)
    wanted = np.linalg.lstsq(modes[used].reshape(-1, 3), moved[used].ravel(), rcond=None)[0]
    assert change == pytest.approx(wanted, abs=1e-12)
    for length, by in zip(lengths, (wanted, before, np.zeros(3)), strict=True):
        assert length == pytest.approx(np.sort(np.linalg.norm((moved - modes @ by)[used], axis=1))[-3], abs=1e-12)
