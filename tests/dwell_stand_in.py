"""A dwell test whose constants are known: what a model without rate effects reports under a dead weight."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from sensing.wrench.relaxation import advanced

STRENGTH, TAU_S = np.array([0.06, 0.04]), np.array([0.1, 1.0])


def creep(weight_n=15.0, dwell_s=6.0, after_s=5.0, noise_n=0.01, seed=0, rise_s=0.1, rate_hz=30.0, strength=STRENGTH):
    """(time, what the model reports) while a dead weight is put on and taken off; exact at every reading."""
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.8, 1.2, int((1 + dwell_s + after_s) * rate_hz)) / rate_hz)
    load = weight_n * np.clip((time_s - 1) / rise_s, 0, 1) * np.clip((1 + dwell_s - time_s) / rise_s, 0, 1)
    reported, state = np.zeros(len(time_s)), np.zeros((len(strength), 1))
    for k in range(1, len(time_s)):
        step = time_s[k] - time_s[k - 1]

        def gap(value, k=k, step=step, state=state):
            after = advanced(state, np.array([value - reported[k - 1]]), step, strength, TAU_S[: len(strength)])
            return value + after.sum() - load[k]

        reported[k] = brentq(gap, -2 * weight_n, 2 * weight_n)
        change = np.array([reported[k] - reported[k - 1]])
        state = advanced(state, change, step, strength, TAU_S[: len(strength)])
    return time_s, reported + noise_n * rng.normal(size=len(time_s)), load
