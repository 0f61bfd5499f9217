"""Loads the compiled code before the first frame comes; on a new computer it is compiled then, which takes a while."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from cad.materials import DEFAULT_SILICONE, silicone
from cad.params import EndcapParams
from sensing.records import Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.tracking.model_input import model_input
from sensing.tracking.mounting import common_motion
from sensing.tracking.own_weight import OwnWeight

PATIENCE_S = 1.5  # what takes longer is announced
JUMP_PX = 25  # a picture shifted by this makes the tracker search


def warm_up(say: Callable[[str], object]) -> None:
    """Follow the dots of a drawing at rest, shifted and half covered: every way through the tracker, and its fits.

    Args:
        say: is called, from another thread, when this takes long.
    """
    notice = threading.Timer(
        PATIENCE_S, say, ["loading the dot tracker: half a minute where it must be compiled, once on this computer"]
    )
    notice.daemon = True
    notice.start()
    try:
        image, _ = draw_dots(Drawing(specks=0, digit=""))
        covered = image.copy()
        covered[:, : image.shape[1] // 2] = 0
        params = EndcapParams(130.0, 8.0)
        seen = model_input(Frame(0.0, 0, "drawing", image=image), (16, 16), params)
        own_weight = OwnWeight(seen, params, silicone(DEFAULT_SILICONE))
        for number, picture in enumerate((image, covered, np.roll(image, JUMP_PX, axis=1))):
            frame = Frame(float(number), number, "drawing", image=np.ascontiguousarray(picture))
            tracks = seen.track(seen.decode(frame), frame.time_s)
            common_motion(tracks)
            seen.field(tracks, own_weight.motion(tracks))
    finally:
        notice.cancel()
