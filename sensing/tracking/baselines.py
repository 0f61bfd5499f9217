"""Other ways to the field, for comparison only: the report and the bench use them, the live pipeline does not.

All take frames and give :class:`ShearField` in pixels of the 200 x 200 crop, so that one bench judges them all.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from cad.params import EndcapParams
from sensing.decode import SHORT_SIDE_PX, decode_bgr, decode_gray, to_full_px, working_reduction
from sensing.records import Frame, Image, ShearField
from sensing.tracking.dots import find_dots
from sensing.tracking.field.operator import field_operator
from sensing.tracking.gelslim import CROP_PX, FARNEBACK, released_gray
from sensing.tracking.tracker import frame_size

BOX_PX = 21  # local mean that normalised images are divided by, in half-size pixels
LK_WINDOW = 15  # side of the windows, px of the working picture


class FarnebackField:
    """The released flow without its 25 x 25 pooling: the area mean of each cell.

    Args:
        reference: undeformed picture.
        shape: (H, W).
        flow: parameters of OpenCV's Farneback flow.
    """

    def __init__(
        self,
        reference: Frame,
        shape: tuple[int, int],
        flow: tuple[float, int, int, int, int, float, int] = FARNEBACK,
    ) -> None:
        self._shape, self._parameters = shape, flow
        self._reference = released_gray(decode_bgr(reference))

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame."""
        gray = released_gray(decode_bgr(frame))
        flow = cv2.calcOpticalFlowFarneback(self._reference, gray, None, *self._parameters)  # type: ignore[call-overload]
        mean = cv2.resize(flow, self._shape[::-1], interpolation=cv2.INTER_AREA)
        return ShearField(frame.time_s, np.moveaxis(mean, 2, 0).astype(np.float32))


class DisField:
    """Dense inverse search (Kroeger et al. 2016, doi:10.1007/978-3-319-46493-0_29), ultrafast preset, working size.

    Args:
        reference: undeformed picture.
        shape: (H, W).
        prepare: applied to both gray pictures first, for example :func:`normalised`.
        preset: OpenCV's quality preset, 0 (ultrafast) to 2 (medium).
        short_side_px: the working picture keeps at least this.
    """

    def __init__(
        self,
        reference: Frame,
        shape: tuple[int, int],
        prepare: Callable[[Image], Image] = lambda gray: gray,
        preset: int = cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
        short_side_px: int = SHORT_SIDE_PX,
    ) -> None:
        self._shape, self._prepare = shape, prepare
        self._reduction = working_reduction(frame_size(reference), short_side_px)
        self._reference = prepare(decode_gray(reference, self._reduction))
        self._flow = cv2.DISOpticalFlow_create(preset)  # type: ignore[attr-defined]

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame."""
        gray = self._prepare(decode_gray(frame, self._reduction))
        flow = self._flow.calc(self._reference, gray, None)
        height, width = gray.shape
        side = min(height, width)
        top, left = (height - side) // 2, (width - side) // 2
        square = np.ascontiguousarray(flow[top : top + side, left : left + side]) * (CROP_PX / side)
        mean = cv2.resize(square, self._shape[::-1], interpolation=cv2.INTER_AREA)
        return ShearField(frame.time_s, np.moveaxis(mean, 2, 0).astype(np.float32))


class LucasKanadeField:
    """Pyramidal Lucas-Kanade of the dots on raw images from the reference, without outlier test, same field operator.

    Args:
        reference: undeformed picture.
        shape: (H, W).
        params: the design, whose dots are looked for; None for dots that look like the released ones.
        window: side of the windows in working pixels.
        levels: pyramid levels beyond the first.
    """

    def __init__(
        self, reference: Frame, shape: tuple[int, int], params: EndcapParams | None = None, window: int = LK_WINDOW,
        levels: int = 2,
    ) -> None:  # fmt: skip
        self._options = {"winSize": (window, window), "maxLevel": levels}
        size = frame_size(reference)
        self._reduction = working_reduction(size)
        self._reference = decode_gray(reference, self._reduction)
        dots = find_dots(self._reference, source=reference.source, params=params)
        self._points = dots.position_px.astype(np.float32)[:, None]
        self._operator = field_operator(to_full_px(self._points[:, 0], self._reduction), size, shape)
        self._scale = CROP_PX / min(size) * self._reduction

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame."""
        gray = decode_gray(frame, self._reduction)
        place, _, _ = cv2.calcOpticalFlowPyrLK(self._reference, gray, self._points, None, **self._options)  # type: ignore[call-overload]
        moved = (place - self._points)[:, 0].astype(float) * self._scale
        return ShearField(frame.time_s, self._operator.field(moved).astype(np.float32))


def normalised(gray: Image) -> Image:
    """Gray over its local mean, 128 where equal: takes exposure and slow lamp gradients out."""
    mean = cv2.blur(gray, (BOX_PX, BOX_PX))
    return cv2.divide(gray, np.maximum(mean, 1), scale=128)
