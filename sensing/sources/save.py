"""One frame of a source as a picture file: ``python -m sensing.sources save --help``."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2

from cad.errors import EndcapError, FileError, printable
from cad.extras import program
from cad.messages import LOG, show
from cad.whole_file import replace_file, require_place
from sensing.arguments import number
from sensing.decode import decode_bgr
from sensing.records import Frame
from sensing.sources.camera import CameraConfig
from sensing.sources.choose import open_frames, source_opener
from sensing.sources.newest import FrameSource, LiveSource, SourceError

JPEG = (".jpg", ".jpeg")
SUFFIXES = (*JPEG, ".png")
SETTLE_S = 1.0  # E: a camera's own exposure and white balance have settled by then
WAIT_S = 6.0  # for a whole picture of a camera
PROG = "python -m sensing.sources save"


def main(arguments: Sequence[str]) -> int:
    """Save one frame; returns the exit status.

    Args:
        arguments: behind ``save``.
    """
    options = _parser().parse_args(arguments)
    try:
        frame = save_frame(options.source, options.file, CameraConfig(exposure=options.exposure))
    except EndcapError as error:
        LOG.error(f"sensing.sources: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("\nsensing.sources: stopped, nothing written")
        return 130
    width, height = frame.size or (0, 0)
    show(f"{options.file}: {width} x {height} px of {printable(frame.source)}")
    return 0


def save_frame(word: str, path: Path, camera: CameraConfig | None = None) -> Frame:
    """Write one frame, whole or not at all; the bytes of a camera's JPEG as they came, where the file is to be one.

    Args:
        word: for :func:`sensing.sources.choose.source_opener`; of a folder or a video the first picture is taken.
        path: of the picture; its suffix says the format.
        camera: mode and exposure of a camera.

    Returns:
        The frame, with its size.

    Raises:
        FileError: nothing of that name, no picture, another suffix, or a place that cannot be written.
        SourceError: a camera without a whole picture.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FileError(f"{path}: unknown picture format {path.suffix!r}; end the name in {' or '.join(SUFFIXES)}")
    require_place(path)
    opener, is_live = source_opener(word, camera)
    frame = _settled(opener, printable(word)) if is_live else _first(word)
    image = decode_bgr(frame)  # refuses damaged bytes
    data = frame.jpeg if frame.jpeg is not None and suffix in JPEG else cv2.imencode(suffix, image)[1].tobytes()
    replace_file(path, data)
    return frame


def _first(word: str) -> Frame:
    with open_frames(word) as frames:
        for frame in frames:
            return frame
    raise FileError(f"{word}: no picture in it: give another file")


def _settled(opener: Callable[[], FrameSource], name: str) -> Frame:
    """The first whole picture after a camera has settled."""
    end_s, settled_s, fault = time.monotonic() + WAIT_S, float("inf"), ""
    with LiveSource(opener) as live:
        while time.monotonic() < end_s:
            frame = live.get(0.1)
            if frame is None:
                if live.health.status == "unplugged":
                    raise SourceError(live.health.message)
                continue
            settled_s = min(settled_s, time.monotonic() + SETTLE_S)
            if time.monotonic() < settled_s:
                continue
            try:
                decode_bgr(frame)
            except EndcapError as error:
                fault = str(error)
                continue
            return frame
        why = fault or live.health.message or "no frame came"
    raise SourceError(f"{name}: no whole picture in {WAIT_S:g} s: {why}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program(PROG),
        description="Save one frame of a camera or file as a picture, for sensing.calibrate --photo for example; a "
        f"camera is given {SETTLE_S:g} s for its exposure to settle.",
        epilog="exit status: 0 written, 2 bad input or no whole picture (one line on stderr), 130 stopped",
    )
    parser.add_argument("source", help="camera number, address, folder, video or picture")
    parser.add_argument("file", type=Path, metavar="FILE", help="picture to write, .jpg or .png; one there is replaced")
    parser.add_argument("--exposure", type=number, metavar="V", help="fixed exposure, the driver's unit")
    return parser
