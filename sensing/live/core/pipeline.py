"""Pipeline of one endcap: frame -> decode -> track -> field -> wrench -> filter -> contact, with stage times.

    pipeline = EndcapPipeline(EndcapConfig("endcap_0", "0"), load_model("default", params), zero)
    reading = pipeline.update(frame)                 # None before the first reference, and for a frame that came late

All other frames give a reading, which states whether its numbers are valid (:mod:`sensing.live.core.gate`).
Deterministic: after :meth:`EndcapPipeline.restart` the same frames give the same bits; replay relies on it.
Times in s on the frames' own clock, stage times in ms.
"""

from __future__ import annotations

import time
from dataclasses import replace
from weakref import WeakKeyDictionary

from cad.errors import EndcapError
from sensing.calibration.rest_camera import RestCamera, rest_camera
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.decode import sized
from sensing.live.core.camera_check import CameraCheck
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.kept import NOTHING_KEPT, Kept
from sensing.live.core.measurement import Measurement
from sensing.live.core.model import LiveModel
from sensing.live.core.reading import EndcapReading
from sensing.live.core.reference import Reference, ReferenceTaker
from sensing.live.core.state import NOTE_S, Event
from sensing.records import Frame
from sensing.tracking.methods import FieldMethod, field_method
from sensing.tracking.model_input import ModelInput
from sensing.tracking.tracker import DotTracker, frame_size
from sensing.tracking.zero import Zero

ZERO_FRAMES = 10  # averaged for a reference
KEPT_CAMERAS = 2  # cameras of earlier references: of the last one, and of the one that an undo returns to
JUMP_S = 0.5  # a capture time that steps back by more than this restarts the pipeline
FORWARD_S = 60.0  # so does one that steps forward by more than this


class EndcapPipeline:
    """Makes readings from the frames of one endcap. One thread updates it; any thread may call the requests.

    Args:
        endcap: its name and design.
        model: estimates the wrench.
        zero: the reference; without it the first ``zero_frames`` frames are (the endcap must be untouched).
        number: place in the list of endcaps.
        zero_frames: 1 takes a single picture as it is; 0 waits for :meth:`set_zero`, as a replay does.

    Attributes:
        outcome: event and reason of the last frame; None for one that came late.
        faults: number of frames that could not be used.
        taker: takes its references.
        epoch: see :class:`sensing.live.core.reading.EndcapReading`.
    """

    def __init__(
        self,
        endcap: EndcapConfig,
        model: LiveModel,
        zero: Zero | None = None,
        number: int = 0,
        zero_frames: int = ZERO_FRAMES,
    ) -> None:
        self.endcap, self.model, self.number, self.zero_frames = endcap, model, number, zero_frames
        self.faults, self.epoch = 0, 0
        self.outcome: tuple[Event, str] | None = None
        self._camera = None if endcap.camera is None else MountedCamera.load(endcap.camera, endcap.identity)
        most_n = model.threshold(endcap.contact_on_n, endcap.contact_off_n, endcap.gain).on_n
        self._cameras: dict[str, RestCamera] = {}
        self._checks: WeakKeyDictionary[FieldMethod, CameraCheck] = WeakKeyDictionary()
        self.taker = ReferenceTaker(
            endcap.name, endcap.params, zero_frames, self._build, model.estimator, most_n, endcap.gain, self._checks.get
        )
        self._check: CameraCheck | None = None
        self._used: Reference | None = None
        self._measurement: Measurement | None = None
        self._before: Reference | None = None
        self._restart_wanted, self._undo_wanted, self._note, self._note_until_s = False, False, "", 0.0
        if zero is not None:
            self.set_zero(zero)
        else:
            self._begin()
            self.taker.ask()

    # --- called from any thread -----------------------------------------------------------------------------------
    @property
    def zero(self) -> Zero | None:
        """The reference in use."""
        return None if self._used is None else self._used.zero

    def camera(self, width_px: int, height_px: int) -> MountedCamera:
        """Camera in use, for pictures of a size: the calibrated one, that of the reference, or the nominal."""
        camera = self._camera if self._check is None else self._check.rest.camera
        if camera is None:
            return nominal_mount(self.endcap.params, width_px, height_px)
        return replace(camera, camera=camera.camera.resized(width_px, height_px))

    @property
    def check(self) -> CameraCheck | None:
        """Camera and picture of the reference in use, judged; None before it, and for methods without dots."""
        return self._check

    @property
    def note(self) -> str:
        """Result of the last request or incident; after some seconds the fault of the camera, if there is one."""
        if self._used is not None and self.taker.collecting:
            return self.taker.reason
        lasting = "" if self._check is None else self._check.message
        return self._note if time.monotonic() < self._note_until_s and self._note else lasting

    @property
    def confirmable(self) -> bool:
        """Whether the last request for a reference was refused because of a press."""
        return self.taker.pressed

    @property
    def undoable(self) -> bool:
        """Whether there is an earlier reference to go back to."""
        return self._before is not None

    def request_zero(self, confirmed: bool = False) -> str:
        """Take a new reference from the next frames, or keep the old one; returns the reason of a refusal, or "".

        Args:
            confirmed: take it although the endcap is touched, or looks pressed.
        """
        contact = None if self._measurement is None else self._measurement.contact
        if self.zero_frames == 0:
            return self._say("not zeroed: a replay keeps the references of its recording")
        if not confirmed and contact is not None and contact.known and contact.touching:
            self.taker.pressed = True
            return self._say(f"not zeroed: touched with {contact.force_n:.1f} N; let it go and zero again, or confirm")
        self._say("")  # the next note is the answer
        self.taker.ask(confirmed)
        return ""

    def refuse_zero_without_frames(self) -> str:
        """No frame comes: a new reference would be of whatever the camera shows once it is back, so there is none."""
        self.taker.cancel()
        return self._say("not zeroed: no frame comes; zero again when the camera is back")

    def request_undo(self) -> str:
        """Return to the last reference, or cancel a request in progress; returns the reason of a refusal, or ""."""
        if self._used is not None and self.taker.cancel():
            return self._say("")
        if self._before is None:
            return self._say("no earlier reference to go back to")
        self._undo_wanted = True
        return ""

    def request_restart(self) -> None:
        """Start tracker, filter and contact anew at the next frame."""
        self._restart_wanted = True

    def stop(self) -> None:
        """Cancel requests for references, and accept no more."""
        self.taker.stop()

    def close(self, wait_s: float = 5.0) -> None:
        """Stop, and wait at most ``wait_s`` for a reference in progress: its thread runs compiled code."""
        self.taker.close(wait_s)

    # --- called from the thread of the loop -----------------------------------------------------------------------
    def update(self, frame: Frame, captured_s: float | None = None) -> EndcapReading | None:
        """The reading of one frame, or None: before the first reference, and for a frame that came late.

        Args:
            frame: the frame; its event is stored in ``outcome``.
            captured_s: capture time on this run's clock; None where it is the frame's own time.
        """
        refused, frame = self._take_over(), sized(frame)
        self.taker.offer(frame, self.zero)
        if self.zero_frames == 1:
            refused = self._take_over() or refused
        if self._measurement is None:
            self.outcome = (Event.REFUSED, refused) if refused else (Event.COLLECTED, "leave it untouched")
            return None
        self.outcome = None
        if not self._in_order(frame.time_s):
            return None
        reading = self._measurement.read(frame, frame.time_s if captured_s is None else captured_s)
        self.outcome = reading.event, reading.reason
        self.faults += not reading.valid
        return reading

    def set_zero(self, zero: Zero, kept: Kept = NOTHING_KEPT) -> None:
        """Use a reference from the next frame on.

        Args:
            zero: the reference.
            kept: state of earlier frames that were measured against it, as a recording has it.

        Raises:
            EndcapError: a reference without dots, one that cannot be decoded, or of another size than the camera file.
        """
        self._use(Reference(zero, self._build(zero)), kept)

    def restart(self, kept: Kept = NOTHING_KEPT) -> None:
        """Forget the frames before, but neither the reference nor what is ``kept``."""
        if self._used is not None:
            self._used = self._anew(self._used)
        self._begin(kept)

    def require_camera_of(self, frame: Frame) -> None:
        """Refuse pictures of another size than those that the camera file holds for.

        Raises:
            ParameterError: the sizes differ.
            FrameError: the frame cannot be decoded.
        """
        if self._camera is not None:
            self._camera.require_size(frame_size(frame), self.endcap.camera or "camera")

    def _begin(self, kept: Kept = NOTHING_KEPT) -> None:
        self._last_s = float("-inf")
        self._restart_wanted = False
        self.epoch += 1
        if self._used is not None:
            self._measurement = Measurement(
                self.endcap, self.model, self._used, self._check, self.number, self.epoch, kept
            )

    def _build(self, zero: Zero) -> FieldMethod:
        self.require_camera_of(zero.frame())
        if self.model.method == "dots":
            rest, tracker = self._rest_camera(zero)
            method = ModelInput(tracker, self.model.shape, self.endcap.params, rest.camera, self.model.radial)
            method.update(zero.frame())  # loads compiled code before the first live frame
            method.restart()
            _ = method.tracker.wide  # built now, not when dots are first lost
            self._checks[method] = CameraCheck(self.endcap, rest, method, self.model.estimator, zero)
            return method
        return field_method(self.model.method, zero.frame(), self.model.shape, self.endcap.params)

    def _anew(self, reference: Reference) -> Reference:
        """The reference with a method without history; a tracker is reused, as building one takes a second."""
        if isinstance(reference.method, ModelInput):
            reference.method.restart()
            return reference
        return Reference(reference.zero, self._build(reference.zero))

    def _rest_camera(self, zero: Zero) -> tuple[RestCamera, DotTracker]:
        """Camera and tracker of a reference; the camera is estimated once per picture and kept."""
        digest, tracker = zero.digest, DotTracker(zero.frame(), params=self.endcap.params)
        if (rest := self._cameras.get(digest)) is None:
            rest = rest_camera(zero.frame(), tracker.reference_px, self.endcap.params, self._camera)
            self._cameras = dict(list(self._cameras.items())[-KEPT_CAMERAS:]) | {digest: rest}
        return rest, tracker.only(rest.design_dots(tracker.reference_px, self.endcap.params, tracker.size))

    def _use(self, reference: Reference, kept: Kept = NOTHING_KEPT) -> None:
        self._used, self._check = reference, self._checks.get(reference.method)
        self._begin(kept)

    def _restart_in_use(self, clock_set: bool = False) -> None:
        """Restart, but keep what the next frames may not show: pose and mounting under a touch, and overstress."""
        if self._measurement is not None:
            self.restart(self._measurement.kept.on_another_clock if clock_set else self._measurement.kept)

    def _take_over(self) -> str:
        """Carry out requests between two frames; returns why the first reference was refused, or ""."""
        try:
            made = self.taker.take()
        except EndcapError as error:
            if self._used is None:
                self.taker.ask_again()
                return str(error)
            self._say(f"not zeroed: {error}")
            return ""
        if made is not None:
            self._before = self._used
            self._use(made)
            self._say("" if self._before is None else "zeroed")
        elif self._undo_wanted and self._before is not None:
            self._undo_wanted, before, self._before = False, self._before, None
            self._use(self._anew(before))
            self._say("back to the reference before")
        elif self._restart_wanted and self._used is not None:
            self._restart_in_use()
        return ""

    def _say(self, note: str) -> str:
        self._note, self._note_until_s = note, time.monotonic() + NOTE_S
        return note

    def _in_order(self, time_s: float) -> bool:
        """False for a frame that is not newer than the last; a clock that was set, or a long pause, restarts."""
        step = time_s - self._last_s
        if step != step or -JUMP_S < step <= 0:
            self.faults += 1
            self._say("a frame came late and was passed over")
            return False
        if self._last_s > float("-inf") and not -JUMP_S < step < FORWARD_S:
            self._restart_in_use(clock_set=step < 0)
            back, ahead = "the clock of the frames was set back by", "or their clock was set: started anew"
            self._say(f"{back} {-step:.1f} s: started anew" if step < 0 else f"no frame for {step:.0f} s, {ahead}")
        self._last_s = time_s
        return True
