"""One cap: frame -> decode -> track -> field -> wrench -> filter -> contact, with the time of every stage.

    pipeline = CapPipeline(CapConfig("endcap_0", "0"), load_model("default", params), zero)
    reading = pipeline.update(frame)                 # None while it is being zeroed, or for an unusable frame

Deterministic: after :meth:`CapPipeline.restart` the same frames give the same bits, which is what replay relies on.
Times in s of the frames' own clock, stages in ms.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np

from cad.errors import EndcapError
from sensing.camera.mount import MountedCamera
from sensing.decode import FrameError
from sensing.frames import T_sphere_endcap, inverse, wrench_adjoint
from sensing.live.core.camera_check import CameraCheck
from sensing.live.core.config import CapConfig
from sensing.live.core.model import LiveModel
from sensing.live.core.reading import CapReading
from sensing.records import DotTracks, Frame, Image, ShearField, Wrench
from sensing.tracking.methods import FieldMethod, field_method
from sensing.tracking.model_input import ModelInput, model_input
from sensing.tracking.zero import Drift, Zero, measure_drift, single_zero, take_zero
from sensing.wrench.contact import ContactDetector, ContactState
from sensing.wrench.contact_place import line_of_action
from sensing.wrench.filter import WrenchFilter

ZERO_FRAMES = 10  # averaged for a reference
DRIFT_EVERY = 30  # frames between looks at lamp and mounting
JUMP_S = 0.5  # capture times that go back by more than this, or ahead by a minute, are a clock that was set
AHEAD_S = 60.0
_PREPARING = threading.Lock()


class CapPipeline:
    """Frames of one cap in, readings out; not for two threads at once, but for the requests.

    Args:
        cap: its name and design. model: what tells the wrench. zero: the reference; without it the first
            ``zero_frames`` frames are (the cap must be untouched).
        number: place in the list of caps. zero_frames: 1 takes a single picture as it is; 0 waits for
            :meth:`set_zero`, as a replay does.

    Attributes:
        message: what is wrong or going on, in one line; empty when nothing is.
        faults: frames that could not be used. epoch: see :class:`sensing.live.core.reading.CapReading`.
    """

    def __init__(
        self,
        cap: CapConfig,
        model: LiveModel,
        zero: Zero | None = None,
        number: int = 0,
        zero_frames: int = ZERO_FRAMES,
    ) -> None:
        self.cap, self.model, self.number, self.zero_frames = cap, model, number, zero_frames
        self.message, self.faults, self.epoch, self.zero = "", 0, 0, zero
        self._to_endcap = wrench_adjoint(inverse(T_sphere_endcap(cap.params)))
        self._sphere = cap.params.outer_radius_mm, cap.params.centre_height_mm
        self._camera = None if cap.camera is None else MountedCamera.load(cap.camera)
        self._threshold = model.threshold(cap.contact_on_n, cap.contact_off_n)
        self._method: FieldMethod | None = None
        self._check: CameraCheck | None = None
        self._prepared: tuple[Zero, FieldMethod, CameraCheck | None] | EndcapError | None = None
        self._collected: list[Frame] | None = [] if zero is None and zero_frames > 0 else None
        self._preparing: threading.Thread | None = None
        self._restart_wanted, self._stopped = False, False
        self._drift: Drift | None = None
        if zero is not None:
            self.set_zero(zero)
        else:
            self._begin()

    def update(self, frame: Frame, captured_s: float | None = None) -> CapReading | None:
        """Work on one frame.

        Returns:
            The reading, or None: while zeroing, for a frame that is late or cannot be used (``message`` tells).
        """
        self._take_over()
        if self._collected is not None:
            self._collect(frame)
        if self._method is None or self.zero is None:
            return None
        if not self._in_order(frame.time_s):
            return None
        try:
            return self._read(frame, frame.time_s if captured_s is None else captured_s)
        except EndcapError as error:
            self.faults += 1
            self.message = str(error)
            return None

    def set_zero(self, zero: Zero) -> None:
        """Use a reference from the next frame on.

        Raises:
            EndcapError: a reference without dots, or one that cannot be decoded.
        """
        method = self._build(zero)
        self._use(zero, method, self._checked(method))

    def request_zero(self) -> None:
        """Take a new reference from the next frames; the old one serves until then, and stays if the cap is touched."""
        if self.zero_frames == 0:
            self.message = "not zeroed: a replay keeps the references of its recording"
            return
        self._collected = []

    def request_restart(self) -> None:
        """Start tracker, filter and contact anew at the next frame (any thread)."""
        self._restart_wanted = True

    def stop(self) -> None:
        """No reference will be needed any more (any thread)."""
        self._stopped = True

    def close(self, wait_s: float = 5.0) -> None:
        """Stop, and wait for a reference that is being prepared: its thread runs compiled code."""
        self.stop()
        if self._preparing is not None:
            self._preparing.join(wait_s)

    def restart(self) -> None:
        """Forget the frames before, not the reference."""
        if isinstance(self._method, ModelInput):
            self._method.restart()
        elif self.zero is not None:
            self._method = self._build(self.zero)
        self._begin()

    def _begin(self) -> None:
        self._filter, self._detector = WrenchFilter(), ContactDetector(self._threshold)
        self._last_s, self._count, self._drift = float("-inf"), 0, None
        self._restart_wanted = False
        self.epoch += 1

    def _build(self, zero: Zero) -> FieldMethod:
        if self.model.method == "dots":
            method = model_input(zero.frame(), self.model.shape, self.cap.params, self._camera)
            method.update(zero.frame())  # compiled code is loaded now, not in the first live frame
            method.restart()
            return method
        return field_method(self.model.method, zero.frame(), self.model.shape)

    def _checked(self, method: FieldMethod) -> CameraCheck | None:
        """Whether the camera fits the reference; None for methods that know no camera."""
        if not isinstance(method, ModelInput):
            return None
        return CameraCheck(self.cap, method, self.model.estimator, self._camera)

    def _use(self, zero: Zero, method: FieldMethod, check: CameraCheck | None) -> None:
        self.zero, self._method, self._check, self.message = zero, method, check, self._note(check)
        self._begin()

    @staticmethod
    def _note(check: CameraCheck | None) -> str:
        return "" if check is None else check.message

    # --- zero ------------------------------------------------------------------------------------------------
    def _collect(self, frame: Frame) -> None:
        assert self._collected is not None
        self._collected.append(frame)
        self.message = "zeroing: leave it untouched"
        if len(self._collected) < self.zero_frames:
            return
        frames, self._collected = self._collected, None
        if self.zero_frames == 1:  # a file: nothing may be missed, so it is worth the wait
            self._prepare(frames)
            self._take_over()
        else:
            self._preparing = threading.Thread(target=self._prepare, args=(frames,), daemon=True)
            self._preparing.start()

    def _prepare(self, frames: list[Frame]) -> None:
        """Average the frames and set up the method, beside the running one; one cap at a time, or all would be slow."""
        try:
            with _PREPARING:
                if self._stopped:
                    return
                single = self.zero_frames == 1
                zero = single_zero(frames[0], self.cap.name) if single else take_zero(frames, self.cap.name)
                method = self._build(zero)
                self._prepared = (zero, method, self._checked(method))
        except EndcapError as error:
            self._prepared = error

    def _take_over(self) -> None:
        prepared, self._prepared = self._prepared, None
        if isinstance(prepared, EndcapError):
            self.message = f"not zeroed: {prepared}"
            if self.zero is None:
                self._collected = []
        elif prepared is not None:
            self._use(*prepared)
        elif self._restart_wanted and self.zero is not None:
            self.restart()

    # --- one frame ---------------------------------------------------------------------------------------------
    def _in_order(self, time_s: float) -> bool:
        """False for a frame that is not newer than the last; a clock that was set starts everything anew."""
        step = time_s - self._last_s
        if step != step or -JUMP_S < step <= 0:
            self.faults += 1
            self.message = "a frame came late and was passed over"
            return False
        if self._last_s > float("-inf") and not -JUMP_S < step < AHEAD_S:
            self.restart()
            self.message = f"the clock of the frames jumped by {step:+.1f} s: started anew"
        elif self.message.startswith("a frame came late"):
            self.message = self._note(self._check)
        self._last_s = time_s
        return True

    def _read(self, frame: Frame, captured_s: float) -> CapReading:
        watch = _Watch()
        self._require_size(frame)
        tracks, field, gray = self._field(frame, watch)
        estimate = self.model.estimator.estimate(field)
        if self._check is not None and tracks is not None:
            estimate = self._check.applied(estimate, tracks)
        watch.lap("wrench")
        smooth = self._filter.update(estimate)
        watch.lap("filter")
        contact = self._judge(estimate, smooth)
        centre = line_of_action(smooth.force_n, smooth.torque_nm, *self._sphere)
        watch.lap("contact")
        assert self.zero is not None
        if self._count % DRIFT_EVERY == 0 and tracks is not None:
            self._drift = measure_drift(self.zero, frame, tracks, gray)
            watch.lap("drift")
        self._count += 1
        if not self.message.startswith(("zeroing", "not zeroed", "the clock")):
            self.message = self._note(self._check)
        return CapReading(
            self.cap.name, self.number, frame, tracks, field, self._told(estimate), self._told(smooth), contact, centre,
            self._drift, self.zero, self.epoch, captured_s, time.monotonic(), watch.stages,
        )  # fmt: skip

    def _told(self, wrench: Wrench) -> Wrench:
        """From the sphere's centre to the endcap's origin."""
        told = self._to_endcap @ np.concatenate([wrench.force_n, wrench.torque_nm])
        covariance = self._to_endcap @ wrench.covariance @ self._to_endcap.T
        return Wrench(wrench.time_s, told[:3], told[3:], "endcap", covariance, wrench.flags)

    def _require_size(self, frame: Frame) -> None:
        """Some methods would answer for any size."""
        assert self.zero is not None
        height, width = self.zero.image.shape[:2]
        if frame.size is not None and frame.size != (width, height):
            raise FrameError(
                f"{frame.source}: frame of {frame.size[0]}x{frame.size[1]} px, zeroed at {width}x{height}: set the "
                "camera's mode back, or zero again"
            )

    def _field(self, frame: Frame, watch: _Watch) -> tuple[DotTracks | None, ShearField, Image | None]:
        method = self._method
        if not isinstance(method, ModelInput):
            assert method is not None
            field = method.update(frame)
            watch.lap("field")
            return None, field, None
        gray = method.decode(frame)
        watch.lap("decode")
        tracks = method.track(gray, frame.time_s)
        watch.lap("track")
        field = method.field(tracks)
        watch.lap("field")
        return tracks, field, gray

    def _judge(self, estimate: Wrench, smooth: Wrench) -> ContactState:
        """Contact from the filtered wrench; an estimate that is none leaves the last known answer."""
        missing = "missing" in estimate.flags
        return self._detector.update(replace(smooth, force_n=np.full(3, np.nan)) if missing else smooth)


class _Watch:
    """Laps in ms."""

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.stages[name] = 1e3 * (now - self._last)
        self._last = now
