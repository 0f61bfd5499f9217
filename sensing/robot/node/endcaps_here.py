"""The endcaps whose cameras are connected to this computer: their readings as samples, and their states."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cad.errors import ParameterError, printable
from cad.messages import LOG
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcaps_file import load_config
from sensing.live.core.engine import Engine
from sensing.live.core.reading import EndcapReading
from sensing.live.core.warm_up import warm_up
from sensing.live.open_endcaps import open_endcaps
from sensing.robot.readings import foot_sample
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.samples import FootSample

ROOM = 256  # number of readings that may wait
FIRST_S = 30.0  # s, time for the first wrench of every endcap, in which references are taken
NEWS_S = 1.0  # s, interval of the lines about states
CLOSE_S = 1.0  # s, time in which the live loop has to stop


class EndcapsHere:
    """Readings of this computer's endcaps.

    Args:
        path: path of endcaps.toml.
        robot: robot of the endcaps.

    Raises:
        ParameterError: an endcap of the file that the robot does not have, or has in another size.
        EndcapError: a camera or file that cannot be opened.
    """

    def __init__(self, path: Path, robot: TensegrityRobot) -> None:
        config = load_config(path)
        _require_endcaps_of(robot, config, path)
        self._readings: deque[EndcapReading] = deque(maxlen=ROOM)
        warm_up(LOG.info)
        self._engine = Engine(open_endcaps(config), [self])
        self._missing = {endcap.name for endcap in config.endcaps}
        self._states: dict[str, str] = {}
        self._failures_said = 0
        self._news_s = self._patient_s = -np.inf

    def start(self) -> None:
        """Open the cameras."""
        self._patient_s = time.monotonic() + FIRST_S
        self._engine.start()

    def close(self) -> None:
        """Release the endcaps."""
        self._engine.close(CLOSE_S)

    def put(self, reading: EndcapReading) -> None:
        """Take a reading; if nobody reads them in time, the oldest are dropped."""
        if self._missing and np.isfinite(reading.wrench.force_n).all():
            self._missing.discard(reading.endcap)
        self._readings.append(reading)

    def samples(self) -> Iterator[FootSample]:
        """The readings that wait, as samples."""
        while self._readings:
            yield foot_sample(self._readings.popleft())

    def ready(self) -> bool:
        """Whether every endcap has given a wrench: without any contact the estimate would drift from its start."""
        now = time.monotonic()
        if now >= self._news_s:
            self._news_s = now + NEWS_S
            self._say_states()
        if self._missing and now >= self._patient_s:
            LOG.warning(f"no wrench of {', '.join(sorted(self._missing))} for {FIRST_S:g} s: it begins without")
            self._missing.clear()
        return not self._missing

    def _say_states(self) -> None:
        """Print a line for every endcap whose state has changed, and for an error that ended the readings."""
        for failure in self._engine.failures[self._failures_said :]:
            LOG.error(printable(f"no more readings: {failure}"))
            self._failures_said += 1
        for health in self._engine.health():
            if self._states.get(health.endcap) != health.status:
                self._states[health.endcap] = health.status
                text = f"{health.endcap}: {health.status}"
                LOG.warning(printable(f"{text}: {health.message}" if health.message else text))


def _require_endcaps_of(robot: TensegrityRobot, config: LiveConfig, path: Path) -> None:
    """Refuse endcaps that the robot does not have: normals and contact points would be wrong without a sign of it."""
    known = {endcap.name: endcap for endcap in robot.endcaps}
    unknown = sorted({endcap.name for endcap in config.endcaps} - set(known))
    if unknown:
        raise ParameterError(
            f"{path}: {', '.join(unknown)}: the robot's description has {', '.join(known)}: use the same names in both",
            name="endcaps",
        )
    for endcap in config.endcaps:
        wanted = known[endcap.name]
        here, there = (endcap.diameter_mm, endcap.wall_mm), (wanted.diameter_mm, wanted.wall_mm)
        if here != there:
            raise ParameterError(
                f"{path}: {endcap.name} has diameter_mm = {here[0]:g} and wall_mm = {here[1]:g}, in the robot's "
                f"description {there[0]:g} and {there[1]:g}: write the same in both",
                name="endcaps",
            )
