"""Limits of the training data, beyond which a wrench is flagged ``out_of_range`` (px, degrees, N of D=130 T=8).

A contact unlike those of training (a ball where planes were learned) bends the skin in ways that the principal fields
do not span. The residual that they leave grows with the load, and so does the limit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sensing.learning.fit_config import FitConfig
from sensing.learning.samples import Samples
from sensing.learning.symmetry import disc_cells, moved_inputs
from sensing.wrench.load_scale import RELEASED_RADIUS_MM
from sensing.wrench.model import WrenchModel
from sensing.wrench.range import Range, contact_angle_deg, range_measures
from sensing.wrench.tensors import pattern_of

Array = NDArray[np.float64]
# E: half width of a 95 % interval above which an answer is flagged, so that errors over 1 N on unseen bodies are.
LARGEST_INTERVAL_N = 0.75
RANGE_MARGIN = 1.3  # E: factor on the limits of the training data
LIGHT_N = 2.0  # E: force below which a field is mostly noise
OFTEN_ENOUGH = 0.999  # E: part of the samples that lies within the limits
USUALLY = 0.9  # part of the samples in which a usual cell is valid


def covered_range(
    weights: dict[str, NDArray[np.float32]], samples: Samples, config: FitConfig, side: int, start: WrenchModel | None,
    taught: bool,
) -> Range:  # fmt: skip
    """Range of weights, from their training samples.

    Args:
        weights: tensors of the weights by name.
        samples: training samples, in the loads of D=130 T=8 (:mod:`sensing.learning.reference_loads`).
        config: settings of the training, for its symmetries.
        side: number of cells along a side of the square grid.
        start: weights that were fine-tuned, in the same loads; their range stays covered, and their limit of intervals
            counts.
        taught: whether contacts of other kinds taught the covariance.
    """
    principal, back = weights["principal"].astype(np.float64), pattern_of(weights)
    measures = []
    for part in samples.blocks():
        seen = [range_measures(principal, back, moved_inputs(part.inputs, k, side)) for k in config.symmetries]
        measures.append(np.max(seen, axis=0))
    far, left = np.concatenate(measures, axis=1)
    distance = RANGE_MARGIN * float(far.max())
    size = np.linalg.norm(samples.wrenches[:, :3], axis=1)
    least, slope = _left(left, size)
    force = 1.05 * float(np.quantile(size, OFTEN_ENOUGH))
    tilt = 2.0 + float(np.quantile(contact_angle_deg(samples.wrenches, RELEASED_RADIUS_MM), OFTEN_ENOUGH))
    interval = LARGEST_INTERVAL_N if taught else math.inf
    if start is not None:  # it still covers the range of the weights that it started from
        known = start.range
        distance, force, tilt = max(distance, known.distance), max(force, known.force_n), max(tilt, known.tilt_deg)
        if np.array_equal(back, pattern_of(start.weights)):  # more fields leave a smaller residual
            least, slope = max(least, known.rest_px), max(slope, known.rest_px_per_n)
        if not taught:  # the limit is one of the network's own spread: what was flagged stays flagged
            interval = known.interval_n * float((weights["calibration"] / start.weights["calibration"])[:3].min())
    cells = (samples.valid.mean(axis=0) > USUALLY) & disc_cells((side, side))
    return Range(distance, least, cells, force, tilt, slope, interval)


def _left(rest_px: Array, force_n: Array) -> tuple[float, float]:
    """Limits of the residual that the principal fields leave: without load, px, and increase with the load, px/N.

    Args:
        rest_px: (N,) residuals of the samples, px.
        force_n: (N,) norms of their forces, N.
    """
    light = force_n < LIGHT_N
    if light.all() or not light.any():
        return RANGE_MARGIN * float(rest_px.max()), 0.0
    least = float(np.quantile(rest_px[light], OFTEN_ENOUGH))
    slope = float(np.quantile((rest_px[~light] - least) / force_n[~light], OFTEN_ENOUGH))
    return RANGE_MARGIN * least, RANGE_MARGIN * max(slope, 0.0)
