"""Samples of a simple dome in closed form."""

import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.learning.samples import Samples

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")


SIDE = 6


PARAMS = EndcapParams(130, 8)


def bump_fields(wrenches, side=SIDE):
    """A simple dome: a push at a place spreads the field there, a pull across shifts it; a little nonlinear."""
    y, x = (np.mgrid[0:side, 0:side] + 0.5) * 2 / side - 1
    force, torque = wrenches[:, :3, None, None], wrenches[:, 3:, None, None]
    lever = np.stack([-torque[:, 1], torque[:, 0]], 1)[:, :, 0] / 2
    dx, dy = x - lever[:, 0, None], y - lever[:, 1, None]
    near = np.exp(-2 * (dx**2 + dy**2))
    push = -force[:, 2] / (1 + 0.03 * np.abs(force[:, 2]))
    u = 0.3 * push * dx * near + 0.2 * force[:, 0] * near - 0.5 * torque[:, 2] * y
    v = 0.3 * push * dy * near + 0.2 * force[:, 1] * near + 0.5 * torque[:, 2] * x
    return np.stack([u, v], axis=1)


def made_samples(paths=24, frames=12, seed=0, noise=0.01):
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(paths):
        end = rng.uniform(-1, 1, 6) * [6, 6, 10, 0.5, 0.5, 0.3] - [0, 0, 15, 0, 0, 0]
        rows.append(np.linspace(0, 1, frames)[:, None] * end)
    wrenches = np.concatenate(rows)
    fields = bump_fields(wrenches) + noise * rng.normal(size=(len(wrenches), 2, SIDE, SIDE))
    count = len(wrenches)
    path = np.repeat([f"made-{seed}-{k}" for k in range(paths)], frames)
    nan = np.full(count, np.nan)
    return Samples(
        fields.astype(np.float32), np.ones((count, SIDE, SIDE), bool), wrenches, path, np.full(count, "load"),
        np.tile(np.arange(frames) / 30, paths), np.linalg.norm(wrenches[:, :3], axis=1) > 0.3, nan, nan, nan, PARAMS,
        "dots", ("made",),
    )  # fmt: skip
