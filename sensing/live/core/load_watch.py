"""Detects a reference that was taken under load: the released endcap then appears to be pulled.

    watch = LoadWatch(model.estimator)
    watch.update(field, estimate, touching)         # now and then; watch.reason says so

Nothing pulls at a dome, but weights answer such a field, too: after a reference under 1 to 12 N with 1 to 10 N in any
direction, most of them in range. The same field reversed is the press under which the reference was taken: it is in
range, its answer is that press to some percent, and in four of five cases larger than that of the field
(tests/sensing/live). Of true presses of a plane the reversed field is answered by at most 1.11 times the force. Of a
ball of 15 mm by up to 1.64 times from 25 N on, but then out of range. Equal presses from two or three sides, as of a
hand that carries the endcap, look alike in 1 of 160 cases, so nothing of this stays for good. N.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensing.live.core.model import WrenchEstimator
from sensing.records import ShearField, Wrench
from sensing.wrench.model import WrenchModel
from sensing.wrench.stiffness import load_scale_of

FLAG = "zeroed_under_load"
REVERSED = 1.2  # force of the reversed field over that of the field; over 1.11 of a press
LEAST_N = 1.0  # E: of the reversed field, at D=130 T=8; under it noise and sags that stay in the reading look alike


class LoadWatch:
    """Of one reference.

    Args:
        estimator: reads the fields; only weights of this project are asked.
        gain: from its force to the endcap's.
        reason: to begin with, of a watch before this one.

    Attributes:
        reason: says so, and what to do; empty where nothing shows it. A touch hides it, so it stays until an untouched
            frame shows none.
    """

    def __init__(self, estimator: WrenchEstimator, gain: float = 1.0, reason: str = "") -> None:
        self._estimator = estimator if isinstance(estimator, WrenchModel) else None
        self._gain, self.reason = gain, reason
        self._least_n = LEAST_N * gain * load_scale_of(estimator)

    def update(self, field: ShearField, estimate: Wrench, touching: bool) -> None:
        """One frame.

        Args:
            field: of the frame.
            estimate: the wrench that it stands for.
            touching: whether the endcap reads a touch.
        """
        if self._estimator is None:
            return
        pressed = self._estimator.estimate(replace(field, channels=-field.channels))
        pressed_n = self._gain * float(np.linalg.norm(pressed.force_n))
        more = pressed_n > self._least_n and pressed_n > REVERSED * float(np.linalg.norm(estimate.force_n))
        if more and not pressed.flags:
            self.reason = (
                f"the dots have moved as where a press of {pressed_n:.1f} N ends: was the reference taken under load? "
                "zero again when untouched"
            )
        elif not touching:
            self.reason = ""
