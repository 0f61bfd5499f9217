"""Frames from files: one picture, a folder of pictures, a video. Times are those of the recording, starting at zero."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import cv2

from cad.errors import FileError
from sensing.decode import decode_file
from sensing.records import Frame

PICTURES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff")
DEFAULT_RATE_HZ = 30.0


def read_picture(path: Path | str, sequence: int = 0, time_s: float = 0.0) -> Frame:
    """One picture file as a frame; JPEG stays compressed until someone decodes it at the size needed.

    Args:
        path: of the file. sequence: number of the frame. time_s: its time.

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
    """The pictures of a folder in the order of their names.

    Args:
        folder: holds pictures.
        rate_hz: rate that the frame times follow.

    Raises:
        FileError: no folder that can be read, or no picture in it.
    """

    def __init__(self, folder: Path | str, rate_hz: float = DEFAULT_RATE_HZ) -> None:
        self.name = str(folder)
        self._rate_hz = rate_hz
        try:
            self._paths = sorted(p for p in Path(folder).iterdir() if p.suffix.lower() in PICTURES)
        except OSError as error:
            raise FileError(f"{folder}: {error.strerror or error}: give a readable folder of pictures") from None
        if not self._paths:
            raise FileError(f"{folder}: no picture in it: expected files of type {', '.join(PICTURES)}")

    def __len__(self) -> int:
        return len(self._paths)

    def __iter__(self) -> Iterator[Frame]:
        for index, path in enumerate(self._paths):
            yield read_picture(path, index, index / self._rate_hz)


class VideoSource:
    """The frames of a video file, with the times that the file states.

    Raises:
        FileError: no such file, or no video that OpenCV can open.
    """

    def __init__(self, path: Path | str) -> None:
        self.name = str(path)
        if not os.path.isfile(path):  # unlike the method of Path, of a locked folder, too
            raise FileError(f"{path}: no such file: give a video")
        capture = cv2.VideoCapture(self.name)
        try:
            if not capture.isOpened() or not capture.read()[0]:
                raise FileError(f"{path}: no video that can be read: give a file that plays, such as .avi or .mp4")
        finally:
            capture.release()

    def __iter__(self) -> Iterator[Frame]:
        capture = cv2.VideoCapture(self.name)
        rate_hz = capture.get(cv2.CAP_PROP_FPS) or DEFAULT_RATE_HZ
        try:
            sequence = 0
            while True:
                known, image = capture.read()
                if not known:
                    return
                yield Frame(sequence / rate_hz, sequence, self.name, image=image)
                sequence += 1
        finally:
            capture.release()


def jpeg_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) from the start-of-frame marker of a JPEG (ITU T.81, B.2.2); None if it is none."""
    if data[:2] != b"\xff\xd8":
        return None
    place = 2
    while place + 9 <= len(data) and data[place] == 0xFF:
        marker = data[place + 1]
        if marker == 0xFF:  # fill byte
            place += 1
            continue
        length = int.from_bytes(data[place + 2 : place + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height = int.from_bytes(data[place + 5 : place + 7], "big")
            return int.from_bytes(data[place + 7 : place + 9], "big"), height
        place += 2 + length
    return None
