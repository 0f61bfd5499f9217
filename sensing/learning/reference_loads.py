"""Training in the loads of D=130 T=8 in the default silicone: its units, limits and regularisation are in those.

    model = rescaled(trained_on(in_reference_loads(samples)), wrench_scale(samples))

Only the two linear ends of the network and what it covers carry newtons, so another scale is the same network
(:mod:`sensing.wrench.load_scale`; torques go with forces and the radius).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sensing.learning.samples import Samples
from sensing.wrench.load_scale import RELEASED_RADIUS_MM, load_scale, recorded_shear_mpa
from sensing.wrench.model import WrenchModel


def wrench_scale(of: Samples | WrenchModel) -> NDArray[np.float64]:
    """(6,) wrench that is to an endcap what 1 N and 1 N m are to D=130 T=8 in the default silicone, N and N m."""
    force = load_scale(of.design.wall_mm, recorded_shear_mpa(of.identity))
    return np.repeat([force, force * of.design.outer_radius_mm / RELEASED_RADIUS_MM], 3)


def in_reference_loads(samples: Samples) -> Samples:
    """The same fields under the wrenches that are to D=130 T=8 what those of the samples are to their endcap."""
    return replace(samples, wrenches=samples.wrenches / wrench_scale(samples))


def rescaled(model: WrenchModel, factor: NDArray[np.float64]) -> WrenchModel:
    """The network with its outputs and limits in other units of load.

    Args:
        model: weights.
        factor: (6,) on forces and torques.
    """
    weights, covered = dict(model.weights), model.range
    weights["linear"] = (weights["linear"] * factor[:, None]).astype(np.float32)
    weights["units"] = (weights["units"] * factor).astype(np.float32)
    limits = replace(
        covered, force_n=covered.force_n * factor[0], rest_px_per_n=covered.rest_px_per_n / factor[0],
        interval_n=covered.interval_n * factor[0],
    )  # fmt: skip
    return replace(model, weights=weights, range=limits)
