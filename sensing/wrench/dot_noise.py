"""Covariance of a wrench due to camera noise beyond that of the training data.

    covariance = model.estimate(field).covariance + noise_covariance(seen, model, zero.error_px)    # once a reference

Notes:
    The network's own covariance knows the noise of its training and cannot see more: it reads single fields. How much
    a dot scatters was measured when the reference was taken. The network bends most near rest (its answer to a dot's
    motion of 0.03 px is five times that of its slope at rest, and noise also shifts its mean), so no slope is used:
    fields of a dome at rest are drawn with the excess sqrt(noise^2 - trained^2), and N = mean of w w' over their
    wrenches w, which would be zero without noise. N holds the scatter, the shift, and it is never negative. Under load
    the answer bends less, so there N is on the safe side.
"""

from __future__ import annotations

import math

import numpy as np

from sensing.records import DotTracks
from sensing.tracking.model_input import ModelInput
from sensing.wrench.model import Array, WrenchModel

STILL_PX = 0.0063  # M: an axis of a dot at rest, at 480 rows (bench/tracker_noise.py); the training's too
DRAWS = 256  # E: N is known to a tenth


def noise_covariance(seen: ModelInput, model: WrenchModel, error_px: float) -> Array:
    """(6, 6) to add to the covariance of a wrench about the sphere's centre; zero where training had as much noise.

    Args:
        seen: the path from picture to field.
        model: reads the field.
        error_px: standard deviation of an axis of a dot at rest, full-size px.
    """
    tracker, unit = seen.tracker, min(seen.tracker.size) / 480.0
    excess_px = math.sqrt(max(error_px**2 - (STILL_PX * unit) ** 2, 0.0))
    if excess_px == 0.0:
        return np.zeros((6, 6))
    rng, rest, count = np.random.default_rng(0), tracker.reference_px, len(tracker.reference_px)
    sure, lost = np.ones(count), np.zeros(count, bool)
    fields = [
        seen.field(DotTracks(0.0, np.arange(count), rest, rest + moved, sure, lost, tracker.size)).channels.ravel()
        for moved in excess_px * rng.standard_normal((DRAWS, count, 2))
    ]
    wrenches = model.predict(np.array(fields, np.float64))[0]
    return np.asarray(wrenches.T @ wrenches / DRAWS)
