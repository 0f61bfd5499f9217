"""Loads the compiled code before the first frame comes; on a new computer it is compiled then, which takes a while."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cad.messages import announced
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.measurement import Measurement
from sensing.live.core.model import LiveModel
from sensing.live.core.reference import Reference
from sensing.records import Frame, ShearField, Wrench
from sensing.sources.drawn import Drawing, draw_dots
from sensing.tracking.model_input import model_input
from sensing.tracking.zero import single_zero

PATIENCE_S = 3.0  # loading takes 1 s; what takes longer is announced
JUMP_PX = 25  # a picture shifted by this makes the tracker search
RATE_HZ = 30.0
PRESS_N = (1.0, 0.5, -10.0)  # beside the tip: contact and its place are looked for
SHAPE = (16, 16)


def warm_up(say: Callable[[str], object]) -> None:
    """Measure drawings at rest, shifted and half covered, with a press that none of them shows.

    So every way through the tracker is taken, and everything after it that a reading needs: fits, gate, filter, trend,
    contact. What a model of its own compiles, it has when it is loaded.

    Args:
        say: is called, from another thread, when this takes long.
    """
    text = "loading the dot tracker: half a minute where it must be compiled, once on this computer"
    with announced(text, PATIENCE_S, say):
        endcap, model = EndcapConfig("warm_up", "drawing"), LiveModel("warm_up", "dots", SHAPE, _Press(), rest_n=0.0)
        frames = [Frame(k / RATE_HZ, k, "drawing", image=picture) for k, picture in enumerate(_pictures())]
        reference = Reference(single_zero(frames[0]), model_input(frames[0], SHAPE, endcap.params))
        measurement = Measurement(endcap, model, reference, check=None, number=0, epoch=0)
        for frame in frames:
            measurement.read(frame, frame.time_s)


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
