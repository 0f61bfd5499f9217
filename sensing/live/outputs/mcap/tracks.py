"""Dots of every frame in recordings without full pictures, to and from ROS 2 messages.

``tracks`` (std_msgs/Float64MultiArray): the likeness of the picture with the reference, then a row of x, y, quality
and lost for every dot; numbers as they were computed, so that a replay gives the same bits. ``refused``
(std_msgs/String, JSON), only where the picture gave no dots: why. ``/notes`` (std_msgs/String): what was typed while
it was recorded.
"""

from __future__ import annotations

import json
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from sensing.decode import decode_bgr
from sensing.live.core.gate import Verdict
from sensing.live.core.reading import EndcapReading
from sensing.live.core.seen import SeenFrame
from sensing.live.core.state import Event
from sensing.live.outputs.ros import types as ros
from sensing.records import Frame

ROWS, TEXT = "std_msgs/msg/Float64MultiArray", ros.STRING
TRACK_TOPICS: dict[str, str] = {"tracks": ROWS, "refused": TEXT}
NOTES = "/notes"
COLUMNS, QUALITY = 4, 75


def tracks_message(reading: EndcapReading) -> bytes:
    """Dots of a frame; no row where the picture gave none."""
    rows, likeness = _rows(reading)
    types = ros.typestore().types
    dimension = types["std_msgs/msg/MultiArrayDimension"]
    layout = types["std_msgs/msg/MultiArrayLayout"](
        dim=[
            dimension(label="dot", size=len(rows), stride=rows.size),
            dimension(label="x, y, quality, lost", size=COLUMNS, stride=COLUMNS),
        ],
        data_offset=1,
    )
    return ros.encode(ROWS, types[ROWS](layout=layout, data=np.r_[likeness, rows.ravel()]))


def refused_message(reading: EndcapReading) -> bytes:
    """Why a picture gave no dots."""
    said = {"event": reading.event.value, "reason": reading.reason, "flags": sorted(reading.wrench.flags)}
    return ros.string(json.dumps(said))


def rows_of(message: Any) -> tuple[NDArray[np.float64] | None, float]:
    """(rows or None, likeness) of a ``tracks`` message.

    Raises:
        ValueError: numbers that are none of ours.
    """
    data = np.asarray(message.data, np.float64)
    if not len(data) or (len(data) - 1) % COLUMNS:
        raise ValueError(f"{len(data)} numbers")
    rows = data[1:].reshape(-1, COLUMNS)
    return (rows if len(rows) else None), float(data[0])


def refusal_of(message: Any) -> Verdict:
    """Why a picture gave no dots, from a ``refused`` message.

    Raises:
        ValueError, KeyError, TypeError: text that is none of ours.
    """
    said = json.loads(message.data)
    return Verdict(Event(said["event"]), str(said["reason"]), frozenset(map(str, said["flags"])))


def half_picture(frame: Frame) -> bytes:
    """JPEG of half the width and height; unchanged if already halved; empty if it cannot be read."""
    if isinstance(frame, SeenFrame):
        return frame.jpeg or b""
    try:
        image = decode_bgr(frame)
    except EndcapError:
        return b""
    small = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def _rows(reading: EndcapReading) -> tuple[NDArray[np.float64], float]:
    tracks = reading.tracks
    if tracks is None:
        return np.zeros((0, COLUMNS)), float("nan")
    return np.column_stack([tracks.position_px, tracks.quality, tracks.lost]), reading.likeness
