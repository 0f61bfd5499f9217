"""The reading, result of one frame of one endcap: the record that every output takes.

Times are seconds of the monotonic clock. Wrenches act on the endcap, at the origin of the endcap frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from dataclasses import field as with_default
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sensing.live.core.kept import NOTHING_KEPT, Kept
from sensing.live.core.state import MEASURED, Event, word
from sensing.records import DotTracks, Frame, ShearField, Wrench
from sensing.tracking.zero import Drift, Zero
from sensing.wrench.contact import ContactState
from sensing.wrench.contact_place import PressureCentre
from sensing.wrench.plane_contact import NO_CONTACT, PlaneContact
from sensing.wrench.trend import HORIZONS_S, row_for

NO_TREND = np.zeros((len(HORIZONS_S), 6))  # holding the last value
NO_TREND.flags.writeable = False
NO_CHANGE = np.full(3, np.nan)
NO_CHANGE.flags.writeable = False


@dataclass(frozen=True)
class EndcapReading:
    """One frame from camera to contact.

    Attributes:
        endcap: name.
        number: place in the list of endcaps.
        frame: the picture.
        tracks: its dots, None for methods without.
        field: its shear field.
        estimate: wrench of this frame alone.
        wrench: filtered.
        contact: whether it touches.
        centre: where the line of action meets the sphere.
        drift: what has changed since the reference, as last measured; None before.
        zero: the reference in use.
        epoch: counts up when reference or filter start anew.
        captured_s: capture on this run's clock (the frame's own time for a camera, the due time for a file).
        ready_s: when all this was known.
        stage_ms: time of each stage.
        trend: (H, 6) change of ``wrench`` a second that can be counted on for each of
            :data:`sensing.wrench.trend.HORIZONS_S`; zero where holding it has been better.
        place: centre, normal and use of friction were it a plane that touches; NaN while nothing does.
        event: what the frame has shown.
        reason: why its numbers do not count, or are to be used with care.
        likeness: of the picture with that of the reference, -1..1; NaN where none was compared.
        own_weight_g: (3,) change of gravity since the reference, in g along the endcap's axes, whose effect on the skin
            is taken out; NaN where none is looked for.
        before: what a restart just before this frame keeps, so that a replay can begin with it.
    """

    endcap: str
    number: int
    frame: Frame
    tracks: DotTracks | None
    field: ShearField
    estimate: Wrench
    wrench: Wrench
    contact: ContactState
    centre: PressureCentre
    drift: Drift | None
    zero: Zero
    epoch: int
    captured_s: float
    ready_s: float
    stage_ms: Mapping[str, float]
    event: Event
    reason: str
    trend: NDArray[np.float64] = with_default(default_factory=lambda: NO_TREND)
    place: PlaneContact = NO_CONTACT
    likeness: float = float("nan")
    own_weight_g: NDArray[np.float64] = with_default(default_factory=lambda: NO_CHANGE)
    before: Kept = NOTHING_KEPT

    @property
    def valid(self) -> bool:
        """Whether the numbers count; where they do not they are NaN."""
        return self.event in MEASURED

    @property
    def latency_ms(self) -> float:
        """From capture to wrench."""
        return 1e3 * (self.ready_s - self.captured_s)

    @property
    def dots(self) -> tuple[int, int]:
        """(dots followed, dots known); (0, 0) for methods without dots."""
        if self.tracks is None:
            return 0, 0
        return int((~self.tracks.lost).sum()), len(self.tracks.ids)


def predicted(reading: EndcapReading, time_s: float) -> Wrench:
    """The wrench of a reading at a later time, by its trend; beyond the longest horizon it stays.

    Args:
        reading: valid or not (NaN stays NaN).
        time_s: on the clock of ``captured_s``, not before it.
    """
    delay_s = max(0.0, time_s - reading.captured_s)
    moved = reading.trend[row_for(delay_s)] * min(delay_s, HORIZONS_S[-1])
    wrench = reading.wrench
    return replace(
        wrench, time_s=time_s, force_n=wrench.force_n + moved[:3], torque_nm=wrench.torque_nm + moved[3:],
        covariance=wrench.covariance + np.diag(moved**2),
    )  # fmt: skip


def plain(reading: EndcapReading) -> dict[str, Any]:
    """The numbers of a reading for JSON: plain types, units in the names; null where there is no number."""
    wrench, followed = reading.wrench, reading.dots
    return {
        "endcap": reading.endcap,
        "valid": reading.valid,
        "state": word(reading.event),
        "reason": reading.reason,
        "time_s": reading.frame.time_s,
        "sequence": reading.frame.sequence,
        "latency_ms": rounded(reading.latency_ms, 3),
        "force_n": [rounded(x) for x in wrench.force_n],
        "torque_nm": [rounded(x, 6) for x in wrench.torque_nm],
        "sd": [rounded(x**0.5 if x >= 0 else float("nan"), 6) for x in wrench.covariance.diagonal()],
        "force_norm_n": rounded(float((wrench.force_n**2).sum() ** 0.5)),
        "contact": reading.contact.touching if reading.contact.known else None,
        "contact_since_s": rounded(reading.contact.since_s, 6),
        "centre_mm": [rounded(x, 3) for x in reading.centre.position_mm],
        "place_mm": [rounded(x, 3) for x in reading.place.position_mm],
        "place_sd_mm": rounded(reading.place.position_sd_mm, 3),
        "normal": [rounded(x, 5) for x in reading.place.normal],
        "normal_sd_deg": rounded(reading.place.normal_sd_deg, 3),
        "friction_use": rounded(reading.place.friction_use, 4),
        "friction_use_sd": rounded(reading.place.friction_use_sd, 4),
        "own_weight_g": [rounded(x, 3) for x in reading.own_weight_g],
        "dots": followed[0],
        "dots_known": followed[1],
        "flags": sorted(wrench.flags),
    }


def nothing(endcap: str, state: str, reason: str) -> dict[str, Any]:
    """What :func:`plain` gives of an endcap of which no frame comes: its state, and null for every number.

    Args:
        endcap: name.
        state: its state in a word.
        reason: why no frame comes.
    """
    numbers = ["time_s", "force_norm_n", "contact", "contact_since_s"]
    numbers += ["place_sd_mm", "normal_sd_deg", "friction_use", "friction_use_sd"]
    return {"endcap": endcap, "valid": False, "state": state, "reason": reason, **dict.fromkeys(numbers)} | {
        "force_n": [None] * 3, "torque_nm": [None] * 3, "sd": [None] * 6, "centre_mm": [None] * 3,
        "place_mm": [None] * 3, "normal": [None] * 3, "own_weight_g": [None] * 3, "flags": [],
    }  # fmt: skip


def without_numbers(
    endcap: str,
    number: int,
    frame: Frame,
    shape: tuple[int, int],
    zero: Zero,
    epoch: int,
    captured_s: float,
    drift: Drift | None,
) -> EndcapReading:
    """A reading whose numbers are all NaN and whose field is invalid everywhere.

    Args:
        endcap: name.
        number: place in the list of endcaps.
        frame: the picture.
        shape: (H, W) of the field.
        zero, epoch, captured_s, drift: as in :class:`EndcapReading`.
    """
    nothing = np.full(3, np.nan)
    wrench = Wrench(frame.time_s, nothing, nothing, "endcap")
    field = ShearField(frame.time_s, np.zeros((2, *shape), np.float32), valid=np.zeros(shape, bool))
    contact = ContactState(frame.time_s, False, float("nan"), float("nan"), False)
    centre = PressureCentre(nothing, float("nan"), float("nan"))
    return EndcapReading(
        endcap, number, frame, None, field, wrench, wrench, contact, centre, drift, zero, epoch, captured_s, captured_s,
        {}, Event.UNDECODED, "",
    )  # fmt: skip


def rounded(value: float, digits: int = 5) -> float | None:
    """A number for JSON; None where it is not finite."""
    value = float(value)
    return round(value, digits) if value - value == 0 else None
