"""The simulated robot scene as six cameras that run freely: what ``python -m sensing.live`` shows without hardware.

The only package of ``live`` that may import the simulator; it takes pictures, poses and weight from it, and its frames
are frames like any others. Cameras are out of step with one another by a sixth of a frame, as unsynchronised ones
are. Times in s on the monotonic clock, poses in mm.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

from cad.errors import ParameterError
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, transient
from cad.params import EndcapParams
from cad.user_folders import cache_folder
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig, dots_of
from sensing.records import Frame

SIZE = (640, 480)
ENDCAPS = 6
RELEASED = EndcapParams(130.0, 8.0)  # of the robot that is shown by default
WORD = "scene:"
_BEGINS = threading.Lock()


def scene_film(design: EndcapParams = RELEASED, silicone: str = DEFAULT_SILICONE) -> Any:
    """The pictures; rendered at the first call on a machine, then read from the user's cache folder.

    Args:
        design: of the six endcaps.
        silicone: row of cad/materials.csv.

    Raises:
        ParameterError: a design that cannot be made, or an unknown silicone.
    """
    return _film(design, silicone)


@lru_cache(maxsize=2)
def _film(design: EndcapParams, silicone: str) -> Any:
    from sensing.simulator.robot.frames import RobotDesign, load_film  # loaded only when the scene is shown

    return load_film(cache_folder(), _progress, RobotDesign(design, silicone))


@lru_cache(maxsize=1)
def scene_start_s() -> float:
    """Start time of the scene, common to its cameras: that of the first picture which any of them takes.

    It begins at rest, for the references; what is compiled between opening a camera and reading it may take longer.
    """
    return time.monotonic()


def scene_config(
    model: str = "default",
    weights: Path | None = None,
    method: str | None = None,
    design: EndcapParams = RELEASED,
    silicone: str = DEFAULT_SILICONE,
) -> LiveConfig:
    """Six endcaps of the robot, as they are screwed on.

    Args:
        model, weights, method: of :class:`sensing.live.core.config.LiveConfig`.
        design: of the six endcaps.
        silicone: row of cad/materials.csv.
    """
    film = scene_film(design, silicone)
    endcaps = tuple(
        EndcapConfig(
            f"endcap_{number}", f"{WORD}{number}", diameter_mm=design.diameter_mm, wall_mm=design.wall_mm,
            silicone=silicone, T_robot_endcap=film.scene.T_robot_endcap[number], **dots_of(design),
        )
        for number in range(ENDCAPS)
    )  # fmt: skip
    return LiveConfig(endcaps, model, weights, method, film.weight_n)


class SceneSource:
    """One camera of the scene, for ever.

    Args:
        number: of the endcap, 0..5.
        rate_hz: frames a second; the scene's own pace stays.
        phase: by how much of a frame it is late; None for a sixth later than the camera before.
        design: of the six endcaps.
        silicone: row of cad/materials.csv.

    Raises:
        ParameterError: no such endcap, or a rate that is not 1..240.
    """

    def __init__(
        self,
        number: int,
        rate_hz: float = 30.0,
        phase: float | None = None,
        design: EndcapParams = RELEASED,
        silicone: str = DEFAULT_SILICONE,
    ) -> None:
        if not 0 <= number < ENDCAPS:
            raise ParameterError(f"{WORD}{number}: give {WORD}0 to {WORD}{ENDCAPS - 1}", name="source", value=number)
        if not 1 <= rate_hz <= 240:
            raise ParameterError(f"rate_hz={rate_hz:g} outside 1..240", name="rate_hz", value=rate_hz)
        self.number, self.name, self._rate_hz = number, f"{WORD}{number}", rate_hz
        self._film = scene_film(design, silicone)
        self._phase = number / ENDCAPS if phase is None else phase

    def __iter__(self) -> Iterator[Frame]:
        with _BEGINS:  # cameras have a thread each
            start_s = scene_start_s()
        count = int((time.monotonic() - start_s) * self._rate_hz - self._phase) + 1
        sequence = 0
        while True:
            due_s = start_s + (count + self._phase) / self._rate_hz
            time.sleep(max(0.0, due_s - time.monotonic()))
            yield Frame(due_s, sequence, self.name, jpeg=self.picture(count), size=SIZE)
            sequence += 1
            late = int((time.monotonic() - due_s) * self._rate_hz)  # a camera that is not read drops frames
            count += 1 + late

    def picture(self, count: int) -> bytes:
        """JPEG of a frame number."""
        return bytes(self._film.jpeg(self.number, self.tick(count)))

    def tick(self, count: int) -> int:
        """Tick of the scene that a frame number shows."""
        return round(count * 30.0 / self._rate_hz)


def scene_number(word: str) -> int | None:
    """N of ``scene:N``; None for another word."""
    rest = word.removeprefix(WORD)
    return int(rest) if word.startswith(WORD) and rest.isdecimal() and rest.isascii() and len(rest) < 4 else None


def _progress(done: int, total: int) -> None:
    if done == 1:
        LOG.info(f"rendering the simulated robot, once: {total} pictures")
    transient(f"{done}/{total} pictures", done=done == total)
