"""A recording through the same pipeline again: same pictures, same capture times, same references, same bits.

    for cap in replay_caps(path, config): ...        # as sensing.live.open_caps.open_caps
    verify(path, config)                             # (readings, readings whose wrench differs in any bit)

A file whose writer was killed is read up to its last whole chunk.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from cad.errors import FileError
from sensing.live.core.config import LiveConfig
from sensing.live.core.engine import LiveCap
from sensing.live.core.feed import Captured, FileFeed, Pace
from sensing.live.core.pipeline import CapPipeline
from sensing.live.open_caps import Models, configured_models
from sensing.live.outputs import ros_types as ros
from sensing.live.outputs.recorder import METADATA, TOPICS, configured
from sensing.records import Frame
from sensing.sources.files import jpeg_size
from sensing.tracking.zero import Zero, single_zero


@dataclass(frozen=True)
class Recorded:
    """One picture of a recording.

    Attributes:
        frame: as it was captured. zero: reference that is used from this frame on; None to keep the one before.
    """

    frame: Frame
    zero: Zero | None


def read_config(path: Path, model: str | None = None, weights: Path | None = None) -> LiveConfig:
    """What ran when the file was recorded, with another model or weights if asked for.

    Raises:
        FileError: no recording of ours.
    """
    for record in _records(path):
        if isinstance(record, Metadata) and record.name == METADATA:
            try:
                config = configured(json.loads(record.metadata["config"]), str(path))
            except (ValueError, KeyError, TypeError) as error:
                raise FileError(f"{path}: its configuration cannot be read ({error})") from None
            return replace(config, model=model or config.model, weights=weights or config.weights)
        if isinstance(record, Message):
            break
    raise FileError(f"{path}: an MCAP file, but no recording of endcaps: give one made with --record")


def replay_caps(path: Path, config: LiveConfig, speed: float = 1.0, models: Models | None = None) -> list[LiveCap]:
    """Caps that read from a recording, keeping step with one another."""
    models, pace = models or configured_models(config), Pace(speed)
    caps = []
    for number, cap in enumerate(config.caps):
        pipeline = CapPipeline(cap, models(cap), None, number, zero_frames=1 << 30)
        caps.append(LiveCap(ReplayFeed(path, cap.name, pipeline.set_zero, pace), pipeline))
    return caps


class ReplayFeed(FileFeed):
    """Frames of one cap of a recording; hands over references when they are due.

    Args:
        path: recording. cap: name. set_zero: takes a reference, in the thread that takes the frames. pace: shared.
    """

    def __init__(self, path: Path, cap: str, set_zero: Callable[[Zero], None], pace: Pace) -> None:
        self._zeros: dict[int, Zero] = {}
        self._set_zero = set_zero
        super().__init__(lambda: self._frames_of(path, cap), pace)

    def take(self) -> Captured | None:
        """The next frame that is due, after the reference it begins with."""
        item = super().take()
        if item is not None:
            zero = self._zeros.pop(id(item[0]), None)
            if zero is not None:
                self._set_zero(zero)
        return item

    def _frames_of(self, path: Path, cap: str) -> Iterator[Frame]:
        for recorded in recorded_frames(path, cap):
            if recorded.zero is not None:
                self._zeros[id(recorded.frame)] = recorded.zero
            yield recorded.frame


def recorded_frames(path: Path, cap: str) -> Iterator[Recorded]:
    """Pictures of a cap in the order of recording.

    Raises:
        FileError: missing, or no MCAP.
    """
    zero, time_s = None, None
    for topic, message in _messages(path, cap):
        if topic == "zero":
            image = ros.decode(ros.IMAGE, message.data)
            zero = single_zero(_frame(bytes(image.data), image.format, 0.0, 0, cap), cap)
        elif topic == "image/capture_time":
            time_s = float(ros.decode(ros.FLOAT64, message.data).data)
        elif topic == "image/compressed" and time_s is not None:
            image = ros.decode(ros.IMAGE, message.data)
            frame = _frame(bytes(image.data), image.format, time_s, message.sequence, cap)
            yield Recorded(frame, zero)
            zero, time_s = None, None


def recorded_wrenches(path: Path, cap: str) -> list[np.ndarray]:
    """(6,) filtered wrench of every frame of a cap, as recorded."""
    found = []
    for topic, message in _messages(path, cap):
        if topic == "wrench/wrench_pred":
            wrench = ros.decode(ros.WRENCH, message.data).wrench
            parts = (wrench.force, wrench.torque)
            found.append(np.array([getattr(part, axis) for part in parts for axis in "xyz"]))
    return found


def verify(path: Path, config: LiveConfig, models: Models | None = None) -> tuple[int, int]:
    """Compute everything again and compare: (frames, frames whose wrench differs in any bit)."""
    models, frames, different = models or configured_models(config), 0, 0
    for number, cap in enumerate(config.caps):
        pipeline = CapPipeline(cap, models(cap), None, number, zero_frames=1 << 30)
        told = iter(recorded_wrenches(path, cap.name))
        for recorded in recorded_frames(path, cap.name):
            if recorded.zero is not None:
                pipeline.set_zero(recorded.zero)
            reading = pipeline.update(recorded.frame)
            before = next(told, None)
            if before is None:
                break  # the end of a killed recording
            frames += 1
            again = None if reading is None else [*reading.wrench.force_n, *reading.wrench.torque_nm]
            different += again is None or not np.array_equal(again, before)
    return frames, different


def _frame(data: bytes, form: str, time_s: float, sequence: int, cap: str) -> Frame:
    if form == "jpeg":
        return Frame(time_s, sequence, cap, jpeg=data, size=jpeg_size(data))
    import cv2

    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileError(f"{cap}: picture {sequence} of the recording cannot be read: the file is damaged")
    return Frame(time_s, sequence, cap, image=image)


def _messages(path: Path, cap: str) -> Iterator[tuple[str, Message]]:
    topics: dict[int, str] = {}
    for record in _records(path):
        if isinstance(record, Channel) and record.topic.startswith(f"/{cap}/"):
            topic = record.topic.removeprefix(f"/{cap}/")
            if topic in TOPICS:
                topics[record.id] = topic
        elif isinstance(record, Message) and record.channel_id in topics:
            yield topics[record.channel_id], record


def _records(path: Path) -> Iterator[object]:
    """Records in order, up to where a killed writer left off."""
    try:
        with path.open("rb") as stream:
            records = StreamReader(stream).records
            first = True
            while True:
                try:
                    record = next(records)
                except StopIteration:
                    return
                except (McapError, struct.error, EOFError) as error:
                    if first:
                        raise FileError(f"{path}: no MCAP file ({error}): give one made with --record") from None
                    return
                first = False
                yield record
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: give a recording") from None
