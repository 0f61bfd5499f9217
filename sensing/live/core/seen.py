"""A frame whose picture was looked at before: its dots were recorded, the picture was not, or only a lighter one.

Everything behind the dots (field, wrench, gate, filter, contact) needs no more than this and comes out to the bit. What
needs the picture itself cannot be had again: another field method, the drift, the camera doctor.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from sensing.live.core.gate import Verdict
from sensing.records import DotTracks, Frame
from sensing.tracking.model_input import ModelInput


class Pictures(StrEnum):
    """Which pictures a recording holds, beside references, which are always whole."""

    FULL = "full"  # as they came
    HALF = "half"  # half as wide and high, to be looked at; numbers come from the dots
    NONE = "none"  # dots alone


@dataclass(frozen=True)
class SeenFrame(Frame):
    """A recorded frame with the dots seen in it; ``image`` and ``jpeg`` may both be missing, ``size`` is the picture's.

    Attributes:
        rows: (N, 4) x, y (full-size pixels), quality, and 1 for lost, of the dots of the reference.
        likeness: of the picture with that of the reference.
        refused: why there are no dots; None where there are.
    """

    rows: NDArray[np.float64] | None = None
    likeness: float = float("nan")
    refused: Verdict | None = None

    def __post_init__(self) -> None:
        """A picture is not needed."""

    def tracks(self, method: ModelInput) -> DotTracks | None:
        """The dots, seen against a reference; None where they are another's."""
        tracker = method.tracker
        if self.rows is None or self.rows.shape != (len(tracker.reference_px), 4):
            return None
        return DotTracks(
            time_s=self.time_s, ids=np.arange(len(self.rows)), reference_px=tracker.reference_px,
            position_px=self.rows[:, :2].copy(), quality=self.rows[:, 2].copy(), lost=self.rows[:, 3] > 0,
            size=tracker.size,
        )  # fmt: skip
