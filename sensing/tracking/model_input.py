"""From a picture to the input of a wrench model: tracked dots, mapped to the nominal camera, on a grid.

    seen = model_input(reference, model.shape, model.design)
    seen = model_input(reference, model.shape, model.design, MountedCamera.load("camera.json"), model.radial)
    wrench = model.estimate(seen.update(frame))

Training, evaluation, live, replay and the benches all use :class:`ModelInput`, so that a model never gets a field that
was computed in another way than in training. Only the positions of the dots are used, not the stretch that a window
measures, because a glint that half covers a dot looks like stretch.

Hand assembly turns a camera by degrees and shifts it by half a millimetre; the same deformation then gives another
picture, and the wrench would be in the camera's axes. A calibrated camera (:mod:`sensing.calibrate`) gives the ray of
each pixel, hence its point on the undeformed inner sphere, which the nominal camera projects. A pressed skin leaves the
sphere by a distance that the field determines; :mod:`sensing.tracking.parallax` subtracts the effect of it. Without a
calibrated camera the nominal one is assumed. Full-size pixels; fields in pixels of the 200 x 200 crop.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.records import DotTracks, Frame, Image, ShearField
from sensing.tracking.field.operator import displacement_to_cells, field_operator
from sensing.tracking.gelslim import CROP_PX
from sensing.tracking.parallax import radial_at_dots
from sensing.tracking.tracker import DotTracker, TrackerConfig

Array = NDArray[np.float64]
STEP_MM = 0.05  # step of the sphere's radius, to either side, in the numerical derivative of the view


class ModelInput:
    """Computes the fields that a wrench model takes, from frames.

    Args:
        tracker: follows the dots against the undeformed reference.
        shape: (H, W) of the field, the model's.
        params: design of the endcap.
        camera: calibrated camera of the endcap; None takes the nominal one.
        radial: (H W, 2 H W) radial displacement of the skin by the field, mm/px, of the weights
            (:attr:`sensing.wrench.model.WrenchModel.radial`); None does not correct the camera's parallax.

    Raises:
        ParameterError: a camera of another picture size than the reference.
    """

    def __init__(
        self, tracker: DotTracker, shape: tuple[int, int], params: EndcapParams, camera: MountedCamera | None = None,
        radial: Array | None = None,
    ) -> None:  # fmt: skip
        if camera is not None:
            camera.require_size(tracker.size)
        self.tracker = tracker
        self._camera, self._params, self._size = camera, params, tracker.size
        self._nominal = nominal_mount(params, *tracker.size)
        place = self.seen(tracker.reference_px)
        self._known = np.isfinite(self._on_skin(place)).all(axis=1)  # a blob outside the lens's view is not a dot
        self._place = place[self._known]
        self._operator = field_operator(self._place, tracker.size, shape)
        self._radial = None if radial is None else radial_at_dots(radial, self._operator, self._place, tracker.size)
        self._sideways = None if radial is None or camera is None else self._parallax()

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame.

        Raises:
            FrameError: the frame cannot be decoded or has another size than the reference.
        """
        return self.field(self.tracker.update(frame))

    def decode(self, frame: Frame) -> Image:
        """First step of :meth:`update`: the frame as the tracker takes it.

        Raises:
            FrameError: the frame cannot be decoded or has another size than the reference.
        """
        return self.tracker.decode(frame)

    def track(self, gray: Image, time_s: float) -> DotTracks:
        """Second step of :meth:`update`: the dots of a decoded frame captured at ``time_s``."""
        return self.tracker.track(gray, time_s)

    def motion(self, tracks: DotTracks) -> Array:
        """(n, 2) displacement of the :attr:`known` dots in the nominal camera's view, px; NaN beyond it."""
        return self.seen(tracks.position_px[self._known]) - self._place

    def field(self, tracks: DotTracks, without: Array | None = None) -> ShearField:
        """Third step of :meth:`update`: field of the tracks; all invalid while every dot is lost.

        Args:
            tracks: dots of the frame.
            without: (n, 2) displacement of the known dots in the nominal view, px, that is subtracted.
        """
        moved = self.motion(tracks)
        moved = np.where(np.isfinite(moved), moved, 0.0)
        if without is not None:
            moved = moved - without
        live = ~tracks.lost[self._known]
        moved = self._operator.filled(moved, live)
        if self._radial is not None and self._sideways is not None:
            moved = moved + self._sideways * (self._radial @ moved.T.ravel())[:, None]
        channels = self._operator.field(moved) * np.float32(CROP_PX / min(self._size))
        return ShearField(tracks.time_s, channels, valid=self._operator.valid(live))

    def restart(self) -> None:
        """Forget all earlier frames: the next results are bit for bit those of a new object."""
        self.tracker.restart()

    @property
    def nominal(self) -> MountedCamera:
        """The nominal camera of the design."""
        return self._nominal

    @property
    def points_mm(self) -> Array:
        """(n, 3) the :attr:`known` dots on the undeformed inner sphere, endcap frame."""
        return self._on_skin(self._place)

    @property
    def known(self) -> NDArray[np.bool_]:
        """(N,) dots of the tracker that enter the field: those that the camera sees on the skin."""
        return np.asarray(self._known)

    def linear(self, camera: MountedCamera | None) -> Array:
        """(2 H W, 2 n) map from small displacements of the :attr:`known` dots to the field, for another camera.

        Displacements and field: all x, then all y. The camera changes the places of the dots in the nominal view and
        the stretch of a pixel there; the tracker and its dots stay the same. All NaN where a dot leaves the view.
        """
        assumed, self._camera = self._camera, camera
        try:
            pixels = self.tracker.reference_px[self._known]
            place, step = self.seen(pixels), 0.5
            slopes = [(self.seen(pixels + e) - self.seen(pixels - e)) / (2 * step) for e in step * np.eye(2)]
            sideways = self._parallax()
        finally:
            self._camera = assumed
        if not (np.isfinite(place).all() and np.isfinite(slopes).all() and np.isfinite(sideways).all()):
            return np.full((2 * self._operator.reached.size, 2 * len(place)), np.nan)
        moved = np.block([[np.diag(slope[:, axis]) for slope in slopes] for axis in (0, 1)])
        if self._radial is not None:
            moved = moved + np.vstack([sideways[:, axis, None] * (self._radial @ moved) for axis in (0, 1)])
        to_cells = displacement_to_cells(place, self._size, self._operator.shape).T * (CROP_PX / min(self._size))
        return np.vstack([to_cells @ part for part in np.split(moved, 2)])

    def seen(self, pixels: Array, raised_mm: float = 0.0) -> Array:
        """(N, 2) pixels of the nominal camera for pixels (N, 2) of the real one; NaN beyond the view.

        Args:
            pixels: (N, 2) of the real camera.
            raised_mm: height of the skin outward of the undeformed inner sphere.
        """
        if self._camera is None:
            return pixels
        centre = (0.0, 0.0, self._params.centre_height_mm)
        return self._nominal.project(self._camera.on_sphere(pixels, centre, self._params.inner_radius_mm + raised_mm))

    def _on_skin(self, place: Array) -> Array:
        """(N, 3) points of the undeformed inner sphere, mm, at pixels (N, 2) of the nominal camera; NaN beyond it."""
        centre = (0.0, 0.0, self._params.centre_height_mm)
        return self._nominal.on_sphere(place, centre, self._params.inner_radius_mm)

    def _parallax(self) -> Array:
        """(n, 2) apparent shift of the known dots in the nominal view by a radial displacement, px/mm."""
        pixels = self.tracker.reference_px[self._known]
        return (self.seen(pixels, STEP_MM) - self.seen(pixels, -STEP_MM)) / (2 * STEP_MM)


def model_input(
    reference: Frame,
    shape: tuple[int, int],
    params: EndcapParams,
    camera: MountedCamera | None = None,
    radial: Array | None = None,
    config: TrackerConfig | None = None,
) -> ModelInput:
    """The :class:`ModelInput` of one sensor, with a new tracker.

    Args:
        reference: the undeformed picture.
        shape: (H, W) of the field, the model's.
        params: design of the endcap.
        camera: calibrated camera of the endcap; None takes the nominal one.
        radial: :attr:`sensing.wrench.model.WrenchModel.radial` of the weights, to correct the camera's parallax.
        config: parameters of the tracker.

    Raises:
        NoDotsError: the reference has no dots.
        FrameError: it cannot be decoded.
        ParameterError: a camera of another picture size.
    """
    return ModelInput(DotTracker(reference, config, params=params), shape, params, camera, radial)
