"""The gain of one endcap's silicone: how much stiffer it is than that of the training data.

    wrench = Stiffness(gain=0.731, sd=0.008).applied(estimate)

Notes:
    At equal displacements of the markers all stresses of a hyperelastic shell, and with them the contact wrench, are
    proportional to its shear modulus (volume changes aside). So silicone of another hardness costs one factor for all
    six axes, not a 6 x 6 map. With w' = g w,  cov(w') = g^2 cov(w) + var(g) w w'.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from sensing.records import Wrench
from sensing.wrench.load_scale import RELEASED_SHEAR_MPA
from sensing.wrench.model import WrenchModel

OTHER_WEIGHTS = "gain_of_other_weights"  # flag of wrenches whose gain was found with another network


@dataclass(frozen=True)
class Stiffness:
    """A gain, dimensionless, and its standard deviation."""

    gain: float = 1.0
    sd: float = 0.0

    def applied(self, wrench: Wrench) -> Wrench:
        """The wrench of a model, for this silicone; the same record for a gain of exactly one."""
        if self.gain == 1.0 and self.sd == 0.0:
            return wrench
        value = np.concatenate([wrench.force_n, wrench.torque_nm])
        covariance = self.gain**2 * wrench.covariance + self.sd**2 * np.outer(value, value)
        moved = self.gain * value
        return replace(wrench, force_n=moved[:3], torque_nm=moved[3:], covariance=covariance)


def shear_mpa_of(estimator: object) -> float:
    """Shear modulus of the silicone that a model was trained on, MPa; of the default one for models without it."""
    return estimator.shear_mpa if isinstance(estimator, WrenchModel) else RELEASED_SHEAR_MPA


def load_scale_of(estimator: object) -> float:
    """How large the forces are that a model answers (:mod:`sensing.wrench.load_scale`); 1 of other estimators."""
    return estimator.load_scale if isinstance(estimator, WrenchModel) else 1.0


def weights_digest(estimator: object) -> str:
    """First 16 digits of the SHA-256 of a model's tensors; empty for other estimators."""
    if not isinstance(estimator, WrenchModel):
        return ""
    found = hashlib.sha256()
    for name in sorted(estimator.weights):
        tensor = np.ascontiguousarray(estimator.weights[name])
        found.update(f"{name} {tensor.shape}".encode() + tensor.tobytes())
    return found.hexdigest()[:16]
