"""Whether the camera that is assumed fits the rest picture, and what its uncertainty does to the wrench.

Looked at once a reference: a camera that does not fit is named with the command that calibrates it, its wrenches carry
the flag ``camera_misfit``, and their covariance grows by what the camera that does fit would change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensing.calibration.misfit import Misfit, camera_misfit
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import camera_vector
from sensing.live.core.config import EndcapConfig
from sensing.live.core.model import WrenchEstimator
from sensing.records import DotTracks, Wrench
from sensing.tracking.model_input import ModelInput
from sensing.wrench.camera_spread import CameraSpread
from sensing.wrench.model import WrenchModel

FLAG = "camera_misfit"


class CameraCheck:
    """Verdict on the camera of one sensor and reference.

    Args:
        endcap: its name and design. seen: the path from its pictures. estimator: reads the fields.
        camera: the calibrated one; None where the nominal one is assumed.

    Attributes:
        message: what is off and what to do, one line; empty where the camera fits.
        misfit: outcome of the test. flags: of its wrenches, ``camera_misfit`` or none.
    """

    def __init__(
        self, endcap: EndcapConfig, seen: ModelInput, estimator: WrenchEstimator, camera: MountedCamera | None
    ) -> None:
        tracker = seen.tracker
        self.misfit = camera_misfit(tracker.reference_px, tracker.size, endcap.params, camera)
        self.message = "" if self.misfit.fits else _advice(endcap, self.misfit, camera is not None)
        self.flags: frozenset[str] = frozenset() if self.misfit.fits else frozenset({FLAG})
        uncertain = _with_misfit(camera or nominal_mount(endcap.params, *tracker.size), self.misfit)
        self._spread = (
            CameraSpread(seen, estimator, uncertain)
            if isinstance(estimator, WrenchModel) and uncertain.covariance is not None
            else None
        )

    def widened(self, wrench: Wrench, tracks: DotTracks) -> Wrench:
        """The wrench, about the sphere's centre, with what the camera adds to its covariance."""
        if self._spread is None:
            return wrench
        return replace(wrench, covariance=wrench.covariance + self._spread.covariance(tracks))


def _with_misfit(assumed: MountedCamera, misfit: Misfit) -> MountedCamera:
    """The assumed camera, its covariance widened by the distance to the one found."""
    if misfit.found is None:
        return assumed
    apart = camera_vector(misfit.found.mounted) - camera_vector(assumed)
    covariance = np.outer(apart, apart)
    if misfit.found.mounted.covariance is not None:
        covariance = covariance + misfit.found.mounted.covariance
    return replace(assumed, covariance=covariance)


def _advice(endcap: EndcapConfig, misfit: Misfit, calibrated: bool) -> str:
    """The largest difference and the command; docs/live.md has the rest."""
    whose = f"{endcap.camera} does not fit this picture" if calibrated else "camera not calibrated"
    largest = misfit.reason.split("; ")[0].split(" (")[0]
    usual = endcap.diameter_mm == EndcapConfig.diameter_mm and endcap.wall_mm == EndcapConfig.wall_mm
    design = "" if usual else f" --diameter {endcap.diameter_mm:g} --wall {endcap.wall_mm:g}"
    zero = endcap.zero or f"{endcap.name}.npz"
    return f"{whose} ({largest}): run python -m sensing.calibrate --zero {zero}{design} --out {endcap.name}.json"
