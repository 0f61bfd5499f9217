"""The field as the nominal camera would show it, whatever camera is built in: one set of weights for all sensors.

    seen = NominalField(tracker, model.shape, MountedCamera.load("camera.json"), params)      # sensing.calibrate
    wrench = model.estimate(seen.update(frame))

Hand assembly turns a camera by degrees and shifts it by half a millimetre; the same deformation then looks otherwise,
and the wrench comes out in the camera's axes. A calibrated camera says where on the undeformed inner sphere each pixel
looks; from there the nominal camera is a projection away. Dots leave the sphere by their displacement, so the view is
exact at rest, with an error of displacement times misalignment. Full-size pixels; fields in pixels of the 200 crop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.records import DotTracks, Frame, ShearField
from sensing.tracking.field_operator import field_operator
from sensing.tracking.gelslim import CROP_PX
from sensing.tracking.tracker import DotTracker

Array = NDArray[np.float64]


class NominalField:
    """Frames in, fields of the nominal camera out.

    Args:
        tracker: follows the dots. shape: (H, W) of the field. camera: the one built in. params: the endcap.
    """

    def __init__(
        self, tracker: DotTracker, shape: tuple[int, int], camera: MountedCamera, params: EndcapParams
    ) -> None:
        self.tracker = tracker
        self._camera, self._params, self._size = camera, params, tracker.size
        self._nominal = nominal_mount(params, *tracker.size)
        place = self.seen(tracker.reference_px)
        self._known = np.isfinite(place).all(axis=1)
        self._place = place[self._known]
        self._operator = field_operator(self._place, tracker.size, shape)

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame."""
        return self.field(self.tracker.update(frame))

    def field(self, tracks: DotTracks) -> ShearField:
        """Field of the tracks; all invalid while every dot is lost."""
        moved = self.seen(tracks.position_px[self._known]) - self._place
        moved = np.where(np.isfinite(moved), moved, 0.0)
        live = ~tracks.lost[self._known]
        channels = self._operator.field(self._operator.filled(moved, live)) * np.float32(CROP_PX / min(self._size))
        return ShearField(tracks.time_s, channels, valid=self._operator.valid(live))

    def seen(self, pixels: Array) -> Array:
        """(N, 2) where the nominal camera sees what the real one sees at (N, 2); NaN beyond the view."""
        centre = np.array([0.0, 0.0, self._params.centre_height_mm])
        rays, start = self._camera.rays_endcap(pixels), self._camera.pupil_endcap_mm - centre
        along = rays @ start
        root = np.sqrt(along**2 - start @ start + self._params.inner_radius_mm**2)
        return self._nominal.project(self._camera.pupil_endcap_mm + (root - along)[:, None] * rays)
