"""Records a run as MCAP with ROS 2 schemas: pictures, references, fields, wrenches, contact, diagnostics.

Foxglove and ``ros2 bag`` open it, and ``python -m sensing.live --replay FILE`` gives the same bits again. For that the
recording of an endcap begins with a restart of its pipeline and with its reference, and does so again wherever frames
had to be left out (a slow disk): those until then are counted as lost. Pictures may be halved or left out: then the
dots are recorded, from which the same bits follow (:mod:`sensing.live.outputs.mcap.tracks`). Every chunk is
flushed: a killed run leaves a file readable up to there. Stamps are the wall time of the capture, at whatever pace a
file is read; the exact capture time on the frames' own clock lies beside every picture.
"""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

from mcap.writer import CompressionType, Writer

from cad.errors import FileError
from sensing.live.core.config import LiveConfig
from sensing.live.core.kept import Kept
from sensing.live.core.reading import EndcapReading
from sensing.live.core.seen import Pictures
from sensing.live.core.sink import QueuedSink
from sensing.live.core.stats import EndcapHealth
from sensing.live.outputs.diagnosis import diagnosis
from sensing.live.outputs.mcap.config import METADATA, about, carried_files
from sensing.live.outputs.mcap.index_on_disk import IndexOnDisk
from sensing.live.outputs.mcap.new_file import create, put_on_disk, write_soon
from sensing.live.outputs.mcap.stamps import CaptureStamps, RecordedClock
from sensing.live.outputs.mcap.topics import TOPICS
from sensing.live.outputs.mcap.tracks import (
    NOTES,
    TRACK_TOPICS,
    half_picture,
    refused_message,
    tracks_message,
)
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.frames import CamerasInUse
from sensing.live.outputs.ros.messages import LATCHED, STATIC, TRANSFORMS, camera_info, numbers_of, transforms
from sensing.records import Frame

ROOM = 512  # readings that the disk may be behind: three seconds of six cameras
CHUNK_BYTES = 1 << 20
FLUSH_S = 1.0  # what a killed run may lose
DIAGNOSTICS_S = 1.0
MOST_NOTES = 100  # that wait to be written


class Recorder(QueuedSink):
    """Writes one file.

    Args:
        path: must not exist.
        config: what runs.
        epochs: epoch of every endcap before its restart was asked for.
        restart: asks for the restart of an endcap.
        health: for the diagnostics.
        stream: instead of a file, for tests.
        pictures: which are written.
        played: clock of the recording that the frames come from, if they do.
        cameras: of the readings, with their frames; None: neither is written.

    Attributes:
        frames: readings written.
        kept: those that the file certainly holds.
        begun_s: time of the start.

    Raises:
        FileError: the file exists or cannot be made.
    """

    def __init__(
        self,
        path: Path,
        config: LiveConfig,
        epochs: dict[str, int],
        restart: Callable[[str], None],
        health: Callable[[], Sequence[EndcapHealth]] = list,
        stream: BinaryIO | None = None,
        pictures: Pictures = Pictures.FULL,
        played: RecordedClock | None = None,
        cameras: CamerasInUse | None = None,
    ) -> None:
        super().__init__(ROOM, DIAGNOSTICS_S)
        self.path, self.pictures, self.frames, self.kept = path, pictures, 0, 0
        self.begun_s = time.monotonic()
        self._notes: deque[str] = deque(maxlen=MOST_NOTES)
        self._topics = TOPICS if pictures is Pictures.FULL else TOPICS | TRACK_TOPICS
        self._config, self._restart, self._health = config, restart, health
        self._cameras, self._placed = cameras, b""  # the frames as last written
        self._old, self._begun = dict(epochs), dict.fromkeys(epochs, -1)
        self._kept: dict[str, Kept] = {}  # as last written of each endcap: a replay may begin at any frame
        self._gap = dict.fromkeys(epochs, -1)  # newest epoch of which a reading was lost
        self._behind: set[str] = set()  # endcaps to be restarted once the disk has caught up
        self._stamps = CaptureStamps(played)
        self._next_s, self._bytes, self._flushed_s = 0.0, 0, time.monotonic()
        self._files = carried_files(config)
        self._stream = create(path) if stream is None else stream
        compression = CompressionType.ZSTD if pictures is Pictures.NONE else CompressionType.NONE
        self._writer = Writer(
            self._stream, chunk_size=1 << 62, compression=compression, enable_data_crcs=True
        )  # chunks are ended here, so that it is known what is in the file
        self._made, self._whole, self._index = stream is None, False, IndexOnDisk()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    @property
    def note(self) -> str:
        """State in one line."""
        if self.failed:
            return f"{self.path}: recording stopped ({self.failed}); {self.kept} frames are kept"
        lost = f", {self.dropped} lost to a slow disk" if self.dropped else ""
        return f"{self.path}: {self.frames} frames recorded{lost}"

    def start(self) -> None:
        """Write the head, then begin.

        Raises:
            FileError: not even that could be written.
        """
        try:
            self._index.take_over(self._writer, self.path.parent)
            self._writer.start(profile="ros2", library="endcap-toolkit")
            self._writer.add_metadata(METADATA, about(self._config, self._files, self.pictures))
            for file in self._files:
                self._writer.add_attachment(time.time_ns(), time.time_ns(), file.name, "", file.data)
            for endcap in self._config.endcaps:
                for topic, kind in self._topics.items():
                    self._channel(f"/{endcap.name}/{topic}", kind)
            self._channel("/diagnostics", ros.DIAGNOSTICS)
            self._channel(STATIC, TRANSFORMS, LATCHED)
            self._channel(NOTES, ros.STRING)
            self._stream.flush()
        except OSError as error:
            self._discard()
            raise FileError(f"{self.path}: {error.strerror}: choose another place") from None
        super().start()

    def write(self, reading: EndcapReading) -> None:
        """All messages of one reading."""
        stamp = self._stamps.of(reading)
        if reading.epoch != self._begun[reading.endcap]:
            self._begun[reading.endcap] = reading.epoch
            self._kept.pop(reading.endcap, None)
            png, form = ros.picture_bytes(Frame(0.0, 0, reading.endcap, image=reading.zero.image))
            self._add(reading, "zero", ros.compressed_image(png, form, stamp, ros.camera_frame(reading.endcap)), stamp)
            self._add(reading, "zero_error_px", ros.float64(reading.zero.error_px), stamp)
            self._place(stamp)
        if (kept := reading.before.of_events) != self._kept.get(reading.endcap):
            self._kept[reading.endcap] = kept
            self._add(reading, "kept", ros.string(reading.before.text()), stamp)
        self._add(reading, "image/capture_time", ros.float64(reading.frame.time_s), stamp)
        self._add_picture(reading, stamp)
        self._add(reading, "wrench/estimate", ros.wrench_stamped(reading.estimate, stamp, reading.endcap), stamp)
        for topic, data in numbers_of(reading, stamp):
            self._add(reading, topic, data, stamp)
        self._write_notes()
        self._diagnose(reading.ready_s, stamp)
        self.frames += 1
        if self._bytes >= CHUNK_BYTES or time.monotonic() >= self._flushed_s + FLUSH_S:
            self._flush()

    def add_note(self, text: str) -> None:
        """A line of the viewer's, stamped with the time at which it is written; from any thread."""
        self._notes.append(text)

    def idle(self) -> None:
        """Why no frame comes is recorded too."""
        self._write_notes()
        self._diagnose(time.monotonic(), self._stamps.now_ns())
        self._flush()

    def admit(self, reading: EndcapReading) -> bool:
        """What follows a gap could not be replayed to the bit: it is lost until the endcap has begun anew.

        Half of the queue must be free for that, or the next gap would come at once and live filters begin anew with it.
        """
        endcap = reading.endcap
        if reading.epoch <= self._old[endcap]:
            return False  # from before the recording
        if reading.epoch > self._gap[endcap] and not self._full:
            return True
        self.dropped += 1
        if reading.epoch > self._gap[endcap]:
            self._gap[endcap] = reading.epoch
            self._behind.add(endcap)
        if endcap in self._behind and 2 * len(self._queue) <= (self._queue.maxlen or 0):
            self._behind.remove(endcap)
            self._restart(endcap)
        return False

    def close(self, wait_s: float = 5.0) -> None:
        """Write the queued readings and the end of the file; gives up after ``wait_s``."""
        super().close(wait_s)
        if not (self.ended or self._whole):
            self.failed = self.failed or "the disk did not answer in time"

    def finish(self) -> None:
        """Index and end of the file, if it can still be written."""
        try:
            if not self.failed:
                self._write_notes()
                self._flush()
                self._writer.finish()
                self._writer.flush()
                self._whole = True
                put_on_disk(self._stream, self.path)
        finally:
            self._index.close()
            self._stream.close()

    def _discard(self) -> None:
        """Leave no file behind of a recording that cannot begin."""
        for let_go in (self._index.close, self._stream.close, self.path.unlink if self._made else None):
            with contextlib.suppress(OSError):
                if let_go is not None:
                    let_go()

    def _add_picture(self, reading: EndcapReading, stamp: int) -> None:
        """Write the input of a replay: the picture, or the dots seen in it."""
        frame_id = ros.camera_frame(reading.endcap)
        if self.pictures is Pictures.FULL:
            data, form = ros.picture_bytes(reading.frame)
            self._add(reading, "image/compressed", ros.compressed_image(data, form, stamp, frame_id), stamp)
            self._add(reading, "array/shear_vector", ros.shear_vector(reading.field), stamp)
            self._add_camera(reading, 1.0, stamp)
            return
        if self.pictures is Pictures.HALF and (data := half_picture(reading.frame)):
            self._add(reading, "image/compressed", ros.compressed_image(data, "jpeg", stamp, frame_id), stamp)
            self._add_camera(reading, 0.5, stamp)
        if reading.tracks is None:
            self._add(reading, "refused", refused_message(reading), stamp)
        self._add(reading, "tracks", tracks_message(reading), stamp)

    def _add_camera(self, reading: EndcapReading, scale: float, stamp: int) -> None:
        """Write the camera of a picture, as large as the picture that is recorded."""
        if self._cameras is not None and (camera := self._cameras.of(reading, scale)) is not None:
            self._add(reading, "camera_info", camera_info(camera, stamp, ros.camera_frame(reading.endcap)), stamp)

    def _place(self, stamp: int) -> None:
        """Write the frames, where they are others than before: a reference may show another camera."""
        children = {} if self._cameras is None else self._cameras.transforms()
        if children and (placed := transforms(children, 0)) != self._placed:
            self._placed = placed
            self._writer.add_message(self._channels[STATIC], stamp, transforms(children, stamp), stamp)

    def _write_notes(self) -> None:
        while self._notes:
            stamp = self._stamps.now_ns()
            self._writer.add_message(self._channels[NOTES], stamp, ros.string(self._notes.popleft()), stamp)

    def _flush(self) -> None:
        """End the chunk: the readings so far are in the file."""
        self._writer.flush()
        write_soon(self._stream)
        self.kept, self._bytes, self._flushed_s = self.frames, 0, time.monotonic()

    def _diagnose(self, now_s: float, stamp: int) -> None:
        if now_s < self._next_s:
            return
        self._next_s = now_s + DIAGNOSTICS_S
        states = [diagnosis(health) for health in self._health()]
        self._writer.add_message(
            self._channels["/diagnostics"], stamp, ros.diagnostic_array(states, stamp), stamp, self.frames
        )

    def _add(self, reading: EndcapReading, topic: str, data: bytes, stamp: int) -> None:
        channel = self._channels[f"/{reading.endcap}/{topic}"]
        self._writer.add_message(channel, stamp, data, stamp, reading.frame.sequence % 2**32)
        self._bytes += len(data)

    def _channel(self, topic: str, kind: str, settings: dict[str, str] | None = None) -> None:
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", ros.definition(kind).encode())
        self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind], settings or {})
