"""Training in the loads of D=130 T=8 in the default silicone, for which units, limits and regularisation are set.

    model = rescaled(trained_on(in_reference_loads(samples)), wrench_scale(samples))

Only the two linear ends of the network and its range have units of load, so another scale gives the same network
(:mod:`sensing.wrench.load_scale`; torques scale with forces and the radius).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sensing.learning.samples import Samples
from sensing.wrench.load_scale import RELEASED_RADIUS_MM, load_scale, recorded_shear_mpa
from sensing.wrench.model import WrenchModel


def wrench_scale(of: Samples | WrenchModel) -> NDArray[np.float64]:
    """(6,) wrench of an endcap that corresponds to 1 N and 1 N m of D=130 T=8 in the default silicone, N and N m."""
    force = load_scale(of.design.wall_mm, recorded_shear_mpa(of.identity))
    return np.repeat([force, force * of.design.outer_radius_mm / RELEASED_RADIUS_MM], 3)


def in_reference_loads(samples: Samples) -> Samples:
    """The same fields with wrenches scaled to the loads of D=130 T=8."""
    return replace(samples, wrenches=samples.wrenches / wrench_scale(samples))


def rescaled(model: WrenchModel, factor: NDArray[np.float64]) -> WrenchModel:
    """The network with outputs and limits in other units of load.

    Args:
        model: weights of the network.
        factor: (6,) factors on forces and torques.
    """
    weights, covered = dict(model.weights), model.range
    weights["linear"] = (weights["linear"] * factor[:, None]).astype(np.float32)
    weights["units"] = (weights["units"] * factor).astype(np.float32)
    limits = replace(
        covered, force_n=covered.force_n * factor[0], rest_px_per_n=covered.rest_px_per_n / factor[0],
        interval_n=covered.interval_n * factor[0],
    )  # fmt: skip
    return replace(model, weights=weights, range=limits)
