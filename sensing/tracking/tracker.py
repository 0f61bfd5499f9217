"""Follows the painted dots from frame to frame, with a quality for each.

Per frame: decode to the working size (full size at 640 x 480); align every dot's window, starting from the previous
frame (:mod:`sensing.tracking.patches`); classify dots as inliers by the correlation with the reference and by the
prediction from their neighbours; align outliers again from that prediction and from rest; search for all dots anew
(:mod:`sensing.tracking.recovery`) when there are many outliers. Searches run at half the working size, where they cost
a sixteenth, and windows are then aligned at full size. Lost dots are tried again in later frames.

Units: records are in full-size pixels; inside, pixels of the working picture.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.decode import FrameError, decode_gray, to_full_px, working_reduction
from sensing.records import DotTracks, Frame, Image
from sensing.tracking.dots import Dots, find_dots
from sensing.tracking.field.kernels import find_inliers, stretch_at_dots
from sensing.tracking.field.operator import LENGTH_PX, NOISE, FieldOperator, field_operator
from sensing.tracking.patch_kernels import smooth_into, smoothed
from sensing.tracking.patches import ITERATIONS, STOP_PX, Patches, align, cut_patches
from sensing.tracking.recovery import WideSearch
from sensing.tracking.windows import FULL_SIZE_PX, half_width, spacing, steady

RETRY_EVERY = 5  # frames between second attempts at dots that stay lost
FEWEST_INLIERS = 5  # with fewer, no dot is rejected for its residual
RESIDUAL_LIMITS = (0.1, 0.4)  # leave-one-out residual of an inlier over the spacing, at least_ and at sure_quality
LARGEST_STRETCH = 0.5  # that a window starts from
MOST_DROPPED = 12  # dots rejected for their residual, per classification


@dataclass(frozen=True)
class TrackerConfig:
    """Parameters of the tracker; bench/bench_fields.py measures error and time over each.

    Attributes:
        shape: (H, W) of the field that :class:`sensing.tracking.methods.DotField` makes of the tracks.
        least_quality: correlation under which a dot is bad.
        sure_quality: correlation from which the larger limit of the leave-one-out residual holds.
        restart_share: share of bad dots from which all dots are searched for anew.
        window: half width of a window over the dots' median diameter.
        length_px: length of the field's kernel at a short side of 480 px.
        noise: variance of the measurement noise over that of the field's kernel.
        iterations: largest number of alignment steps per window.
        stop_px: a step this small ends the alignment, pixels of the working picture.
        short_side_px: least short side of the working picture (full size at 640 x 480).
    """

    shape: tuple[int, int] = (30, 30)
    least_quality: float = 0.7
    sure_quality: float = 0.9
    restart_share: float = 0.15
    window: float = 0.7
    length_px: float = LENGTH_PX
    noise: float = NOISE
    iterations: int = ITERATIONS
    stop_px: float = STOP_PX
    short_side_px: int = FULL_SIZE_PX

    def __post_init__(self) -> None:
        if not -1 < self.least_quality <= self.sure_quality < 1:
            raise ParameterError(
                f"least_quality={self.least_quality}, sure_quality={self.sure_quality}: need "
                "-1 < least_quality <= sure_quality < 1",
                name="least_quality",
                value=self.least_quality,
            )


class DotTracker:
    """Frames in, dot tracks out, against one undeformed reference.

    Args:
        reference: the undeformed picture.
        config: parameters; None for the defaults.
        dots: dots in pixels of the working picture; None finds them in the reference.
        params: design of the endcap whose dots are looked for; None for dots that look like the released ones.

    Attributes:
        found: what looks like a dot in the reference, in pixels of the working picture.
        dots: those that are followed.

    Raises:
        NoDotsError: the reference has no dots.
    """

    def __init__(
        self,
        reference: Frame,
        config: TrackerConfig | None = None,
        dots: Dots | None = None,
        params: EndcapParams | None = None,
    ) -> None:
        self.config = config or TrackerConfig()
        self.size = frame_size(reference)
        self.reduction = working_reduction(self.size, self.config.short_side_px)
        gray = decode_gray(reference, self.reduction)
        self._working_shape = gray.shape
        self._image = smoothed(gray)  # used again for every frame
        self._rest = self._image.copy()
        self.found = find_dots(gray, source=reference.source, params=params) if dots is None else dots
        self._params = params
        self._half = self._half_width(self.found)
        patches = cut_patches(self._image, self.found.position_px, self._half)
        kept = np.ones(len(self.found), bool) if dots is not None else steady(self.found, patches)
        self._take(self.found.only(kept), patches.only(kept))

    def only(self, which: NDArray[np.intp]) -> DotTracker:
        """A new tracker of some of the dots, as one made with these dots is; windows are cut once. Itself if of all.

        Args:
            which: their numbers, ascending.
        """
        if len(which) == len(self.dots):
            return self
        chosen = copy.copy(self)
        vars(chosen).pop("wide", None)
        chosen._image, dots = self._image.copy(), self.dots.only(which)
        chosen._half = chosen._half_width(dots)
        if chosen._half == self._half:
            patches = self._patches.only(which)
        else:  # another median of the diameters
            patches = cut_patches(self._rest, dots.position_px, chosen._half)
        chosen._take(dots, patches)
        return chosen

    def _half_width(self, dots: Dots) -> int:
        return half_width(dots, min(self._working_shape), self.config.window, self._params)

    def _take(self, dots: Dots, patches: Patches) -> None:
        """Follow these dots by these windows."""
        self.dots, self._patches = dots, patches
        self.reference_px = to_full_px(self.dots.position_px, self.reduction)
        self.operator: FieldOperator = field_operator(
            self.reference_px, self.size, self.config.shape, self.config.length_px, self.config.noise
        )
        self._spacing = spacing(self.dots.position_px, fallback=0.1 * min(self._working_shape))
        self._all = np.arange(len(self.dots))
        self.restart()

    @cached_property
    def wide(self) -> WideSearch:
        """The search for dots that have jumped; built on first use."""
        return WideSearch(self._rest, self.dots.position_px, self._half, self.operator)

    @property
    def variance_per_loss(self) -> NDArray[np.float64]:
        """(N,) variance of one axis of a dot's position, full-size px^2, per loss of quality due to noise."""
        return self._patches.variance_per_loss * self.reduction**2

    def update(self, frame: Frame) -> DotTracks:
        """Tracks of one frame.

        Raises:
            FrameError: the frame cannot be decoded or has another size than the reference.
        """
        return self.track(self.decode(frame), frame.time_s)

    def decode(self, frame: Frame) -> Image:
        """The frame as :meth:`track` takes it: gray, of the working size.

        Raises:
            FrameError: the frame cannot be decoded or has another size than the reference.
        """
        gray = decode_gray(frame, self.reduction)
        if gray.shape != self._working_shape:
            got = frame.size or tuple(side * self.reduction for side in gray.shape[::-1])
            raise FrameError(
                f"{frame.source}: frame of {got[0]}x{got[1]} px, the reference has {self.size[0]}x{self.size[1]}: "
                "take a new reference at this size"
            )
        return gray

    def track(self, gray: Image, time_s: float) -> DotTracks:
        """Tracks of a decoded frame captured at ``time_s``."""
        smooth_into(gray, self._image)
        fit = self._follow(self._image)
        self._last = fit
        lost = ~fit.live
        if lost.any():
            fit.quality[lost], fit.stretch[lost] = 0.0, np.nan
        return DotTracks(
            time_s=time_s,
            ids=self._all,
            reference_px=self.reference_px,
            position_px=self.reference_px + fit.moved * self.reduction,
            quality=fit.quality,
            lost=lost,
            size=self.size,
            stretch=fit.stretch,
        )

    def restart(self) -> None:
        """Forget all earlier frames: the next results are bit for bit those of a new tracker."""
        count = len(self.dots)
        self._frames_with_lost = RETRY_EVERY - 1
        self._last = _Fit(np.zeros((count, 2)), np.zeros((count, 2, 2)), np.zeros(count), np.zeros(count, bool))

    def _follow(self, image: NDArray[np.float32]) -> _Fit:
        """The best fit of one frame; lost dots get the position that their neighbours predict."""
        fit = self._judged(self._refined(image, self._all, self._last.moved))
        if np.count_nonzero(fit.live) < (1 - self.config.restart_share) * len(fit.live):
            again = self._search(image)
            if again.live.sum() > fit.live.sum():
                fit = again
        return fit if fit.live.all() else self._retry(image, fit)

    def _refined(self, image: NDArray[np.float32], which: NDArray[np.int64], start: NDArray[np.float64]) -> _Fit:
        """Windows ``which`` aligned, starting at displacements ``start`` and the stretch that these imply."""
        moved = start.copy()
        stretch = stretch_at_dots(self.operator.gradient, moved * self.reduction, LARGEST_STRETCH)
        quality = align(image, self._patches, which, moved, stretch, self.config.iterations, self.config.stop_px)
        return _Fit(moved, stretch, quality, np.zeros(len(moved), bool))

    def _judged(self, fit: _Fit) -> _Fit:
        """The fit with its inliers: good correlation, and near to the prediction from the other inliers."""
        moved, quality = fit.moved.copy(), fit.quality.copy()
        qualities = (self.config.least_quality, self.config.sure_quality)
        live = find_inliers(
            self.operator.precision,
            moved,
            quality,
            self._spacing,
            qualities,
            RESIDUAL_LIMITS,
            FEWEST_INLIERS,
            MOST_DROPPED,
        )
        return _Fit(moved, fit.stretch, quality, live)

    def _retry(self, image: NDArray[np.float32], fit: _Fit) -> _Fit:
        """Align bad dots again, from the neighbours' prediction, from rest and from a search; keep the better result.

        Dots that were lost in the last frame already started from the prediction: they are retried in every
        ``RETRY_EVERY``-th frame only.
        """
        self._frames_with_lost += 1
        disturbed = self._last.live.mean() < 1 - self.config.restart_share
        all_dots = disturbed or self._frames_with_lost % RETRY_EVERY == 0
        worth = np.full(len(fit.live), True) if all_dots else self._last.live
        for attempt in (self._from_neighbours, self._from_rest, self._from_search):
            bad = ~fit.live & worth
            if not bad.any():
                break
            trial = self._refined(image, np.flatnonzero(bad), attempt(image, fit))
            better = bad & (trial.quality > fit.quality)
            if better.any():
                fit = self._judged(_merged(fit, trial, better))
        return fit

    def _from_neighbours(self, image: NDArray[np.float32], fit: _Fit) -> NDArray[np.float64]:
        return fit.moved

    def _from_rest(self, image: NDArray[np.float32], fit: _Fit) -> NDArray[np.float64]:
        return np.where(fit.live[:, None], fit.moved, 0.0)

    def _from_search(self, image: NDArray[np.float32], fit: _Fit) -> NDArray[np.float64]:
        return self.wide.lost(image, fit.moved, fit.live)

    def _search(self, image: NDArray[np.float32]) -> _Fit:
        return self._judged(self._refined(image, self._all, self.wide.all(image)))


@dataclass(frozen=True)
class _Fit:
    """Displacement (N, 2) and stretch (N, 2, 2) in working pixels, correlation (N,) and inliers (N,)."""

    moved: NDArray[np.float64]
    stretch: NDArray[np.float64]
    quality: NDArray[np.float64]
    live: NDArray[np.bool_]


def _merged(fit: _Fit, trial: _Fit, better: NDArray[np.bool_]) -> _Fit:
    return _Fit(
        np.where(better[:, None], trial.moved, fit.moved),
        np.where(better[:, None, None], trial.stretch, fit.stretch),
        np.where(better, trial.quality, fit.quality),
        fit.live,
    )


def frame_size(frame: Frame) -> tuple[int, int]:
    """(width, height) in full-size pixels; decodes the frame if its size is unknown."""
    if frame.size is not None:
        return frame.size
    gray = decode_gray(frame)
    return gray.shape[1], gray.shape[0]
