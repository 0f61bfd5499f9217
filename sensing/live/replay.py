"""A recording through the same pipeline again: same pictures, same capture times, same references, same bits.

    for endcap in replay_endcaps(path, config): ...        # as sensing.live.open_endcaps.open_endcaps
    verify(path, config)                             # frames, and frames whose wrench differs in any bit

A file that is cut or damaged is read up to there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata

from cad.errors import FileError
from sensing.decode import MOST_PIXELS, png_size
from sensing.live.core.config import LiveConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import Captured, FileFeed, Pace
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.mcap_records import CutError, DamagedError, read_records
from sensing.live.open_endcaps import Models, configured_models
from sensing.live.outputs import ros_types as ros
from sensing.live.outputs.recorded_config import METADATA, RecordedConfig, parsed
from sensing.live.outputs.recorder import TOPICS
from sensing.records import Frame
from sensing.sources.files import jpeg_size
from sensing.tracking.zero import Zero, single_zero

LATEST_S = 1e9  # capture times beyond are no times


@dataclass(frozen=True)
class Recorded:
    """One picture of a recording.

    Attributes:
        frame: as it was captured. zero: reference that is used from this frame on; None to keep the one before.
    """

    frame: Frame
    zero: Zero | None


@dataclass(frozen=True)
class Check:
    """A recording computed again.

    Attributes:
        frames: compared. different: those whose wrench differs in any bit. end: why the file could not be read to its
            end; None if it could.
    """

    frames: int
    different: int
    end: FileError | None = None


def read_config(path: Path, model: str | None = None, weights: Path | None = None) -> LiveConfig:
    """What ran when the file was recorded.

    Args:
        path: of the recording. model, weights: instead of those recorded; None keeps them.

    Raises:
        FileError: no recording of ours.
    """
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
    config = recorded.with_files(files, path)
    if model is not None and model != config.model:
        return replace(config, model=model, weights=weights, method=None)
    return config if weights is None else replace(config, weights=weights)


def replay_endcaps(
    path: Path, config: LiveConfig, speed: float = 1.0, models: Models | None = None
) -> list[LiveEndcap]:
    """Endcaps that read from a recording, keeping step with one another.

    Args:
        path: of the recording. config: what is to run. speed: 1 is the recording's own pace, 0 at once.
        models: model of an endcap; None for those of the configuration.
    """
    models, pace = models or configured_models(config), Pace(speed)
    endcaps = []
    for number, endcap in enumerate(config.endcaps):
        pipeline = EndcapPipeline(endcap, models(endcap), None, number, zero_frames=0)
        endcaps.append(LiveEndcap(ReplayFeed(path, endcap.name, pipeline.set_zero, pace), pipeline))
    return endcaps


class ReplayFeed(FileFeed):
    """Frames of one endcap of a recording; hands over references when they are due.

    Args:
        path: recording. endcap: name. set_zero: takes a reference, in the thread that takes the frames. pace: shared.

    Attributes:
        damage: where the file is damaged; empty if it is not, so far.
    """

    def __init__(self, path: Path, endcap: str, set_zero: Callable[[Zero], None], pace: Pace) -> None:
        self._zeros: dict[int, Zero] = {}
        self._set_zero = set_zero
        self.damage = ""
        super().__init__(lambda: self._frames_of(path, endcap), pace)

    def take(self) -> Captured | None:
        """The next frame that is due, after the reference it begins with."""
        item = super().take()
        if item is not None:
            zero = self._zeros.pop(id(item[0]), None)
            if zero is not None:
                self._set_zero(zero)
        return item

    def _frames_of(self, path: Path, endcap: str) -> Iterator[Frame]:
        try:
            for recorded in recorded_frames(path, endcap):
                if recorded.zero is not None:
                    self._zeros[id(recorded.frame)] = recorded.zero
                yield recorded.frame
        except DamagedError as error:
            self.damage = str(error)
            raise


def recorded_frames(path: Path, endcap: str) -> Iterator[Recorded]:
    """Pictures of an endcap in the order of recording.

    Raises:
        FileError: missing, or no MCAP. DamagedError, CutError: after the pictures that can be read.
    """
    zero, time_s, begun = None, None, False
    for topic, message in _messages(path, endcap):
        if topic == "zero":
            zero, begun = single_zero(_frame(path, endcap, message, 0.0), endcap), True
        elif topic == "image/capture_time":
            time_s = _number(path, topic, message)
        elif topic == "image/compressed" and time_s is not None and begun:
            yield Recorded(_frame(path, endcap, message, time_s), zero)
            zero, time_s = None, None


def recorded_wrenches(path: Path, endcap: str) -> list[np.ndarray]:
    """(6,) filtered wrench of every frame of an endcap, as recorded, as far as the file can be read."""
    found = []
    try:
        for topic, message in _messages(path, endcap):
            if topic == "wrench/wrench_pred":
                found.append(_wrench(path, message))
    except (CutError, DamagedError):
        pass
    return found


def verify(path: Path, config: LiveConfig, models: Models | None = None) -> Check:
    """Compute everything again and compare.

    Args:
        path: of the recording. config: what is to run. models: model of an endcap; None for those of the configuration.
    """
    models, check = models or configured_models(config), Check(0, 0)
    for number, endcap in enumerate(config.endcaps):
        pipeline = EndcapPipeline(endcap, models(endcap), None, number, zero_frames=0)
        reported = iter(recorded_wrenches(path, endcap.name))
        try:
            for recorded in recorded_frames(path, endcap.name):
                if recorded.zero is not None:
                    pipeline.set_zero(recorded.zero)
                reading = pipeline.update(recorded.frame)
                before = next(reported, None)
                if before is None:
                    break  # the end of a cut recording
                again = None if reading is None else [*reading.wrench.force_n, *reading.wrench.torque_nm]
                same = again is not None and np.array_equal(again, before, equal_nan=True)
                check = replace(check, frames=check.frames + 1, different=check.different + (not same))
        except (CutError, DamagedError) as error:
            check = replace(check, end=error)
    return check


def _frame(path: Path, endcap: str, message: Message, time_s: float) -> Frame:
    reported = _decoded(path, ros.IMAGE, message)
    data, sequence = bytes(reported.data), message.sequence
    size = jpeg_size(data) if reported.format == "jpeg" else png_size(data)
    if size is None or not 0 < size[0] * size[1] <= MOST_PIXELS:
        raise _unusable(path, message, f"a picture of {size} px")
    if reported.format == "jpeg":
        return Frame(time_s, sequence, endcap, jpeg=data, size=size)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise _unusable(path, message, "no picture")
    return Frame(time_s, sequence, endcap, image=image)


def _number(path: Path, topic: str, message: Message) -> float:
    value = float(_decoded(path, ros.FLOAT64, message).data)
    if not abs(value) < LATEST_S or math.isnan(value):
        raise _unusable(path, message, f"{topic} {value}")
    return value


def _wrench(path: Path, message: Message) -> np.ndarray:
    wrench = _decoded(path, ros.WRENCH, message).wrench
    return np.array([getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"], float)


def _decoded(path: Path, kind: str, message: Message) -> Any:
    try:
        return ros.decode(kind, message.data)
    except Exception as error:  # whatever the library makes of bytes that are no such message
        raise _unusable(path, message, f"no {kind}: {type(error).__name__}") from None


def _unusable(path: Path, message: Message, reason: str) -> DamagedError:
    return DamagedError(
        f"{path}: message {message.sequence} of {message.log_time / 1e9:.3f} s is damaged ({reason}): what stands "
        "before it is read"
    )


def _messages(path: Path, endcap: str) -> Iterator[tuple[str, Message]]:
    topics: dict[int, str] = {}
    records: Iterator[McapRecord] = read_records(path)
    for record in records:
        if isinstance(record, Channel) and record.topic.startswith(f"/{endcap}/"):
            topic = record.topic.removeprefix(f"/{endcap}/")
            if topic in TOPICS:
                topics[record.id] = topic
        elif isinstance(record, Message) and record.channel_id in topics:
            yield topics[record.channel_id], record
