"""Loads the compiled code before the first frame comes; on a new computer it is compiled then, which takes a while."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from sensing.live.core.config import EndcapConfig
from sensing.live.core.model import LiveModel
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import Frame, ShearField, Wrench
from sensing.sources.drawn import Drawing, draw_dots

PATIENCE_S = 4.0  # loading takes 2 s; what takes longer is announced
JUMP_PX = 25  # a picture shifted by this makes the tracker search
RATE_HZ = 30.0
PRESS_N = (1.0, 0.5, -10.0)  # beside the tip: contact and its place are looked for
SHAPE = (16, 16)


def warm_up(say: Callable[[str], object]) -> None:
    """Run a whole pipeline on drawings at rest, shifted and half covered, with a press that none of them shows.

    So every way through the tracker is taken, and everything after it that a reading needs: fits, gate, filter, trend,
    contact. What a model of its own compiles, it has when it is loaded.

    Args:
        say: is called, from another thread, when this takes long.
    """
    notice = threading.Timer(
        PATIENCE_S, say, ["loading the dot tracker: half a minute where it must be compiled, once on this computer"]
    )
    notice.daemon = True
    notice.start()
    try:
        model = LiveModel("warm_up", "dots", SHAPE, _Press(), rest_n=0.0)
        pipeline = EndcapPipeline(EndcapConfig("warm_up", "drawing"), model, zero_frames=1)
        for number, picture in enumerate(_pictures()):
            pipeline.update(Frame(number / RATE_HZ, number, "drawing", image=picture))
        pipeline.close()
    finally:
        notice.cancel()


class _Press:
    """Answers the same press for every field."""

    def estimate(self, field: ShearField) -> Wrench:
        """Wrench about the sphere's centre, for whatever field."""
        return Wrench(field.time_s, np.array(PRESS_N), np.zeros(3), "sphere", np.eye(6))


def _pictures() -> list[np.ndarray]:
    """The first is the reference. Each is another: the same one again counts as a camera that hangs."""
    rest, _ = draw_dots(Drawing(specks=0, digit=""))
    covered = rest.copy()
    covered[:, : rest.shape[1] // 2] = 0
    lighter = np.clip(rest.astype(np.int16) + 1, 0, 255).astype(np.uint8)
    shifted = np.ascontiguousarray(np.roll(rest, JUMP_PX, axis=1))
    return [rest, lighter, rest, covered, shifted, lighter]
