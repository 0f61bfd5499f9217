"""Modes of a Video4Linux camera, from its driver by ioctl (without streaming, so that it may be in use).

Source: Linux media API, struct layouts of <linux/videodev2.h> (UAPI, stable): VIDIOC_QUERYCAP, VIDIOC_ENUM_FMT,
VIDIOC_ENUM_FRAMESIZES, VIDIOC_ENUM_FRAMEINTERVALS. Units: pixels, frames per second.
"""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
VIDEO_CAPTURE, DEVICE_CAPABILITIES = 0x1, 0x80000000
DISCRETE = 1  # V4L2_FRMSIZE_TYPE_DISCRETE and V4L2_FRMIVAL_TYPE_DISCRETE
USUAL_SIZES = ((640, 480), (800, 600), (1280, 720), (1920, 1080))  # tried where the driver gives a range
MOST = 256  # entries of any list; a broken driver may never end it

Ioctl = Callable[[int, int, bytearray], int]


@dataclass(frozen=True)
class CameraMode:
    """One mode.

    Attributes:
        pixel_format: four characters as the driver says it, "MJPG" or "YUYV".
        size: (width, height).
        rates_hz: frame rates, highest first; empty where the driver does not say.
    """

    pixel_format: str
    size: tuple[int, int]
    rates_hz: tuple[float, ...]

    def __str__(self) -> str:
        rates = ", ".join(f"{rate:g}" for rate in self.rates_hz) or "unknown"
        return f"{self.pixel_format} {self.size[0]}x{self.size[1]} at {rates} frames/s"


def read_modes(path: str, ioctl: Ioctl | None = None) -> list[CameraMode]:
    """All modes of the device file, MJPEG first; empty if it captures no video.

    Args:
        path: such as /dev/video0.
        ioctl: stand-in for the system call (descriptor, request, buffer to fill), for tests.

    Raises:
        OSError: the file cannot be opened or is no Video4Linux device.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK)
    try:
        call = ioctl or _system_ioctl
        if not _captures(descriptor, call):
            return []
        found = [
            CameraMode(name, size, tuple(sorted(_rates(descriptor, code, size, call), reverse=True)))
            for code, name in _formats(descriptor, call)
            for size in _sizes(descriptor, code, call)
        ]
    finally:
        os.close(descriptor)
    return sorted(found, key=lambda mode: (mode.pixel_format != "MJPG", mode.pixel_format, mode.size))


def _system_ioctl(descriptor: int, request: int, buffer: bytearray) -> int:
    import fcntl

    return fcntl.ioctl(descriptor, request, buffer)


def _read_write(number: int, size: int) -> int:
    """_IOWR('V', number, size) of <asm-generic/ioctl.h>."""
    return (3 << 30) | (size << 16) | (ord("V") << 8) | number


def _captures(descriptor: int, ioctl: Ioctl) -> bool:
    buffer = bytearray(104)  # struct v4l2_capability
    ioctl(descriptor, (2 << 30) | (104 << 16) | (ord("V") << 8), buffer)  # VIDIOC_QUERYCAP is _IOR
    capabilities, device = struct.unpack_from("II", buffer, 84)
    return bool((device if capabilities & DEVICE_CAPABILITIES else capabilities) & VIDEO_CAPTURE)


def _entries(descriptor: int, number: int, fill: Callable[[int], bytearray], ioctl: Ioctl) -> Iterator[bytearray]:
    """Entries 0, 1, ... of a list until the driver refuses (EINVAL)."""
    for index in range(MOST):
        buffer = fill(index)
        try:
            ioctl(descriptor, _read_write(number, len(buffer)), buffer)
        except OSError:
            return
        yield buffer


def _formats(descriptor: int, ioctl: Ioctl) -> Iterator[tuple[int, str]]:
    """(code, name) of the pixel formats: struct v4l2_fmtdesc, 64 bytes, the code at 44."""

    def fill(index: int) -> bytearray:
        return bytearray(struct.pack("II", index, CAPTURE).ljust(64, b"\0"))

    for buffer in _entries(descriptor, 2, fill, ioctl):
        (code,) = struct.unpack_from("I", buffer, 44)
        yield code, struct.pack("I", code).decode("latin-1").strip()


def _sizes(descriptor: int, code: int, ioctl: Ioctl) -> Iterator[tuple[int, int]]:
    """Sizes of a format: struct v4l2_frmsizeenum, 44 bytes; of a range, the usual sizes within."""

    def fill(index: int) -> bytearray:
        return bytearray(struct.pack("II", index, code).ljust(44, b"\0"))

    for buffer in _entries(descriptor, 74, fill, ioctl):
        kind, *numbers = struct.unpack_from("7I", buffer, 8)
        if kind == DISCRETE:
            yield numbers[0], numbers[1]
            continue
        low_x, high_x, _, low_y, high_y, _ = numbers
        yield from (s for s in USUAL_SIZES if low_x <= s[0] <= high_x and low_y <= s[1] <= high_y)
        return  # a range is the only entry


def _rates(descriptor: int, code: int, size: tuple[int, int], ioctl: Ioctl) -> Iterator[float]:
    """Rates of a format and size: struct v4l2_frmivalenum, 52 bytes, intervals as fractions of seconds."""

    def fill(index: int) -> bytearray:
        return bytearray(struct.pack("4I", index, code, *size).ljust(52, b"\0"))

    for buffer in _entries(descriptor, 75, fill, ioctl):
        kind, *numbers = struct.unpack_from("7I", buffer, 16)
        intervals = [numbers[:2]] if kind == DISCRETE else [numbers[:2], numbers[2:4]]
        with contextlib.suppress(ZeroDivisionError):
            yield from [below / above for above, below in intervals]
        if kind != DISCRETE:
            return
