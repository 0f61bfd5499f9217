"""Shear fields of labelled states without pictures, as of tracked dots on domain-randomised sensors; for training.

Rendering and tracking a frame takes a hundred times as long, and one sensor's paint and mounting do not represent
others. So several domain-randomised sensors have every loading path, with the errors that calibration leaves of
the camera (:mod:`sensing.tracking.model_input` removes the rest), dots painted beside their place or not at all, and
tracking noise as measured on rendered frames (``python bench/bench_wrench.py tracking``). Tests use pictures and the
real tracker.

Displacements are those that windows show, if a set has them (``outline_mm``): a window tracks its dot's outline, and
where the skin bulges the outline moves 0.2 to 0.5 % less than the centre; taken for the centre, every force would be
too small by as much and more.

Displacements in mm (endcap frame) and full-size pixels; fields in pixels of the 200 x 200 crop.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import camera_at, camera_vector
from sensing.learning.found_camera import FRAME_PX, PAINT_PX, left_by_calibration
from sensing.tracking.field.operator import FieldOperator, field_operator
from sensing.tracking.gelslim import CROP_PX
from sensing.wrench.dot_noise import STILL_PX, moved_part

Array = NDArray[np.float64]
BORDER_PX = 9.0  # a dot whose centre is this near to the frame's edge is cut, and not tracked


@dataclass(frozen=True)
class Scatter:
    """Differences between sensors and errors of their tracking (standard deviations).

    Attributes:
        camera: factor on the camera's uncertainty after a calibration from a rest picture
            (:func:`sensing.learning.found_camera.left_by_calibration`).
        paint_px: error of a painted dot's place, px.
        unseen: part of the dots that are not found.
        still_px, moving_px, share: tracking error of one axis, px: of a dot at rest; of one that has moved (its share
            at a displacement: :func:`sensing.wrench.dot_noise.moved_part`); and as part of its displacement.
            Compression and sampling cause equal errors in every picture of a dot at rest, which cancel; a dot that has
            moved by a third of a pixel lies on other pixels (M: bench/tracker_noise.py).
    """

    camera: float = 1.0
    paint_px: float = PAINT_PX
    unseen: float = 0.03
    still_px: float = STILL_PX
    moving_px: float = 0.0288
    share: float = 0.006

    def tracking_px(self, far_px: Array) -> Array:
        """Standard deviation of an axis of a tracked dot after a displacement, px."""
        squares = self.still_px**2 + (self.moving_px * moved_part(far_px)) ** 2 + (self.share * far_px) ** 2
        return np.asarray(np.sqrt(squares))


PLAIN = Scatter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sensor without errors


class MarkerSensor:
    """One domain-randomised sensor.

    Args:
        design: design of the endcap.
        shape: (H, W) of its fields.
        scatter: its differences from the nominal sensor.
        rng: random numbers of the sensor and of the noise of every frame.
    """

    def __init__(
        self, design: EndcapParams, shape: tuple[int, int], scatter: Scatter, rng: np.random.Generator
    ) -> None:
        self._scatter, self._rng = scatter, rng
        self._camera = nominal_mount(design, *FRAME_PX)
        if scatter.camera:
            vector, left = camera_vector(self._camera), scatter.camera * _root(design)
            self._camera = camera_at(vector + left @ rng.standard_normal(len(vector)), self._camera)
        centre = np.array([0.0, 0.0, design.centre_height_mm])
        self.rest_mm = centre + design.inner_radius_mm * np.array([dot.direction for dot in dot_pattern(design)])
        place = self._pixels(self.rest_mm)
        inside = ((place > BORDER_PX - 0.5) & (place < np.array(FRAME_PX) - BORDER_PX - 0.5)).all(axis=1)
        self._seen = inside & (rng.random(len(place)) >= scatter.unseen)
        self._place = place[self._seen]
        self._beside = scatter.paint_px * rng.standard_normal(self._place.shape)
        self._gradient = field_operator(self._place, FRAME_PX, (1, 1)).gradient
        self.operator: FieldOperator = field_operator(self._place + self._beside, FRAME_PX, shape)

    def fields(self, moved_mm: NDArray) -> NDArray[np.float32]:
        """(N, 2, H, W) fields of displacements (N, d, 3), mm, of all dots of the pattern, as windows show them."""
        moved = self._pixels(self.rest_mm[self._seen] + moved_mm[:, self._seen]) - self._place
        slope = np.einsum("kd,ndc->nkc", self._gradient, moved, optimize=True)  # x, then y derivatives at the dots
        count = len(self._place)
        moved += self._beside[:, :1] * slope[:, :count] + self._beside[:, 1:] * slope[:, count:]
        spread = self._scatter.tracking_px(np.linalg.norm(moved, axis=2))
        moved += spread[:, :, None] * self._rng.standard_normal(moved.shape)
        cells = np.einsum("ndc,dk->nck", moved, self.operator.to_cells, optimize=True)
        return (cells * (CROP_PX / min(FRAME_PX))).reshape(len(moved), 2, *self.operator.shape).astype(np.float32)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) whether a dot determines the cell."""
        return self.operator.reached

    def _pixels(self, points_mm: Array) -> Array:
        return self._camera.project(points_mm)


@lru_cache(maxsize=8)
def _root(design: EndcapParams) -> Array:
    """(11, 11) symmetric square root of the covariance that calibration leaves."""
    values, vectors = np.linalg.eigh(left_by_calibration(design))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
