"""Covariance of a wrench due to the uncertainty of the camera's calibration.

    spread = CameraSpread(seen, model, camera)                  # once, at the start
    covariance = model.estimate(field).covariance + spread.covariance(tracks)

Notes:
    With w(x) the model, x = A(c) d the field of the dots' displacements d under a camera c, and L L' the covariance of
    the camera's numbers, to first order cov(w) = sum over the columns l of L of q q', q = (dw/dx) (dA/dc l) d. The
    derivative of A is taken by central differences of one deviation, and dw/dx is the model's average one, because a
    new one for every frame would cost as much as the model. All products but the last are made at the start.
"""

from __future__ import annotations

import numpy as np

from cad.errors import ParameterError
from sensing.camera.mount import MountedCamera
from sensing.camera.parameters import camera_at, camera_vector
from sensing.records import DotTracks
from sensing.tracking.model_input import ModelInput
from sensing.wrench.model import Array, WrenchModel

NEGLIGIBLE = 1e-3  # a direction that adds less than this part of the largest one's gain is left out
STEPS = (1.0, 0.25, 0.05)  # deviations by which the camera is moved; the largest at which it still images the dots


class CameraSpread:
    """Covariance of the wrench that comes from the camera.

    Args:
        seen: the path from picture to field.
        model: reads the field.
        camera: assumed by ``seen``, with a covariance.

    Raises:
        ParameterError: a camera without covariance.
    """

    def __init__(self, seen: ModelInput, model: WrenchModel, camera: MountedCamera) -> None:
        if camera.covariance is None:
            raise ParameterError("camera without covariance: nothing to propagate; calibrate again", name="camera")
        self._known = seen.known
        gains = [
            self._gain(seen, model.slope, camera, column) for column in independent_deviations(camera.covariance).T
        ]
        size = np.array([np.linalg.norm(gain) for gain in gains])
        keep = size > NEGLIGIBLE * size.max(initial=0.0)
        self._gains = np.array([gain for gain, kept in zip(gains, keep, strict=True) if kept])  # (r, 6, 2 n)
        self._gains = self._gains.reshape(-1, 6, 2 * int(np.count_nonzero(self._known)))

    def deviations(self, tracks: DotTracks) -> Array:
        """(r, 6) change of the wrench by one deviation of each independent direction of the camera; N, N m."""
        moved = np.where(tracks.lost[:, None], 0.0, tracks.displacement_px)[self._known]
        return np.asarray(self._gains @ moved.T.ravel())

    def covariance(self, tracks: DotTracks) -> Array:
        """(6, 6) to add to the covariance of a wrench about the sphere's centre."""
        deviations = self.deviations(tracks)
        return np.asarray(deviations.T @ deviations)

    def _gain(self, seen: ModelInput, slope: Array, camera: MountedCamera, column: Array) -> Array:
        """(6, 2 n) wrench by displacement for one deviation."""
        at = camera_vector(camera)
        for step in STEPS:
            moved = [seen.linear(camera_at(at + sign * step * column, camera)) for sign in (1, -1)]
            change = (moved[0] - moved[1]) / (2 * step)
            if np.isfinite(change).all():
                break
        return slope @ np.nan_to_num(change)


def independent_deviations(covariance: Array) -> Array:
    """(11, r) L with L L' = covariance, scaled before the decomposition because the units differ."""
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / safe / safe[:, None])
    use = values > 1e-12 * values.max(initial=0.0)
    return np.asarray((safe * (size > 0))[:, None] * vectors[:, use] * np.sqrt(values[use]))
