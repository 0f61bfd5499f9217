"""Follows the painted dots from frame to frame, with a quality for each.

Per frame: decode to the working size (full size at 640 x 480), align every dot's window starting from the previous
frame (:mod:`sensing.tracking.patches`), judge it by correlation with the reference and by what its neighbours predict,
try bad ones again from that prediction and from rest, and search from scratch (:mod:`sensing.tracking.recovery`) when
many are bad. Searches run at half the working size, where they cost a sixteenth, and windows are then aligned at full
size. Lost dots come back by themselves, because they are tried in every frame.

Units: records are in full-size pixels; inside, pixels of the working picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.camera.dot_look import dot_look
from sensing.decode import FrameError, decode_gray, to_full_px, working_reduction
from sensing.records import DotTracks, Frame, Image
from sensing.tracking.dots import Dots, find_dots
from sensing.tracking.field_kernels import judge_dots, stretch_at_dots
from sensing.tracking.field_operator import LENGTH_PX, NOISE, FieldOperator, field_operator
from sensing.tracking.nearest import nearest_other
from sensing.tracking.patch_kernels import smooth_into, smoothed
from sensing.tracking.patches import ITERATIONS, STOP_PX, Patches, align, cut_patches
from sensing.tracking.recovery import WideSearch

FULL_SIZE_PX = 480  # half size costs 30 to 60 % more error in a wrench and saves a tenth of the time
RETRY_EVERY = 5  # frames between second attempts at dots that stay lost
FEWEST_JUDGES = 5  # inliers are not put in doubt by fewer than this
TRUST = (0.1, 0.4)  # leave-one-out residual of an inlier over the spacing, at least and at sure quality
VAGUE = 6.0  # a window whose place is this much less certain than the usual one's shows an edge, not a dot
FEWEST_WHOLE = 8  # with fewer dots than this, those that the frame's edge cuts are better than none
LARGEST_STRETCH = 0.5  # that a window starts from
LARGEST_DOTS = 2.0  # times the released size: windows grow with the dots up to it (4 mm at D = 100), then time counts
MOST_DROPPED = 12  # contradicted dots a judgement


@dataclass(frozen=True)
class TrackerConfig:
    """Knobs of the tracker; each has its curve in bench/bench_fields.py.

    Attributes:
        shape: (H, W) of the field that :class:`sensing.tracking.methods.DotField` makes of the tracks.
        least_quality: correlation under which a dot is bad.
        sure_quality: correlation from which the neighbours' opinion counts less.
        restart_share: share of bad dots from which all are searched from scratch.
        window: half width of a window over the dots' median diameter.
        length_px: length of the field's kernel at 480 px.
        noise: noise of the field's kernel.
        iterations: alignment steps a window at most.
        stop_px: a step this small ends the alignment, pixels of the working picture.
        short_side_px: the working picture keeps at least this (full size at 640 x 480).
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
        config: knobs.
        dots: dots in pixels of the working picture; found in the reference if not given.
        params: the endcap, whose dots are looked for; None for dots that look like the released ones.

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
        found = find_dots(gray, source=reference.source, params=params) if dots is None else dots
        larger = float(np.clip(dot_look(params).scale, 1.0, LARGEST_DOTS))
        largest = max(12, round(12 * larger * min(gray.shape) / FULL_SIZE_PX))
        half = int(np.clip(np.rint(self.config.window * float(np.median(found.diameter_px))), 4, largest))
        patches = cut_patches(self._image, found.position_px, half)
        kept = np.ones(len(found), bool) if dots is not None else _steady(found, patches)
        self.dots = found.only(kept)
        self._patches = patches.only(kept)
        self.reference_px = to_full_px(self.dots.position_px, self.reduction)
        self.operator: FieldOperator = field_operator(
            self.reference_px, self.size, self.config.shape, self.config.length_px, self.config.noise
        )
        self._spacing = _spacing(self.dots.position_px, fallback=0.1 * min(gray.shape))
        self._all = np.arange(len(self.dots))
        self._half, self._rest = half, self._image.copy()
        self.restart()

    @cached_property
    def wide(self) -> WideSearch:
        """The search for dots that have jumped; made when it is first needed, or asked for beforehand."""
        return WideSearch(self._rest, self.dots.position_px, self._half, self.operator)

    @cached_property
    def variance_per_loss(self) -> NDArray[np.float64]:
        """(N,) variance of an axis of a dot's place, full-size px^2, by what noise takes of its quality."""
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
        """Forget the frames before: the next answers are those of a new tracker, to the bit."""
        count = len(self.dots)
        self._patience = RETRY_EVERY - 1
        self._last = _Fit(np.zeros((count, 2)), np.zeros((count, 2, 2)), np.zeros(count), np.zeros(count, bool))

    def _follow(self, image: NDArray[np.float32]) -> _Fit:
        """The best fit of one frame; lost dots are where their neighbours put them."""
        fit = self._judged(self._refined(image, self._all, self._last.moved))
        if np.count_nonzero(fit.live) < (1 - self.config.restart_share) * len(fit.live):
            again = self._search(image)
            if again.live.sum() > fit.live.sum():
                fit = again
        return fit if fit.live.all() else self._retry(image, fit)

    def _refined(self, image: NDArray[np.float32], which: NDArray[np.int64], start: NDArray[np.float64]) -> _Fit:
        """Windows ``which`` aligned, from displacements ``start`` and the stretch that these imply."""
        moved = start.copy()
        stretch = stretch_at_dots(self.operator.gradient, moved * self.reduction, LARGEST_STRETCH)
        quality = align(image, self._patches, which, moved, stretch, self.config.iterations, self.config.stop_px)
        return _Fit(moved, stretch, quality, np.zeros(len(moved), bool))

    def _judged(self, fit: _Fit) -> _Fit:
        """Inliers: good correlation, and not far from what the other inliers predict."""
        moved, quality = fit.moved.copy(), fit.quality.copy()
        sure = (self.config.least_quality, self.config.sure_quality)
        live = judge_dots(
            self.operator.precision, moved, quality, self._spacing, sure, TRUST, FEWEST_JUDGES, MOST_DROPPED
        )
        return _Fit(moved, fit.stretch, quality, live)

    def _retry(self, image: NDArray[np.float32], fit: _Fit) -> _Fit:
        """Bad dots again, from the neighbours' prediction, from rest and from a search; the better correlation stays.

        Dots that were lost before start from their neighbours' prediction anyway and get this chance now and then.
        """
        self._patience += 1
        disturbed = self._last.live.mean() < 1 - self.config.restart_share
        worth = np.full(len(fit.live), True) if disturbed or self._patience % RETRY_EVERY == 0 else self._last.live
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


def _steady(dots: Dots, patches: Patches) -> NDArray[np.bool_]:
    """All but dots whose window slides along an edge, and those that the frame's edge cuts: what is seen of them moves
    otherwise than their centre, by up to 0.7 px, and the field's global bias hangs on the outermost dots.
    """
    steady = patches.uncertainty_px <= VAGUE * np.median(patches.uncertainty_px)
    if np.count_nonzero(steady & ~dots.cut) >= FEWEST_WHOLE:
        steady &= ~dots.cut
    return np.asarray(steady)


def _merged(fit: _Fit, trial: _Fit, better: NDArray[np.bool_]) -> _Fit:
    return _Fit(
        np.where(better[:, None], trial.moved, fit.moved),
        np.where(better[:, None, None], trial.stretch, fit.stretch),
        np.where(better, trial.quality, fit.quality),
        fit.live,
    )


def frame_size(frame: Frame) -> tuple[int, int]:
    """(width, height) in full-size pixels; decodes the frame if it does not say."""
    if frame.size is not None:
        return frame.size
    gray = decode_gray(frame)
    return gray.shape[1], gray.shape[0]


def _spacing(position: NDArray[np.float64], fallback: float) -> NDArray[np.float64]:
    """(N,) distance to the nearest other dot; ``fallback`` for a lone one or for coincident ones."""
    if len(position) < 2:
        return np.full(len(position), fallback)
    nearest, _ = nearest_other(position)
    return np.where(nearest > 1.0, nearest, fallback)
