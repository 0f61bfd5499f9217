"""The reference of a running endcap: taken from its frames beside the running one, compared, refused, undone.

A reference taken under load makes every later number wrong by that load, and nothing looks unusual. So it is refused

- where darkness hides dots;
- while the endcap is touched, and whenever the new picture differs from the last reference as a press would
  (:func:`press_n`: what a shift, turn or scale of the whole picture explains is the mounting and is allowed);
- at the start, without a last reference, when the dots lie elsewhere than the design's, seen by a camera that is free
  to be mounted otherwise (:func:`misplaced_px`; a press under some 20 N passes: paint scatters as much);

until it is confirmed. Forces in N, pixels of the full-size picture.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from cad.errors import EndcapError
from cad.params import EndcapParams
from sensing.calibration.dots import CalibrationError
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.rest_camera import most_misplaced_px
from sensing.camera.nominal import nominal_mount
from sensing.decode import decode_gray
from sensing.live.core.camera_check import CameraCheck
from sensing.live.core.dark_pictures import DarkPictures
from sensing.live.core.model import WrenchEstimator
from sensing.records import Frame
from sensing.tracking.dots import find_dots
from sensing.tracking.methods import FieldMethod
from sensing.tracking.model_input import ModelInput
from sensing.tracking.mounting import common_motion, without_motion
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import Zero, ZeroError, single_zero, take_zero

GAP_S, GAP_STEPS = 1.0, 3.0  # least gap between the frames of a reference, and of the longest step before
_ONE_AT_A_TIME = threading.Lock()  # or all endcaps would be slow together


class PressedError(ZeroError):
    """A reference that looks pressed; it is taken if the user confirms it."""


@dataclass(frozen=True)
class Reference:
    """A picture of the untouched endcap and the method set up with it."""

    zero: Zero
    method: FieldMethod


@dataclass(eq=False)
class _Request:
    """A request for a reference, with the frames collected for it."""

    confirmed: bool
    frames: list[Frame] = field(default_factory=list)


class ReferenceTaker:
    """Takes references for one endcap; another kind of request replaces the one before, even while it is being made.

    Args:
        name: of the endcap.
        params: its design.
        frames: averaged for a reference; 1 takes a single picture as it is, 0 none at all.
        build: sets up the method.
        estimator, most_n: a difference estimated as more is a press.
        gain: from the estimator's force to the endcap's, in whose newtons ``most_n`` is.
        check: of a method that was built; None for those without.

    Attributes:
        reason: why the last one was refused, or what goes on; empty when nothing does.
        pressed: whether confirming would help.
    """

    def __init__(
        self,
        name: str,
        params: EndcapParams,
        frames: int,
        build: Callable[[Zero], FieldMethod],
        estimator: WrenchEstimator,
        most_n: float,
        gain: float = 1.0,
        check: Callable[[FieldMethod], CameraCheck | None] = lambda _: None,
    ) -> None:
        self._name, self._params, self._count, self._build = name, params, frames, build
        self._estimator, self._most_n, self._gain, self._check = estimator, most_n, gain, check
        self._stopped = False
        self._dark = DarkPictures()
        self._lock = threading.Lock()  # of the fields below, which three threads change
        self._request: _Request | None = None  # None once it is answered
        self._made: Reference | EndcapError | None = None
        self._thread: threading.Thread | None = None
        self.reason, self.pressed = "", False

    @property
    def collecting(self) -> bool:
        """Whether frames are wanted."""
        request = self._request
        return request is not None and len(request.frames) < self._count

    @property
    def computing(self) -> bool:
        """Whether all frames of a request have come and it is not answered yet."""
        request = self._request
        return request is not None and 0 < self._count <= len(request.frames)

    def ask(self, confirmed: bool = False) -> None:
        """Begin with the next frame (any thread); ``confirmed`` takes it whatever it looks like.

        Asked again in the same way, the request goes on: a button pressed over and over must not hold it up.
        """
        with self._lock:
            if self._count and (self._request is None or self._request.confirmed is not confirmed):
                self._request, self._made = _Request(confirmed), None
                self.pressed, self.reason = False, "taking a new reference: leave it untouched"

    def ask_again(self) -> None:
        """Repeat the request after a refusal, unless there is a newer one."""
        with self._lock:
            if self._request is None:
                self._request = _Request(False)

    def cancel(self) -> bool:
        """Cancel a request (any thread); returns whether there was one whose reference is not in use yet."""
        with self._lock:
            asked = self._request is not None or self._made is not None
            self._request, self._made, self.reason = None, None, ""
            return asked

    def offer(self, frame: Frame, last: Zero | None) -> None:
        """One frame; the last one needed begins the work, in a thread of its own unless one picture is enough."""
        request = self._request
        if request is None or len(request.frames) == self._count:
            return
        if _after_gap(request.frames, frame):
            request.frames.clear()  # plugged in again, the camera may sit otherwise: no mean of both
        request.frames.append(frame)
        if len(request.frames) < self._count:
            return
        if self._count == 1:  # a file: nothing may be missed, so it is worth the wait
            self._make(request, None)
            return
        self._thread = threading.Thread(target=self._make, args=(request, last), daemon=True)
        self._thread.start()

    def take(self) -> Reference | None:
        """The new reference, once.

        Raises:
            EndcapError: why there is none, once.
        """
        with self._lock:
            made, self._made = self._made, None
            if isinstance(made, EndcapError):
                self.pressed, self.reason = isinstance(made, PressedError), str(made)
                raise made
            if made is not None:
                self.pressed, self.reason = False, ""
            return made

    def stop(self) -> None:
        """No reference will be needed any more (any thread)."""
        self._stopped = True

    def close(self, wait_s: float) -> None:
        """Stop, and wait for a reference that is being made: its thread runs compiled code."""
        self.stop()
        if self._thread is not None:
            self._thread.join(wait_s)

    def _make(self, request: _Request, last: Zero | None) -> None:
        made: Reference | EndcapError
        with _ONE_AT_A_TIME:
            if self._stopped or request is not self._request:
                return
            try:
                made = self._checked(request, last)
            except EndcapError as error:
                made = error
            except Exception as error:  # a bug must not end as a reference that never comes
                made = ZeroError(f"{type(error).__name__}: {error}")
        with self._lock:
            if request is self._request:
                self._request, self._made = None, made

    def _checked(self, request: _Request, last: Zero | None) -> Reference:
        single = self._count == 1
        zero = (
            single_zero(request.frames[0], self._name)
            if single
            else take_zero(request.frames, self._name, self._params)
        )
        if request.confirmed:
            return Reference(zero, self._build(zero))
        self._dark.require_brighter(zero.image)
        method = self._build(zero)
        self._dark.require_light(self._check(method), zero.image)
        if not single and isinstance(method, ModelInput):
            if last is not None and last.image.shape == zero.image.shape:
                before = self._build(last)
                assert isinstance(before, ModelInput)
                pressed_n = self._gain * press_n(before, zero, self._estimator, self._params)
                _require_unpressed(pressed_n, self._most_n)
            elif last is None:
                _require_design(misplaced_px(zero, self._params, method.tracker), most_misplaced_px(self._params))
        return Reference(zero, method)


def _after_gap(frames: Sequence[Frame], frame: Frame) -> bool:
    """Whether a frame comes after a gap that the camera's pace, known of two frames or more, does not explain."""
    steps_s = [one.time_s - other.time_s for other, one in pairwise([*frames, frame])]
    return len(steps_s) > 1 and steps_s[-1] > max(GAP_S, GAP_STEPS * max(steps_s[:-1]))


def press_n(before: ModelInput, new: Zero, estimator: WrenchEstimator, params: EndcapParams | None = None) -> float:
    """Force between a new reference and the last one, N, without the motion that the mounting explains.

    Args:
        before: method set up with the last reference; it starts anew.
        new: the other.
        estimator: field to wrench.
        params: the design; None takes the released.
    """
    frame = new.frame()
    gray = before.decode(frame)
    tracks = before.track(gray, frame.time_s)
    motion = common_motion(tracks, params)
    before.restart()
    if motion is None or not tracks.enough:  # another camera or endcap: nothing to compare with
        return 0.0
    still = without_motion(tracks, motion)
    return float(np.linalg.norm(estimator.estimate(before.field(still)).force_n))


def misplaced_px(zero: Zero, params: EndcapParams, tracker: DotTracker | None = None) -> float:
    """How far the dots lie from the design's, at 480 lines, in the 90 % quantile; 0 where they cannot be compared.

    That is where they cannot be assigned to those of the design.

    Args:
        zero: the reference.
        params: the design.
        tracker: that was set up with it; None finds the dots anew. One that works at half size has found others.
    """
    if tracker is not None and tracker.reduction == 1:
        dots, size = tracker.found, tracker.size
    else:
        gray = decode_gray(zero.frame())
        dots, size = find_dots(gray, params=params), (gray.shape[1], gray.shape[0])
    try:
        fitted = calibrate_from_dots(dots.position_px[~dots.cut], params, size, near=nominal_mount(params, *size))
    except CalibrationError:
        return 0.0
    return fitted.misplaced_px


def _require_unpressed(force_n: float, most_n: float) -> None:
    if force_n > most_n:
        raise PressedError(
            f"the new reference differs from the last as a press of {force_n:.1f} N would (at most {most_n:.1f}): let "
            "the endcap go and zero again, or confirm"
        )


def _require_design(misplaced: float, most_px: float) -> None:
    if misplaced > most_px:
        raise PressedError(
            f"the dots lie {misplaced:.1f} px from the design's (at most {most_px:.1f}): is it pressed? let it go; or "
            "confirm, or give a reference taken with python -m sensing.zero take"
        )
