"""Frames from files: one picture, a folder of pictures, a video. Times are those of the recording, starting at zero."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median

import cv2

from cad.errors import FileError
from cad.extras import program
from sensing.decode import decode_file, jpeg_size
from sensing.records import Frame
from sensing.sources.coding import coding_of, cut_note

PICTURES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff")
RECORDINGS = {b"\x89MCAP0\r\n": "MCAP", b"#ROSBAG": "ROS 1 bag", b"SQLite format 3\0": "ROS 2 bag"}
DEFAULT_RATE_HZ = 30.0
GAP_STEPS = 1.5  # of the usual step of a folder's numbers, which may be times that scatter


def read_picture(path: Path | str, sequence: int = 0, time_s: float = 0.0) -> Frame:
    """One picture file as a frame; JPEG stays compressed until someone decodes it at the size needed.

    Args:
        path: of the file.
        sequence: number of the frame.
        time_s: its time.

    Raises:
        FileError: missing, unreadable, or no picture.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: {error.strerror or error}: give an existing, readable picture") from None
    size = jpeg_size(data)
    if size is not None:
        return Frame(time_s, sequence, str(path), jpeg=data, size=size)
    return Frame(time_s, sequence, str(path), image=decode_file(path, data, ", ".join(PICTURES)))


class FolderSource:
    """The pictures of a folder in the order of their names, numbers in them by their value: 2.jpg comes before 10.jpg.

    Args:
        folder: holds pictures.
        rate_hz: rate that the frame times follow.
        faulty: give a picture that cannot be read as a frame with its fault, for readers that count such frames;
            without it, it is an error.

    Attributes:
        note: after the last picture, one line that counts those with a fault; empty where there was none.

    Raises:
        FileError: no folder that can be read, or no picture in it.
    """

    def __init__(self, folder: Path | str, rate_hz: float = DEFAULT_RATE_HZ, faulty: bool = False) -> None:
        self.name, self.note = str(folder), ""
        self._rate_hz, self._faulty = rate_hz, faulty
        try:
            there = [p for p in Path(folder).iterdir() if not p.name.startswith(".")]  # macOS puts ._a.jpg beside a.jpg
            pictures = [p for p in there if p.suffix.lower() in PICTURES]
            self._paths = sorted(pictures, key=lambda path: (_by_number(path.name), path.name))
        except OSError as error:
            raise FileError(f"{folder}: {error.strerror or error}: give a readable folder of pictures") from None
        if not self._paths:
            raise FileError(f"{folder}: no picture in it: expected files of type {', '.join(PICTURES)}")

    def __len__(self) -> int:
        return len(self._paths)

    @property
    def gaps(self) -> list[tuple[str, str]]:
        """Names of neighbours between which pictures are missing: their numbers step by more than is usual here."""
        numbers = [_by_number(path.stem) for path in self._paths]
        steps = [_step(*pair) for pair in pairwise(numbers)]
        usual = median(known) if (known := [step for step in steps if step]) else 0
        names = pairwise(path.name for path in self._paths)
        return [pair for pair, step in zip(names, steps, strict=True) if step > GAP_STEPS * usual]

    def __iter__(self) -> Iterator[Frame]:
        faults: list[str] = []
        for index, path in enumerate(self._paths):
            time_s = index / self._rate_hz
            try:
                frame = read_picture(path, index, time_s)
            except FileError as error:
                if not self._faulty:
                    raise
                faults.append(str(error))
                frame = Frame(time_s, index, str(path), jpeg=faults[-1].encode(), fault=faults[-1])
            yield frame
        self.note = f"{len(faults)} of {len(self)} pictures cannot be read ({faults[0]})" if faults else ""


def _step(one: list[str | int], other: list[str | int]) -> int:
    """By how much the last number of a name rises from one to the next; 0 where the names differ elsewhere."""
    alike = len(one) == len(other) > 2 and one[:-2] == other[:-2] and one[-1] == other[-1]
    return int(other[-2]) - int(one[-2]) if alike else 0


def _by_number(name: str) -> list[str | int]:
    """What sorts names as people count: text and numbers in turn."""
    return [int(part) if place % 2 else part for place, part in enumerate(re.split(r"([0-9]+)", name))]


class VideoSource:
    """The frames of a video file, with the times that the file states, from zero; its pixels as they are stored.

    From the first stated time that does not increase on, the stated rate counts.

    Attributes:
        note: after the last frame, one line where the file ended before what it states; else empty.
        coding: so far, as of :func:`sensing.sources.coding.coding_of`.

    Raises:
        FileError: no such file, a recording, or no video that OpenCV can open.
    """

    def __init__(self, path: Path | str) -> None:
        self.name, self.note, self.coding = str(path), "", ""
        if not os.path.isfile(path):  # unlike the method of Path, of a locked folder, too
            raise FileError(f"{path}: no such file: give a video")
        _require_no_recording(path)
        capture = cv2.VideoCapture(self.name)
        try:
            if not capture.isOpened() or not capture.read()[0]:
                raise FileError(
                    f"{path}: no video that OpenCV can read: it is cut, no video, or of a coding without a decoder, "
                    "such as AV1: give a whole one, best MJPEG in .avi"
                )
        finally:
            capture.release()

    def __iter__(self) -> Iterator[Frame]:
        capture = cv2.VideoCapture(self.name)
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        times, sequence, time_s = _Times(capture.get(cv2.CAP_PROP_FPS)), 0, 0.0
        try:
            while True:
                known, image = capture.read()
                if not known:
                    break
                time_s = times.next(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
                self.coding = self.coding or coding_of(capture, self.name)
                yield Frame(time_s, sequence, self.name, image=image, coding=self.coding)
                sequence += 1
            self.note = cut_note(self.name, capture, sequence, time_s)
        finally:
            capture.release()


def _require_no_recording(path: Path | str) -> None:
    """Refuse what FFmpeg would search for JPEGs: it mixes the cameras of a recording, and invents their times.

    Raises:
        FileError: an empty file, or a recording.
    """
    with open(path, "rb") as file:
        head = file.read(max(map(len, RECORDINGS)))
    if not head:
        raise FileError(f"{path}: an empty file, no video: copy or record it again")
    kind = next((name for mark, name in RECORDINGS.items() if head.startswith(mark)), "")
    if kind:
        raise FileError(
            f"{path}: a recording ({kind}), no video: give one of ours to {program('python -m sensing.live')} "
            "--replay, and the pictures of one camera of another as files in a folder"
        )


class _Times:
    """Times of a video's frames from what its container states; s.

    Args:
        rate_hz: stated frames a second; 0 where the file states none.
    """

    def __init__(self, rate_hz: float) -> None:
        self._step_s = 1 / rate_hz if rate_hz > 0 else 1 / DEFAULT_RATE_HZ
        self._first_s: float | None = None
        self._last_s, self._since = 0.0, 0  # last stated time, and frames since then

    def next(self, stated_s: float) -> float:
        """Time of the next frame, whose stated time is this."""
        if self._first_s is None:
            self._first_s = stated_s
            return 0.0
        since_s = stated_s - self._first_s
        if not self._since and self._last_s < since_s < float("inf"):
            self._last_s = since_s
            return since_s
        self._since += 1
        return self._last_s + self._since * self._step_s
