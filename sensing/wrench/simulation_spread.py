"""Covariance of a wrench due to differences between simulated shells, as in training, and real ones.

    covariance = model.estimate(field).covariance + simulation_spread(force_n)

Notes:
    C = |F|^2 diag(s^2, s^2, s^2, l^2, l^2, l^2). Frames of the same simulator share its mesh and its law of contact,
    so no interval that was set on them holds the difference to another program, or to silicone. It grows with the load;
    l is a part of the radius, because shells of every size have the same number of elements along a meridian.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from sensing.wrench.load_scale import RELEASED_RADIUS_MM
from sensing.wrench.model import WrenchModel
from sensing.wrench.weight_files import SIMULATED

FORCE_SHARE = 0.004  # M: of the load, rms by which answers about our finest mesh are off (docs/foreign.md)
LEVER_M = 0.22e-3  # M: at D=130, by which the centre of pressure jumps on the mesh of the training (docs/contact.md)


def learned_from_simulation(model: object) -> bool:
    """Whether an estimator's training had no real frame."""
    return isinstance(model, WrenchModel) and bool(model.about.get(SIMULATED, False))


def simulation_spread(force_n: NDArray[np.float64], radius_mm: float) -> NDArray[np.float64]:
    """(6, 6) to add to the covariance of a wrench about the sphere's centre, N and N m.

    Args:
        force_n: (3,) of the wrench.
        radius_mm: of the outer sphere.
    """
    return np.asarray(float(force_n @ force_n) * _per_square_newton(radius_mm))


@cache
def _per_square_newton(radius_mm: float) -> NDArray[np.float64]:
    lever_m = LEVER_M * (radius_mm / RELEASED_RADIUS_MM)
    return np.diag([FORCE_SHARE**2] * 3 + [lever_m**2] * 3)
