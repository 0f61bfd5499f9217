"""Limits of the training data of a wrench model, and the distance of a field or contact from them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.wrench.kernels import beyond, contact_angles

Array = NDArray[np.float64]
LEAST_FORCE_N = 1.0  # E: at D=130 T=8: below it the line of action is noise
NORMAL_95 = 1.959964  # half width of the 95 % interval in standard deviations


@dataclass(frozen=True)
class Range:
    """Limits of the training data.

    Attributes:
        distance: largest norm of the whitened principal part.
        rest_px, rest_px_per_n: norm of what the principal fields leave, but for a few samples, without load and more
            for each newton of it.
        cells: cells (H, W) that count: usually valid, and in the disc that dots cover.
        force_n, tilt_deg: largest force and polar angle of the contact, but for a few samples; infinite in weights that
            do not say it.
        interval_n: half width of a force's 95 % interval from which on an answer is none; infinite where no contacts of
            other kinds taught the covariance.
    """

    distance: float
    rest_px: float
    cells: NDArray[np.bool_]
    force_n: float = math.inf
    tilt_deg: float = math.inf
    rest_px_per_n: float = 0.0
    interval_n: float = math.inf

    def __post_init__(self) -> None:
        """A limit that is no number would never be exceeded."""
        for name in ("distance", "rest_px", "force_n", "tilt_deg", "interval_n"):
            if not getattr(self, name) >= 0:
                raise ParameterError(f"range {name}={getattr(self, name):g}: need a number from 0", name=name)
        slope = self.rest_px_per_n
        if not 0 <= slope < math.inf:
            raise ParameterError(f"range rest_px_per_n={slope:g}: need a number from 0", name="rest_px_per_n")
        if not self.cells.any():
            raise ParameterError("range_cells: need at least one cell that counts", name="range_cells")

    def is_beyond(
        self, wrenches: Array, covariances: Array, radius_mm: float, load_scale: float = 1.0
    ) -> NDArray[np.bool_]:
        """(N,) whether answers are larger or further from the tip than those of training, or too uncertain.

        Args:
            wrenches: (N, 6) on the endcap about the sphere's centre, N and N m.
            covariances: (N, 6, 6).
            radius_mm: of the sphere.
            load_scale: how large the endcap's forces are (:mod:`sensing.wrench.load_scale`).
        """
        limits = self.force_n, self.tilt_deg, self.interval_n / NORMAL_95
        return np.asarray(beyond(wrenches, covariances, radius_mm, LEAST_FORCE_N * load_scale, limits))

    def leaves_too_much(self, rest_px: Any, force_n: Any) -> Any:
        """Whether the principal fields leave more of a field than of those of training under such a force."""
        return rest_px > self.rest_px + self.rest_px_per_n * force_n


def contact_angle_deg(wrenches: Array, radius_mm: float) -> Array:
    """(N,) polar angle from the tip at which the line of action of wrenches (N, 6) leaves the sphere; 0 below 1 N.

    Args:
        wrenches: on the endcap about the sphere's centre, in the loads of D=130 T=8, N and N m.
        radius_mm: of the sphere; 65 in those loads.
    """
    return np.asarray(contact_angles(np.ascontiguousarray(wrenches, float), radius_mm, LEAST_FORCE_N))


def range_measures(principal: Array, back: Array, inputs: Array) -> tuple[Array, Array]:
    """(N,) norm of the whitened principal part, and (N,) norm of the rest in px.

    Args:
        principal: (K, D) to whitened parts.
        back: (D, K), its inverse.
        inputs: (N, D) fields, px.
    """
    z = inputs @ principal.T
    return np.linalg.norm(z, axis=1), np.linalg.norm(inputs - z @ back.T, axis=1)
