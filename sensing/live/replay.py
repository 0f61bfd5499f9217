"""A recording read again: same pictures, same capture times, same references, and through the same pipeline same bits.

    for recorded in recorded_frames(path, "endcap_0"): ...
    verify(path, config)                             # frames, and frames whose wrench differs in any bit

A file that is cut or damaged is read up to there. To be played it goes through :mod:`sensing.live.playback`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata
from numpy.typing import NDArray

from cad.errors import FileError
from sensing.live.core.config import LiveConfig
from sensing.live.core.gate import Verdict
from sensing.live.core.kept import NOTHING_KEPT, Kept
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.core.seen import Pictures, SeenFrame
from sensing.live.mcap_records import CutError, DamagedError, read_records
from sensing.live.open_endcaps import Models, configured_models
from sensing.live.outputs.mcap.config import METADATA, RecordedConfig, parsed
from sensing.live.outputs.mcap.topics import TOPICS
from sensing.live.outputs.mcap.tracks import ROWS, TRACK_TOPICS, refusal_of, rows_of
from sensing.live.outputs.ros import types as ros
from sensing.live.recorded_messages import (
    kept_in,
    picture_in,
    read_message,
    time_in,
    with_error,
    wrench_in,
    zero_in,
)
from sensing.live.timeline import WHOLE, Start, Timeline
from sensing.records import Frame
from sensing.tracking.zero import Zero

RECORDED = TOPICS | TRACK_TOPICS
RUN_UP_S = 1.0  # worked through before a moment that a replay is sent to


@dataclass(frozen=True)
class Recorded:
    """One picture of a recording.

    Attributes:
        frame: as it was captured.
        zero: reference that is used from this frame on; None to keep the one before.
        stamp_ns: of its message.
        kept: of the frames before, where a reference comes.
    """

    frame: Frame
    zero: Zero | None
    stamp_ns: int = 0
    kept: Kept = NOTHING_KEPT


@dataclass(frozen=True)
class Check:
    """A recording computed again.

    Attributes:
        frames: compared.
        different: those whose wrench differs in any bit.
        end: why the file could not be read to its end; None if it could.
        largest_n: largest difference of a force.
    """

    frames: int
    different: int
    end: FileError | None = None
    largest_n: float = 0.0


def read_config(
    path: Path, model: str | None = None, weights: Path | None = None, method: str | None = None
) -> LiveConfig:
    """What ran when the file was recorded.

    Args:
        path: of the recording.
        model, weights, method: instead of those recorded; None keeps them.

    Raises:
        FileError: no recording of ours, or one without pictures where model or method need them.
    """
    recorded, files = _about(path)
    config = recorded.with_files(files, path)
    if model not in (None, config.model) or method is not None:
        require_pictures(path, "another --model or --method", recorded.pictures)
    if model is not None and model != config.model:
        return replace(config, model=model, weights=weights, own_weights={}, method=method)
    return replace(config, weights=weights or config.weights, method=method or config.method)


def recorded_pictures(path: Path) -> Pictures:
    """Which pictures a recording holds.

    Raises:
        FileError: no recording of ours.
    """
    return _about(path)[0].pictures


def require_pictures(path: Path, what: str, held: Pictures | None = None) -> None:
    """Refuse a recording of dots for what needs whole pictures.

    Args:
        path: of the recording.
        what: that is asked for.
        held: its pictures, if they are known already.

    Raises:
        FileError: it holds dots instead of pictures.
    """
    held = held or recorded_pictures(path)
    if held is not Pictures.FULL:
        raise FileError(
            f"{path}: holds dots instead of pictures (--record-pictures {held}): {what} needs whole pictures, recorded "
            "with --record-pictures full"
        )


def _about(path: Path) -> tuple[RecordedConfig, dict[str, bytes]]:
    recorded: RecordedConfig | None = None
    files: dict[str, bytes] = {}
    for record in read_records(path):
        if isinstance(record, Metadata) and record.name == METADATA:
            recorded = parsed(record.metadata, path)
        elif isinstance(record, Attachment):
            files[record.name] = record.data
        elif isinstance(record, Channel | Message):
            break
    if recorded is None:
        raise FileError(f"{path}: an MCAP file, but no recording of endcaps: give one made with --record")
    return recorded, files


def recorded_frames(path: Path, endcap: str, start: Start = WHOLE) -> Iterator[Recorded]:
    """Pictures of an endcap in the order of recording.

    Args:
        path: of the recording.
        endcap: name.
        start: where to begin; the first picture then comes with its reference.

    Raises:
        FileError: missing, or no MCAP.
        DamagedError, CutError: after the pictures that can be read.
    """
    zero = None if start.zero is None else zero_in(path, endcap, start.zero, start.zero_error)
    kept = NOTHING_KEPT if start.kept is None else kept_in(path, start.kept)
    found, begun = _Found(size=None if zero is None else _size_of(zero)), zero is not None
    for topic, message in _messages(path, endcap, start):
        if topic == "zero":
            zero, begun, kept = zero_in(path, endcap, message), True, NOTHING_KEPT
            found.size = _size_of(zero)
        elif topic == "zero_error_px" and zero is not None:
            zero = with_error(path, zero, message)
        elif topic == "kept":
            kept = kept_in(path, message)
        elif topic == "image/capture_time":
            found = _Found(time_in(path, topic, message), size=found.size)
        elif topic == "image/compressed":
            found.picture = message
        elif topic == "tracks":
            found.rows, found.likeness = read_message(path, ROWS, message, rows_of)
            found.seen = True
        elif topic == "refused":
            found.refused = read_message(path, ros.STRING, message, refusal_of)
        elif topic == "wrench/estimate" and found.time_s is not None and begun:
            frame = _frame_of(path, endcap, found, message.sequence)
            if frame is not None:
                yield Recorded(frame, zero, message.log_time, kept)
                zero = None
            found = _Found(size=found.size)


def recorded_wrenches(path: Path, endcap: str, start: Start = WHOLE) -> list[np.ndarray]:
    """(6,) filtered wrench of every frame of an endcap, as recorded, as far as the file can be read.

    Args:
        path: of the recording.
        endcap: name.
        start: as for :func:`recorded_frames`.
    """
    found = []
    try:
        for topic, message in _messages(path, endcap, start):
            if topic == "wrench/wrench_pred":
                found.append(wrench_in(path, message))
    except (CutError, DamagedError):
        pass
    return found


def verify(path: Path, config: LiveConfig, models: Models | None = None, from_s: float = 0.0) -> Check:
    """Compute everything again and compare.

    Args:
        path: of the recording.
        config: what is to run.
        models: model of an endcap; None for those of the configuration.
        from_s: begin as a replay does that is sent to this moment; frames before it are not compared.
    """
    models, check = models or configured_models(config), Check(0, 0)
    timeline = Timeline(path) if from_s > 0 else None
    for number, endcap in enumerate(config.endcaps):
        pipeline = EndcapPipeline(endcap, models(endcap), None, number, zero_frames=0)
        start = WHOLE if timeline is None else timeline.start(endcap.name, from_s - RUN_UP_S)
        reported = iter(recorded_wrenches(path, endcap.name, start))
        try:
            for recorded in recorded_frames(path, endcap.name, start):
                if recorded.zero is not None:
                    pipeline.set_zero(recorded.zero, recorded.kept)
                reading = pipeline.update(recorded.frame)
                before = next(reported, None)
                if before is None:
                    break  # the end of a cut recording
                if timeline is None or timeline.at_s(recorded.stamp_ns) >= from_s:
                    check = _compared(check, reading, before)
        except (CutError, DamagedError) as error:
            check = replace(check, end=error)
    return check


def _compared(check: Check, reading: EndcapReading | None, before: np.ndarray) -> Check:
    again = np.full(6, np.nan) if reading is None else np.r_[reading.wrench.force_n, reading.wrench.torque_nm]
    same = reading is not None and np.array_equal(again, before, equal_nan=True)
    off_n = float(np.linalg.norm(again[:3] - before[:3]))
    largest_n = max(check.largest_n, off_n if off_n == off_n else 0.0)
    return replace(check, frames=check.frames + 1, different=check.different + (not same), largest_n=largest_n)


@dataclass
class _Found:
    """Of one frame, so far."""

    time_s: float | None = None
    picture: Message | None = None
    seen: bool = False
    rows: NDArray[np.float64] | None = None
    likeness: float = math.nan
    refused: Verdict | None = None
    size: tuple[int, int] | None = None


def _size_of(zero: Zero) -> tuple[int, int]:
    """(width, height) of a reference, and of the pictures that were measured against it."""
    height, width = zero.image.shape[:2]
    return width, height


def _frame_of(path: Path, endcap: str, found: _Found, sequence: int) -> Frame | None:
    picture = None if found.picture is None else picture_in(path, endcap, found.picture, found.time_s or 0.0)
    if not found.seen:
        return picture
    return SeenFrame(
        found.time_s or 0.0, sequence, endcap, jpeg=None if picture is None else picture.jpeg, size=found.size,
        rows=found.rows, likeness=found.likeness, refused=found.refused,
    )  # fmt: skip


def _messages(path: Path, endcap: str, start: Start) -> Iterator[tuple[str, Message]]:
    named, prefix = dict(start.topics), f"/{endcap}/"
    for record in read_records(path, start.byte):
        if isinstance(record, Channel):
            named[record.id] = record.topic
        elif isinstance(record, Message) and record.log_time >= start.from_ns:
            topic = named.get(record.channel_id, "")
            if topic.startswith(prefix) and topic.removeprefix(prefix) in RECORDED:
                yield topic.removeprefix(prefix), record
