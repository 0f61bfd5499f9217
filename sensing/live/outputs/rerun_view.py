"""Readings in the Rerun viewer, where that is installed (``pip install rerun-sdk``); no dependency of the toolkit."""

from __future__ import annotations

import importlib
from typing import Any

from cad.errors import ParameterError
from sensing.live.core.reading import EndcapReading
from sensing.live.core.sink import QueuedSink
from sensing.live.outputs.mcap.stamps import CaptureStamps
from sensing.live.outputs.ros import types as ros

ROOM = 16


class RerunView(QueuedSink):
    """Logs pictures, forces and torques.

    Raises:
        ParameterError: Rerun is not installed.
    """

    def __init__(self) -> None:
        super().__init__(ROOM)
        try:
            self._rerun: Any = importlib.import_module("rerun")
        except ImportError:
            raise ParameterError("--rerun needs the Rerun viewer: run pip install rerun-sdk", name="rerun") from None
        self._stamps = CaptureStamps()
        self._rerun.init("endcaps", spawn=True)

    def write(self, reading: EndcapReading) -> None:
        """Picture and wrench of one reading."""
        rerun = self._rerun
        rerun.set_time("capture", timestamp=self._stamps.of(reading) / 1e9)
        frame = reading.frame
        if not frame.fault and (frame.jpeg is not None or frame.image is not None):  # not so of dots alone
            data, form = ros.picture_bytes(frame)
            rerun.log(f"{reading.endcap}/image", rerun.EncodedImage(contents=data, media_type=f"image/{form}"))
        for name, values in (("force_n", reading.wrench.force_n), ("torque_nm", reading.wrench.torque_nm)):
            for axis, value in zip("xyz", values, strict=True):
                rerun.log(f"{reading.endcap}/{name}/{axis}", rerun.Scalars(float(value)))
