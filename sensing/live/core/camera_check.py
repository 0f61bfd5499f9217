"""Check of an endcap's camera: which one is used, how its uncertainty widens the covariance, doubts of the reference.

Looked at once a reference. An endcap without a calibration file is read with the camera that its rest picture shows
(:mod:`sensing.calibration.rest_camera`), and the command that keeps it is named. Where no camera can be found, or the
calibrated one does not fit any more, wrenches carry the flag ``camera_misfit``, and their covariance grows by what the
camera that does fit would change. A reference with too few dots or rows, too much or too little light has flags of its
own (:mod:`sensing.calibration.rest_picture`). Dots that scatter more than in training widen the covariance, too: as the
reference measured it, and as each picture shows it (:mod:`sensing.wrench.dot_noise`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensing.calibration.command_for import calibrate_command
from sensing.calibration.misfit import Misfit
from sensing.calibration.rest_camera import RestCamera
from sensing.calibration.rest_picture import picture_doubts
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import camera_vector
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import WrenchEstimator
from sensing.records import DotTracks, Wrench
from sensing.tracking.model_input import ModelInput
from sensing.tracking.zero import Zero
from sensing.wrench.camera_spread import CameraSpread
from sensing.wrench.dot_noise import DotNoise
from sensing.wrench.model import WrenchModel

FLAG = "camera_misfit"


class CameraCheck:
    """Verdict on the camera of one sensor and reference.

    Args:
        endcap: its name and design.
        rest: the camera in use, and how well the one that was assumed fits.
        seen: the path from pictures taken with it.
        estimator: reads the fields.
        zero: the reference.

    Attributes:
        rest: as given.
        message: what is off with the camera and what to do, one line; empty where it fits.
        flags: of all its wrenches.
        reason: for them, one line; empty where there are none.
    """

    def __init__(
        self, endcap: EndcapConfig, rest: RestCamera, seen: ModelInput, estimator: WrenchEstimator, zero: Zero
    ) -> None:
        self.rest = rest
        self.message = "" if rest.misfit.fits else _advice(endcap, rest)
        known = rest.known(endcap.params, seen.tracker.size)
        doubts = {} if known else {FLAG: "the camera does not fit the reference"}
        doubts |= picture_doubts(zero.image, seen.tracker.reference_px, endcap.params, known)
        self.flags, self.reason = frozenset(doubts), "; ".join(doubts.values())
        assumed = rest.camera or nominal_mount(endcap.params, *seen.tracker.size)
        uncertain = known or _with_misfit(assumed, rest.misfit)
        self._spread = (
            CameraSpread(seen, estimator, uncertain)
            if isinstance(estimator, WrenchModel) and uncertain.covariance is not None
            else None
        )
        self._noise = DotNoise(seen, estimator, zero.error_px) if isinstance(estimator, WrenchModel) else None

    @property
    def doubt(self) -> str:
        """Why all readings against this reference are flagged, and what to do, one line; empty where they are not."""
        return "; ".join(filter(None, (self.reason, self.message if FLAG in self.flags else "")))

    def widened(self, wrench: Wrench, tracks: DotTracks) -> Wrench:
        """The wrench, about the sphere's centre, with the covariance due to the camera and its noise added."""
        unknown = np.zeros((6, 6)) if self._noise is None else self._noise.covariance(tracks)
        if self._spread is not None:
            unknown = unknown + self._spread.covariance(tracks)
        return replace(wrench, covariance=wrench.covariance + unknown)


def _with_misfit(assumed: MountedCamera, misfit: Misfit) -> MountedCamera:
    """The assumed camera, its covariance widened by the distance to the one found."""
    if misfit.found is None:
        return assumed
    apart = camera_vector(misfit.found.mounted) - camera_vector(assumed)
    covariance = np.outer(apart, apart)
    if misfit.found.mounted.covariance is not None:
        covariance = covariance + misfit.found.mounted.covariance
    return replace(assumed, covariance=covariance)


def _advice(endcap: EndcapConfig, rest: RestCamera) -> str:
    """The largest difference and the command; docs/live.md has the rest."""
    calibrated = rest.camera is not None and not rest.found
    whose = f"{endcap.camera} does not fit this picture" if calibrated else "camera not calibrated"
    largest = rest.misfit.reason.split("; ")[0].split(" (")[0]
    command = calibrate_command(endcap.params, f"{endcap.name}.json", endcap.zero, rest.other_design)
    if rest.other_design:
        fix = f"give its diameter, or, if the one given is right, run {command} and name that file in endcaps.toml"
        return f"{whose} ({largest}): {rest.doubt}: {fix}"
    if rest.found:
        return f"{whose} ({largest}): taken from this picture; to keep it, run {command}"
    return f"{whose} ({largest}): {rest.doubt or f'run {command}'}"
