"""One frame of an endcap to its reading: decode -> track -> field -> wrench -> gate -> filter -> contact.

    measurement = Measurement(config, model, reference, number, epoch)
    reading = measurement.read(frame, frame.time_s)

One object is used from one restart to the next. It holds all state that a reading takes from earlier frames, so that
the same frames after a restart give the same bits. Times in s on the frames' own clock, stage times in ms.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cad.materials import silicone
from sensing.decode import FrameError, decode_gray
from sensing.frames import T_sphere_endcap, inverse, wrench_adjoint
from sensing.live.core.camera_check import CameraCheck
from sensing.live.core.endcap_config import SUBTRACTED, EndcapConfig
from sensing.live.core.gate import DISTURBED, UNCONFIRMED, Gate, Verdict, likeness, small_picture
from sensing.live.core.kept import NOTHING_KEPT, Kept
from sensing.live.core.load_watch import FLAG as ZEROED_UNDER_LOAD
from sensing.live.core.load_watch import LoadWatch
from sensing.live.core.model import LiveModel
from sensing.live.core.picture_watch import PictureWatch
from sensing.live.core.reading import NO_CHANGE, NO_TREND, EndcapReading, without_numbers
from sensing.live.core.reference import Reference
from sensing.live.core.rest_offset import RestOffset
from sensing.live.core.seen import SeenFrame
from sensing.live.core.stage_times import StageTimes
from sensing.live.core.state import MEASURED, Event
from sensing.records import DotTracks, Frame, Image, ShearField, Wrench
from sensing.tracking.methods import FieldMethod
from sensing.tracking.model_input import ModelInput
from sensing.tracking.mounting import MountingWatch
from sensing.tracking.own_weight import OwnWeight
from sensing.tracking.zero import Drift, Zero, measure_drift
from sensing.wrench.contact import ContactDetector, ContactState
from sensing.wrench.contact_place import contact_centre
from sensing.wrench.filter import FilterConfig, WrenchFilter
from sensing.wrench.plane_contact import NO_CONTACT, PlaneContactLaw
from sensing.wrench.relaxation import RateFilter
from sensing.wrench.simulation_spread import learned_from_simulation, simulation_spread
from sensing.wrench.stiffness import OTHER_WEIGHTS, Stiffness, shear_mpa_of, weights_digest

DRIFT_EVERY = 30  # frames between checks of lamp and mounting, and for a reference taken under load
MOVED = "moved"  # flag: camera or lens, since the reference
COARSE = 8  # reduction at which methods without dots compare whole pictures


class Measurement:
    """Makes readings of one endcap against one reference, from frames in order.

    Args:
        endcap: its name, design and contact threshold.
        model: estimates the wrench.
        reference: picture of the untouched endcap, and the field method set up with it.
        check: result of the check of the camera with that picture; None for methods without dots.
        number, epoch: see :class:`sensing.live.core.reading.EndcapReading`.
        kept: state kept from the frames before a restart.

    Attributes:
        contact: state of contact at the last frame; None before the first.
    """

    def __init__(
        self,
        endcap: EndcapConfig,
        model: LiveModel,
        reference: Reference,
        check: CameraCheck | None,
        number: int,
        epoch: int,
        kept: Kept = NOTHING_KEPT,
    ) -> None:
        self._endcap, self._model, self._used, self._number, self._epoch = endcap, model, reference, number, epoch
        self._check, self._simulated = check, learned_from_simulation(model.estimator)
        self._to_endcap = wrench_adjoint(inverse(T_sphere_endcap(endcap.params)))
        self._stiffness = Stiffness(endcap.gain, endcap.gain_sd)
        self._plane = PlaneContactLaw(endcap.params, endcap.gain * shear_mpa_of(model.estimator))
        digest = weights_digest(model.estimator) if endcap.gain_weights else ""
        self._foreign = frozenset({OTHER_WEIGHTS} if endcap.gain_weights != digest else ())
        self._alike_to = small_picture(decode_gray(reference.zero.frame()))
        self._own_weight = (
            OwnWeight(reference.method, endcap.params, silicone(endcap.silicone))
            if isinstance(reference.method, ModelInput) and endcap.own_weight == SUBTRACTED
            else None
        )
        if self._own_weight is not None:
            self._own_weight.change_g = np.array(kept.own_weight_g)
        scale = endcap.gain * model.load_scale
        self._sphere = endcap.params.outer_radius_mm, endcap.params.centre_height_mm, scale
        self._gate, self._rate = Gate(scale), RateFilter(endcap.relaxation_terms, kept.overstress)
        self._filter = WrenchFilter(FilterConfig().scaled(scale, endcap.params.outer_radius_mm))
        threshold = model.threshold(endcap.contact_on_n, endcap.contact_off_n, endcap.gain)
        self._detector = ContactDetector(threshold, kept.touching)
        self._drift: Drift | None = None
        self._mounting, self._count = MountingWatch(endcap.params, kept.moved, reference.zero.error_px), 0
        self._load = LoadWatch(model.estimator, endcap.gain, kept.loaded)
        self._pictures, self._offset = PictureWatch(kept.compressed, kept.mixed), RestOffset(kept.offset)
        self.contact: ContactState | None = None

    @property
    def kept(self) -> Kept:
        """State that a restart keeps."""
        x, y, z = (0.0, 0.0, 0.0) if self._own_weight is None else self._own_weight.change_g.tolist()
        return Kept(
            (x, y, z), self._mounting.reason, self._load.reason, self._detector.touching, self._rate.state,
            self._offset.state, self._pictures.compressed, self._pictures.mixed,
        )  # fmt: skip

    def read(self, frame: Frame, captured_s: float) -> EndcapReading:
        """The reading of one frame, with or without numbers."""
        self._pictures.take(frame.coding)  # before what is kept, from which a replay has it: recordings hold no coding
        watch, before = StageTimes(), self.kept
        look = self._recorded(frame, watch) if isinstance(frame, SeenFrame) else self._look(frame, watch)
        if not isinstance(look, Verdict):
            return self._measured(frame, captured_s, look, watch, before)
        blank = without_numbers(
            self._endcap.name, self._number, frame, self._model.shape, self._used.zero, self._epoch, captured_s,
            self._drift,
        )  # fmt: skip
        return replace(
            blank, event=look.event, reason=look.reason, ready_s=time.monotonic(), stage_ms=watch.stages, before=before,
            wrench=replace(blank.wrench, flags=look.flags), estimate=replace(blank.estimate, flags=look.flags),
        )  # fmt: skip

    def _measured(self, frame: Frame, captured_s: float, look: _Look, watch: StageTimes, before: Kept) -> EndcapReading:
        """The reading of a frame whose picture could be decoded."""
        tracks, field, gray, estimate = look.tracks, look.field, look.gray, self._estimated(look)
        watch.lap("wrench")
        alike = look.likeness if gray is None else likeness(small_picture(gray), self._alike_to)
        rated = self._rate.step(estimate)
        estimate = rated.wrench
        judged = self._gate.judge(alike, tracks, estimate, lambda: self._predicted_n(estimate.time_s))
        if tracks is not None:
            self._pictures.update(tracks, alike)
        verdict = self._of_reference(judged, tracks)
        watch.lap("gate")
        seen = verdict.event is not Event.UNSEEN
        used = seen and not verdict.held
        if used:
            self._rate.take(rated)
        smooth = self._filter.update(estimate if used else replace(estimate, flags=estimate.flags | {"missing"}))
        watch.lap("filter")
        nothing = np.full(3, np.nan)
        contact = self.contact = self._detector.update(smooth if seen else replace(smooth, force_n=nothing))
        centre = contact_centre(smooth.force_n if seen else nothing, smooth.torque_nm, *self._sphere)
        if used and contact.known:
            self._offset.update(estimate, contact.touching and not self._mounting.untouched)
        smooth = self._offset.widened(smooth)
        place = self._plane.of(smooth) if seen and contact.known and contact.touching else NO_CONTACT
        watch.lap("contact")
        if self._count % DRIFT_EVERY == 0:
            self._compare(frame, look, estimate, used and verdict.flags.isdisjoint({DISTURBED, MOVED}), watch)
        self._count += 1
        flags = verdict.flags | (smooth.flags - {"missing"}) if seen else verdict.flags | {"blind"}
        return EndcapReading(
            self._endcap.name, self._number, frame, tracks, field,
            estimate=self._at_origin(estimate, verdict.flags, seen),
            wrench=self._at_origin(smooth, flags, seen), contact=contact, centre=centre, drift=self._drift,
            zero=self._used.zero, epoch=self._epoch, captured_s=captured_s, ready_s=time.monotonic(),
            stage_ms=watch.stages, event=verdict.event, reason=verdict.reason, own_weight_g=self._change_g,
            trend=self._filter.trend @ self._to_endcap.T if used else NO_TREND, place=place, likeness=alike,
            before=before,
        )  # fmt: skip

    def _compare(self, frame: Frame, look: _Look, estimate: Wrench, sure: bool, watch: StageTimes) -> None:
        """Look for what has changed since the reference; a load under it shows in sure readings alone."""
        if look.tracks is not None and look.gray is not None:
            self._drift = measure_drift(self._used.zero, frame, look.tracks, look.gray, self._mounting.motion)
            watch.lap("drift")
        if look.tracks is not None and sure:
            self._load.update(look.field, estimate, self._detector.touching)

    def _estimated(self, look: _Look) -> Wrench:
        """The wrench of one picture; its covariance includes the errors of camera, training data and silicone."""
        estimate = self._model.estimator.estimate(look.field)
        if self._check is not None and look.tracks is not None:
            estimate = self._check.widened(estimate, look.tracks)
        radius_mm = self._endcap.params.outer_radius_mm
        unknown = simulation_spread(estimate.force_n, radius_mm) if self._simulated else 0.0
        estimate = replace(estimate, covariance=estimate.covariance + unknown, flags=estimate.flags | self._foreign)
        return self._stiffness.applied(estimate)

    def _of_reference(self, verdict: Verdict, tracks: DotTracks | None) -> Verdict:
        """The verdict with the flags of the reference and its camera, and of a movement of the camera since.

        The filter leaves out a picture in which the camera may have been knocked, as it does any unconfirmed step.
        """
        if tracks is not None:
            self._mounting.update(tracks, self._own_weight)
        if verdict.event not in MEASURED:
            return verdict
        check = self._check
        flags = frozenset[str]() if check is None else check.flags
        misfit = "" if check is None or not flags else check.reason
        watched = {
            MOVED: self._mounting.reason, ZEROED_UNDER_LOAD: self._load.reason, **self._pictures.reasons,
            UNCONFIRMED: self._mounting.doubt,
        }  # fmt: skip
        flags |= {flag for flag, reason in watched.items() if reason}
        if not flags:
            return verdict
        return replace(
            verdict, event=Event.FLAGGED, reason="; ".join(filter(None, [verdict.reason, misfit, *watched.values()])),
            flags=verdict.flags | flags, held=verdict.held or bool(self._mounting.doubt),
        )  # fmt: skip

    def _predicted_n(self, time_s: float) -> NDArray[np.float64] | None:
        """(3,) force that the filter predicts, N; None before its first estimate, and after a gap that restarts it."""
        last_s = self._filter.last_s
        if last_s is None or time_s - last_s > self._filter.config.gap_s:
            return None
        return self._filter.at(time_s).force_n

    def _at_origin(self, wrench: Wrench, flags: frozenset[str], known: bool) -> Wrench:
        """The wrench about the endcap's origin instead of the sphere's centre; NaN where ``known`` is False."""
        moved = self._to_endcap @ np.concatenate([wrench.force_n, wrench.torque_nm])
        covariance = self._to_endcap @ wrench.covariance @ self._to_endcap.T
        if not known:
            moved, covariance = np.full(6, np.nan), np.full((6, 6), np.nan)
        return Wrench(wrench.time_s, moved[:3], moved[3:], "endcap", covariance, flags)

    def _unusable(self, zero: Zero, frame: Frame) -> Verdict | None:
        """Reason why a frame is not decoded: frozen or resized, where some methods would give numbers; else None."""
        same_s = self._gate.frozen(frame)
        if same_s:
            reason = f"same picture for {same_s:.1f} s: the camera hangs, plug it in again"
            return Verdict(Event.REPEATED, reason, frozenset({"frozen"}))
        height, width = zero.image.shape[:2]
        if frame.size is None or frame.size == (width, height):
            return None
        reason = (
            f"{frame.source}: frame of {frame.size[0]}x{frame.size[1]} px, zeroed at {width}x{height}: set the "
            "camera's mode back, or zero again"
        )
        return Verdict(Event.RESIZED, reason, frozenset({"wrong_size"}))

    def _look(self, frame: Frame, watch: StageTimes) -> _Look | Verdict:
        """Tracks and field of a picture, or the reason why it cannot be used."""
        unusable = self._unusable(self._used.zero, frame)
        if unusable is not None:
            return unusable
        try:
            return self._field(self._used.method, frame, watch)
        except FrameError as error:
            return Verdict(Event.UNDECODED, str(error), frozenset({"damaged"}))

    def _recorded(self, frame: SeenFrame, watch: StageTimes) -> _Look | Verdict:
        """Tracks and field of a recorded picture, or the reason why it could not be used."""
        method = self._used.method
        if frame.refused is not None:
            return frame.refused
        tracks = frame.tracks(method) if isinstance(method, ModelInput) else None
        if tracks is None or not isinstance(method, ModelInput):
            reason = "its recording holds dots of another reference and no picture: record with pictures"
            return Verdict(Event.UNDECODED, reason, frozenset({"damaged"}))
        field = self._field_of(method, tracks)
        watch.lap("field")
        return _Look(tracks, field, None, frame.likeness)

    @property
    def _change_g(self) -> NDArray[np.float64]:
        """(3,) change of gravity, g, whose effect is subtracted; NaN where none is estimated."""
        return NO_CHANGE if self._own_weight is None else self._own_weight.change_g

    def _field_of(self, method: ModelInput, tracks: DotTracks) -> ShearField:
        """The field due to the load: without the motion due to the skin's own weight in another pose."""
        return method.field(tracks, None if self._own_weight is None else self._own_weight.motion(tracks))

    def _field(self, method: FieldMethod, frame: Frame, watch: StageTimes) -> _Look:
        if not isinstance(method, ModelInput):
            gray = decode_gray(frame, COARSE)
            field = method.update(frame)
            watch.lap("field")
            return _Look(None, field, gray)
        gray = method.decode(frame)
        watch.lap("decode")
        tracks = method.track(gray, frame.time_s)
        watch.lap("track")
        field = self._field_of(method, tracks)
        watch.lap("field")
        return _Look(tracks, field, gray)


@dataclass(frozen=True)
class _Look:
    """Tracks, field and gray picture of one frame; ``gray`` is None where only ``likeness`` was recorded."""

    tracks: DotTracks | None
    field: ShearField
    gray: Image | None
    likeness: float = float("nan")
