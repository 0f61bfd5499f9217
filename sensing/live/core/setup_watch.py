"""What the guided first run looks at while it asks: the forces of each endcap, or why one gives none that count.

watch = SetupWatch()                              # an output of the engine
watch.forces_n["camera_0"], watch.without_force(endcaps)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cad.errors import ParameterError
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.measurement import MOVED
from sensing.live.core.reading import EndcapReading

SURE = 15  # readings in a row that say that camera or lens have moved; a plug that is put in again shakes it for longer


class SetupWatch:
    """Output that keeps the forces of each endcap, N, but for those of a camera that has moved since its reference.

    Attributes:
        forces_n: (3,) force of every reading that counts, by endcap.
    """

    def __init__(self) -> None:
        self.forces_n: dict[str, list[np.ndarray]] = {}
        self._moved: dict[str, int] = {}  # readings in a row
        self._reason: dict[str, str] = {}

    def put(self, reading: EndcapReading) -> None:
        """Keep one, if its numbers count."""
        if not reading.valid:
            return
        if MOVED in reading.wrench.flags:  # reads as newtons: neither rest nor touch
            self._moved[reading.endcap] = self._moved.get(reading.endcap, 0) + 1
            self._reason[reading.endcap] = reading.reason
            return
        self._moved[reading.endcap] = 0
        self.forces_n.setdefault(reading.endcap, []).append(np.array(reading.wrench.force_n))

    def largest_n(self, endcap: str, since: int = 0) -> float:
        """Largest force norm of an endcap after so many readings; 0 before any."""
        forces = self.forces_n.get(endcap, [])[since:]
        return max((float(np.linalg.norm(f)) for f in forces), default=0.0)

    def require_unmoved(self, endcaps: Sequence[LiveEndcap]) -> None:
        """Refuse to go on with a camera that has moved since its reference.

        Raises:
            ParameterError: names the camera.
        """
        for endcap in endcaps:
            if self._moved.get(endcap.name, 0) >= SURE:
                why = f"{endcap.pipeline.endcap.source}: {self._reason[endcap.name]}"
                raise ParameterError(start_again(why), name="source")

    def without_force(self, endcaps: Sequence[LiveEndcap]) -> str:
        """Cameras that give no force that counts now, each with the reason, one line; empty where all do."""
        return "; ".join(
            f"{endcap.pipeline.endcap.source}: {endcap.machine.condition.state}: {endcap.machine.condition.reason}"
            for endcap in endcaps
            if not endcap.health.valid  # which looks at the clock first
        )


def start_again(why: str) -> str:
    """The reason with what to do."""
    return f"{why}; start again with all cameras plugged in and all endcaps free"
