"""One word to a source: a camera number, an address, a folder, a video or a picture."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from cad import plugins
from cad.errors import FileError, printable
from cad.messages import LOG
from sensing.records import Frame
from sensing.sources.camera import CameraConfig, CameraSource, device_number, lasting_name
from sensing.sources.coding import coding_doubt
from sensing.sources.files import PICTURES, FolderSource, VideoSource, read_picture
from sensing.sources.mjpeg import MjpegSource
from sensing.sources.newest import FrameSource, OnArrival


def source_opener(word: str, camera: CameraConfig | None = None) -> tuple[Callable[[], FrameSource], bool]:
    """(function that opens the source anew, whether it is live and worth reopening when it ends).

    Args:
        word: ``0`` for the port of what is /dev/video0 now, a name of /dev/v4l/by-path, ``http://...``,
            ``NAME:ADDRESS`` of a plug-in, a folder of pictures, a video or a picture.
        camera: mode and exposure for a camera; its device number is replaced by ``word``.

    Raises:
        FileError: nothing of that name.
    """
    base = camera or CameraConfig()
    port = lasting_name(int(word)) if is_camera_number(word) else word  # cameras that come back may swap their numbers
    if is_camera_number(port):
        return lambda: CameraSource(replace(base, device=int(port))), True
    if port != word or port.startswith("/dev/"):  # looked up at every opening: the port stays, the number may not
        return lambda: CameraSource(replace(base, device=device_number(port))), True
    if is_address(word):
        return lambda: MjpegSource(word), True
    name, colon, address = word.partition(":")
    if colon and name in plugins.names(plugins.Kind.CAMERA):
        plugins.load(plugins.Kind.CAMERA, name)  # a broken one is named now, not in the thread that reopens it
        return lambda: plugins.make(plugins.Kind.CAMERA, name, "__iter__", address, base), True
    path = Path(word)
    if os.path.isdir(word):
        return lambda: FolderSource(path), False
    if not os.path.isfile(word) and ":/" in word:  # a path makes one slash of two
        raise FileError(
            f"{printable(word)}: no file, and no address that can be read: a camera on the network serves MJPEG and is "
            "given as http://HOST/... (--url of live)"
        )
    if not os.path.isfile(word):  # unlike the methods of Path, these take any text
        raise FileError(f"{word}: no camera number, address, folder or file: check the spelling")
    if path.suffix.lower() in PICTURES:
        return lambda: [read_picture(path)], False
    return lambda: VideoSource(path), False


def is_camera_number(word: str) -> bool:
    """Whether a word is a number as cameras have: up to four digits 0 to 9."""
    return len(word) <= 4 and word.isascii() and word.isdigit()


def is_address(word: str) -> bool:
    """Whether a word is the address of a camera on the network."""
    return word.startswith(("http://", "https://"))


@contextmanager
def open_frames(word: str, warn_of_coding: bool = True) -> Iterator[Iterable[Frame]]:
    """Frames of a source, which is closed afterwards; those of a camera as they arrive.

    Args:
        word: as of :func:`source_opener`.
        warn_of_coding: of a video that keeps parts of its pictures; not for readers whose readings are flagged for it.

    Raises:
        FileError: nothing of that name.
    """
    opened, live = source_opener(word)
    source = opened()
    frames = OnArrival(iter(source)) if live else iter(source)
    try:
        yield frames
    finally:
        close = getattr(frames, "close", None)
        if close is not None:
            close()
    if note := getattr(source, "note", ""):  # of a video that ended too early
        LOG.warning(note)
    if warn_of_coding and (coding := getattr(source, "coding", "")):
        LOG.warning(f"{word}: {coding_doubt(coding)}")
