"""Covariance of a wrench due to differences between simulated shells, as in training, and real ones.

    covariance = model.estimate(field).covariance + simulation_spread(force_n)

Notes:
    C = |F|^2 diag(s^2, s^2, s^2, l^2, l^2, l^2). Frames of the same simulator share its mesh and its law of contact,
    so no interval that was set on them holds the difference to another program, or to silicone. It grows with the load.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.wrench.model import WrenchModel
from sensing.wrench.weight_files import SIMULATED

FORCE_SHARE = 0.004  # M: of the load, rms by which answers about our finest mesh are off (docs/foreign.md)
LEVER_M = 0.22e-3  # M: by which the centre of pressure jumps on the mesh of the training (docs/contact.md)
_PER_SQUARE_NEWTON = np.diag([FORCE_SHARE**2] * 3 + [LEVER_M**2] * 3)


def learned_from_simulation(model: object) -> bool:
    """Whether an estimator's training had no real frame."""
    return isinstance(model, WrenchModel) and bool(model.about.get(SIMULATED, False))


def simulation_spread(force_n: NDArray[np.float64]) -> NDArray[np.float64]:
    """(6, 6) to add to the covariance of a wrench about the sphere's centre, N and N m.

    Args:
        force_n: (3,) of the wrench.
    """
    return float(force_n @ force_n) * _PER_SQUARE_NEWTON
