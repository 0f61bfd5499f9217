"""Gaussian priors of lens and mounting: their standard deviations (px, mm, degrees).

A photo of hand-painted dots, which scatter by half a pixel, determines well where each pixel looks on the dome, and
badly how focal length, pupil height and distortion share in it. So a calibration that always fitted everything would
make a good camera worse. Instead four hypotheses (:data:`HYPOTHESES`), each simpler than the next, are fitted and
compared by their evidence, which charges every further freedom for what it could have explained (Kass and Raftery
1995, doi:10.1080/01621459.1995.10476572).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cad.lens import camera_module
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.parameters import camera_vector


@dataclass(frozen=True)
class MountPrior:
    """Standard deviations about the nominal camera; ``inf`` leaves a number free.

    Attributes:
        centre_px: optical axis against the frame's centre at 480 rows (M: the visible disc lies within 10 px).
        k: distortion k1, k2 about those of the module at hand.
        tilt_deg: optical axis against the endcap's axis (E: four M2 screws in printed holes).
        lateral_mm: pupil off the endcap's axis (E: screw clearance).
        height_mm: pupil above the mating plane (E), about ``height_centre_mm``.
        height_centre_mm: ``None`` for ``params.camera_height_mm``.
        focal_share: focal length, relative.
    """

    centre_px: float = 8.0
    k: tuple[float, float] = (0.03, 0.02)
    tilt_deg: float = 2.0
    lateral_mm: float = 1.0
    height_mm: float = 1.5
    height_centre_mm: float | None = None
    focal_share: float = np.inf

    def deviations(self, start: MountedCamera, hold_lens: bool) -> Array:
        """(11,) in the order of :data:`sensing.camera.parameters.NAMES`; 0 where the lens is held."""
        camera, tilt = start.camera, np.radians(self.tilt_deg)
        centre = self.centre_px * camera.height_px / 480
        lens = [self.focal_share * camera.fx_px, centre, centre, *self.k]
        pose = [tilt, tilt, np.inf, self.lateral_mm, self.lateral_mm, self.height_mm]
        return np.array([*([0.0] * 5 if hold_lens else lens), *pose])

    def mean(self, start: MountedCamera, hold_lens: bool) -> Array:
        """(11,) mean of the prior: that of the start camera, except for parameters that the prior sets."""
        vector = camera_vector(start)
        if not hold_lens:
            vector[3:5] = camera_module().k[:2]
        if self.height_centre_mm is not None:
            vector[10] = self.height_centre_mm
        return vector


@dataclass(frozen=True)
class Hypothesis:
    """One way in which a camera may differ from the nominal one.

    Attributes:
        name: completes "the camera is ...".
        prior: what may differ, and by how much.
        odds: before the photo (E).
        exact: nothing differs at all.
    """

    name: str
    prior: MountPrior
    odds: float
    exact: bool = False


FOCAL_SHARE = 0.009  # E: wider than four photos of released sensors, 245.7 to 248.4 px (docs/optics.md)
OTHER_LENS = MountPrior(height_mm=1.5, focal_share=0.1)
SAME_LENS = MountPrior(k=(0.004, 0.002), height_mm=0.7, focal_share=FOCAL_SHARE)
HYPOTHESES = (
    Hypothesis("as designed", SAME_LENS, 0.25, exact=True),
    Hypothesis("mounted otherwise", replace(SAME_LENS, centre_px=0.0, k=(0.0, 0.0)), 0.35),
    Hypothesis("mounted otherwise, its lens off its nominal shape", SAME_LENS, 0.3),
    Hypothesis("fitted with another lens", OTHER_LENS, 0.1),
)
