"""Preview of an endcap without valid numbers: its newest picture, the dots found in it, and the light.

This is what is needed while focus and lamp are adjusted, before there is any reference. Finding dots costs 20 ms, so it
is done a few times a second at most, and only while somebody looks.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from cad.errors import EndcapError
from cad.params import EndcapParams
from sensing.decode import decode_gray
from sensing.records import Frame
from sensing.tracking.dots import find_dots

PERIOD_S = 0.4  # between looks at one endcap


class Preview:
    """Of one endcap.

    Args:
        params: the endcap, whose dots are looked for.
    """

    def __init__(self, params: EndcapParams) -> None:
        self._params = params
        self._next_s = 0.0
        self._last: dict[str, Any] = {}

    def detail(self, frame: Frame, number: int) -> dict[str, Any]:
        """As :func:`sensing.live.web.state.detail`: dots as [x, y, 1], no field, and a line in words."""
        if time.monotonic() >= self._next_s:
            self._last = _look(frame, self._params)
            self._next_s = time.monotonic() + PERIOD_S
        size = frame.size or self._last.get("size") or (640, 480)
        return {
            "number": number, "sequence": frame.sequence, "field": [], "cells": [0, 0, 1], "dots": [], "preview": "",
            **self._last, "size": list(size),
        }  # fmt: skip


def _look(frame: Frame, params: EndcapParams) -> dict[str, Any]:
    try:
        gray = decode_gray(frame)
        dots = find_dots(gray, least=0, params=params).position_px
    except EndcapError as error:
        return {"preview": str(error)}
    bright, contrast = float(gray.mean()), float(np.percentile(gray, 95) - np.percentile(gray, 5))
    line = f"{len(dots)} dots found, mean brightness {bright:.0f} of 255, contrast {contrast:.0f}"
    found = np.column_stack([dots, np.ones(len(dots))]).round(1).tolist() if len(dots) else []
    return {"preview": line, "dots": found, "size": [gray.shape[1], gray.shape[0]]}
