"""Messages of a recording as the records they came from: pictures, references, times, wrenches.

Every function raises DamagedError (:mod:`sensing.live.mcap_records`) for bytes that are no such message; ``path`` is
named in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.records import Message

from sensing.decode import MOST_PIXELS, FrameError, jpeg_size, png_size
from sensing.live.core.kept import Kept, kept_of
from sensing.live.mcap_records import DamagedError
from sensing.live.outputs.ros import types as ros
from sensing.records import Frame
from sensing.tracking.zero import Zero, single_zero

LATEST_S = 1e9  # capture times beyond are no times


def zero_in(path: Path, endcap: str, message: Message, noise: Message | None = None) -> Zero:
    """The reference of a ``zero`` message.

    Args:
        path: of the recording.
        endcap: name.
        message: of that topic.
        noise: the ``zero_error_px`` that goes with it; None where it is yet to come, or in recordings of before.
    """
    try:
        zero = single_zero(picture_in(path, endcap, message, 0.0), endcap)
    except FrameError as error:
        raise _unusable(path, message, f"no reference: {error}") from None
    return zero if noise is None else with_error(path, zero, noise)


def with_error(path: Path, zero: Zero, message: Message) -> Zero:
    """A reference with how much its dots scatter, of a ``zero_error_px`` message.

    Args:
        path: of the recording.
        zero: the reference.
        message: of that topic.
    """
    error_px = float(_decoded(path, ros.FLOAT64, message).data)
    if not 0 <= error_px < min(zero.image.shape[:2]):
        raise _unusable(path, message, f"dots that scatter by {error_px} px")
    return replace(zero, error_px=error_px)


def kept_in(path: Path, message: Message) -> Kept:
    """State kept from earlier frames, from a ``kept`` message."""
    return read_message(path, ros.STRING, message, lambda reported: kept_of(reported.data))


def picture_in(path: Path, endcap: str, message: Message, time_s: float) -> Frame:
    """A picture as it was recorded, even a faulty one: the pipeline then gives the same result as live.

    Args:
        path: of the recording.
        endcap: name.
        message: of a topic of pictures.
        time_s: its capture time.
    """
    reported = _decoded(path, ros.IMAGE, message)
    data, sequence = bytes(reported.data), message.sequence
    if reported.format == ros.FAULT and data:
        return Frame(time_s, sequence, endcap, jpeg=data, fault=data.decode(errors="replace"))
    if reported.format == "jpeg" and data:
        return Frame(time_s, sequence, endcap, jpeg=data, size=jpeg_size(data))
    size = png_size(data)
    if size is None or not 0 < size[0] * size[1] <= MOST_PIXELS:
        raise _unusable(path, message, f"a picture of {size} px")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise _unusable(path, message, "no picture")
    return Frame(time_s, sequence, endcap, image=image)


def time_in(path: Path, topic: str, message: Message) -> float:
    """The capture time of a message, s.

    Args:
        path: of the recording.
        topic: of the message, for the line that names it.
        message: a number.
    """
    value = float(_decoded(path, ros.FLOAT64, message).data)
    if not abs(value) < LATEST_S or math.isnan(value):
        raise _unusable(path, message, f"{topic} {value}")
    return value


def wrench_in(path: Path, message: Message) -> np.ndarray:
    """(6,) force and torque of a message, N and N m."""
    wrench = _decoded(path, ros.WRENCH, message).wrench
    return np.array([getattr(part, axis) for part in (wrench.force, wrench.torque) for axis in "xyz"], float)


def _decoded(path: Path, kind: str, message: Message) -> Any:
    try:
        return ros.decode(kind, message.data)
    except Exception as error:  # whatever the library makes of bytes that are no such message
        raise _unusable(path, message, f"no {kind}: {type(error).__name__}") from None


def read_message(path: Path, kind: str, message: Message, read: Callable[[Any], Any]) -> Any:
    """Result of a function of a message.

    Args:
        path: of the recording.
        kind: ROS type.
        message: of that type.
        read: its ValueError, KeyError or TypeError is damage.
    """
    reported = _decoded(path, kind, message)
    try:
        return read(reported)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise _unusable(path, message, f"{type(error).__name__}: {str(error)[:80]}") from None


def _unusable(path: Path, message: Message, reason: str) -> DamagedError:
    return DamagedError(
        f"{path}: message {message.sequence} of {message.log_time / 1e9:.3f} s is damaged ({reason}): what stands "
        "before it is read"
    )
