"""A USB camera through Video4Linux and OpenCV: compressed frames as they come, with the driver's capture time.

Video4Linux stamps buffers with CLOCK_MONOTONIC, the clock of ``time.monotonic`` on Linux, so the stamp is taken over
when it is near the arrival, else the arrival is.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cad.errors import ParameterError, printable
from sensing.decode import jpeg_size
from sensing.records import Frame
from sensing.sources.newest import SourceError
from sensing.sources.v4l2 import CameraMode, read_modes

BY_PATH = Path("/dev/v4l/by-path")  # of udev
COMPRESSED = tuple(cv2.VideoWriter.fourcc(*name) for name in ("MJPG", "JPEG"))
STAMP_TRUST_S = 0.5  # a driver's stamp older than this, or from the future, is not used


@dataclass(frozen=True)
class CameraConfig:
    """Requested mode of a camera; it may choose another one, which the frames then have.

    Attributes:
        device: number N of /dev/videoN.
        size: (width, height).
        rate_hz: frames per second.
        exposure: fixed exposure in the driver's unit (100 us for USB cameras); None leaves it automatic.
    """

    device: int = 0
    size: tuple[int, int] = (640, 480)
    rate_hz: float = 30.0
    exposure: float | None = None

    def __post_init__(self) -> None:
        if self.device < 0 or min(self.size) < 1 or self.rate_hz <= 0:
            raise ParameterError(
                f"device={self.device}, size={self.size}, rate_hz={self.rate_hz}: need device >= 0, size and rate > 0",
                name="device",
                value=self.device,
            )


class CameraSource:
    """Frames of a camera until it is unplugged (then SourceError).

    Raises:
        SourceError: no such device, no permission, or busy; the message says which.
    """

    def __init__(self, config: CameraConfig) -> None:
        self.config = config
        self.name = f"/dev/video{config.device}"
        _require_usable(Path(self.name))

    def __iter__(self) -> Iterator[Frame]:
        capture = _open(self.config, self.name)
        reported = capture.get(cv2.CAP_PROP_EXPOSURE)
        exposure = reported if reported > 0 else None  # OpenCV gives 0 or -1 of a driver that does not say it
        try:
            sequence = 0
            while True:
                known, data = capture.read()
                arrival_s = time.monotonic()
                if not known or data is None:
                    raise SourceError(f"{self.name}: no more frames: is it unplugged?")
                stamp_s = capture_time_s(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3, arrival_s)
                yield to_frame(data, stamp_s, sequence, self.name, exposure)
                sequence += 1
        finally:
            capture.release()


def capture_time_s(stamp_s: float, arrival_s: float) -> float:
    """The driver's stamp if it is believable, else the arrival."""
    return stamp_s if 0 <= arrival_s - stamp_s < STAMP_TRUST_S else arrival_s


def to_frame(data: np.ndarray, time_s: float, sequence: int, name: str, exposure: float | None) -> Frame:
    """A frame from the driver's data.

    Args:
        data: JPEG bytes as a row of uint8, or a decoded (H, W, 3) picture.
        time_s: of capture.
        sequence: number of the frame.
        name: of the source.
        exposure: as the driver states it; None where it does not.
    """
    if data.ndim == 2 and 1 in data.shape:
        jpeg = data.tobytes()
        return Frame(time_s, sequence, name, jpeg=jpeg, size=jpeg_size(jpeg), exposure=exposure)
    return Frame(time_s, sequence, name, image=data, exposure=exposure)


def list_devices(root: Path = Path("/sys/class/video4linux")) -> list[tuple[int, str]]:
    """(N, name) of every /dev/videoN that captures, in order; empty where there is none."""
    found = []
    for entry in sorted(root.glob("video*"), key=lambda p: int(p.name[5:])) if root.is_dir() else []:
        index = entry / "index"
        if index.is_file() and index.read_text().strip() not in ("", "0"):
            continue  # the second node of a USB camera carries metadata only
        name = entry / "name"
        found.append(
            (int(entry.name[5:]), printable(name.read_text(errors="replace").strip()) if name.is_file() else "camera")
        )
    return found


def lasting_name(number: int, root: Path | None = None) -> str:
    """Name of /dev/videoN by the USB port that it is plugged into; ``N`` where the computer has no such names.

    Numbers follow the order in which cameras answer at the start of the computer; the port stays.
    """
    root = root or BY_PATH
    for link in sorted(root.glob("*-video-index*")) if root.is_dir() else []:
        if link.resolve().name == f"video{number}":
            return str(link)
    return str(number)


def device_number(path: str) -> int:
    """N of the /dev/videoN that a name such as one of /dev/v4l/by-path stands for now.

    Raises:
        SourceError: nothing is plugged in there, or it is no camera.
    """
    name = Path(path).resolve().name
    if not Path(path).exists():
        raise SourceError(f"{path}: no such camera: plug it into this port, or run python -m sensing.setup again")
    if not (name.startswith("video") and name[5:].isdecimal()):
        raise SourceError(f"{path}: no camera: give a number or a name of {BY_PATH}")
    return int(name[5:])


def list_modes(device: int) -> list[CameraMode]:
    """Modes of /dev/videoN as its driver lists them (pixel format, size, rates), MJPEG first.

    Raises:
        SourceError: see :class:`CameraSource`.
    """
    path = f"/dev/video{device}"
    _require_usable(Path(path))
    try:
        return read_modes(path)
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror}: is it a camera? see list_devices") from None


def _require_usable(path: Path) -> None:
    """Refuse an unusable device with a precise reason, because OpenCV fails without one."""
    if not path.exists():
        known = ", ".join(f"/dev/video{n} ({name})" for n, name in list_devices()) or "none"
        raise SourceError(f"{path}: no such camera; found: {known}: plug it in or choose another")
    try:
        path.open("rb").close()
    except PermissionError:
        raise SourceError(f"{path}: no permission: add yourself to the group 'video' and log in again") from None
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror}: close the program that uses it, or plug it in again") from None


def _open(config: CameraConfig, name: str) -> cv2.VideoCapture:
    _require_usable(Path(name))
    capture = cv2.VideoCapture(config.device, cv2.CAP_V4L2)
    if not capture.isOpened():
        raise SourceError(f"{name}: busy or no camera: close the program that uses it")
    capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, config.size[0])
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, config.size[1])
    capture.set(cv2.CAP_PROP_FPS, config.rate_hz)
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 2)  # with one the driver has none between reads, and frames get lost
    if capture.get(cv2.CAP_PROP_FOURCC) in COMPRESSED:  # else OpenCV converts to BGR: raw YUV is no picture
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)  # leave the JPEG alone: each method decodes what it needs
    if config.exposure is not None:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)  # V4L2_EXPOSURE_MANUAL
        capture.set(cv2.CAP_PROP_EXPOSURE, config.exposure)
    return capture
