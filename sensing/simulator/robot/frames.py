"""Pictures of the robot scene over time: those of its six cameras, rendered once and cached.

    film = load_film(Path.home() / ".cache/endcap")             # of D=130 T=8; or RobotDesign(EndcapParams(180, 10))
    film.jpeg(endcap, tick), film.truth(endcap, tick)           # tick: 1/30 s, the scene repeats after film.ticks

Every picture has noise of its own or that of one of three variants, so that no two consecutive ones are equal. Forces
in N, torques in N m on the endcap, endcap frame.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.identity import RELEASED_SILICONE, identity
from cad.lens import other_module
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from cad.whole_file import put_file
from sensing.simulator.robot.scene import ENDCAPS, FILE, PARAMS, RobotScene, load_scene
from sensing.simulator.robot.statics import WEIGHT_N

RATE_HZ = 30.0  # frame rate of the cameras; a tick is one frame
REST, RAMP, HOLD, GAP = 75, 30, 60, 30  # ticks in the air, while lowered, standing, between stands
VARIANTS = 3  # number of noise patterns of pictures that are shown again
Key = tuple[int, int, int, int]  # endcap, stand (-1 at rest), ramp step, variant


@dataclass(frozen=True)
class RobotDesign:
    """Design of a robot with six equal endcaps.

    Attributes:
        params: the design.
        silicone: row of cad/materials.csv.
    """

    params: EndcapParams = PARAMS
    silicone: str = DEFAULT_SILICONE

    @property
    def released(self) -> bool:
        """Whether the states that ship are those of this design; other sizes take them from the library."""
        cast_of = identity(self.params, self.silicone).aspects["silicone"]
        return self.params == PARAMS and cast_of == RELEASED_SILICONE  # its row may have been measured since

    @property
    def label(self) -> str:
        """Part of the cache file's name: of design, silicone and, where it is another, camera module."""
        seen = f"{self.silicone} {other_module()}".rstrip()
        return f"{self.params.label}_{hashlib.sha256(seen.encode()).hexdigest()[:6]}"

    def scene(self) -> tuple[RobotScene, float]:
        """(states of the scene, weight of the robot in N)."""
        if self.released:
            return load_scene(), WEIGHT_N
        from sensing.simulator.similarity.stands import robot_of

        return robot_of(self.params, self.silicone)


@dataclass(frozen=True)
class Moment:
    """Moment of the scene.

    Attributes:
        stand: 0, 1, 2 for one, two, three endcaps on the ground; -1 in the air.
        step: step of the ramp, 0..RAMP.
    """

    stand: int
    step: int


def timeline() -> tuple[Moment, ...]:
    """The moments of one round, one for each tick."""
    moments = [Moment(-1, 0)] * REST
    for stand in range(3):
        down = [Moment(stand, step) for step in range(1, RAMP + 1)]
        moments += down + [Moment(stand, RAMP)] * HOLD + down[::-1] + [Moment(-1, 0)] * GAP
    return tuple(moments)


@dataclass(frozen=True)
class Film:
    """All pictures of the scene.

    Attributes:
        scene: its states.
        pictures: JPEG bytes by key.
        moments: moments of one round.
        weight_n: weight of the robot, N.
    """

    scene: RobotScene
    pictures: dict[Key, bytes]
    moments: tuple[Moment, ...]
    weight_n: float = WEIGHT_N

    @property
    def ticks(self) -> int:
        """Number of ticks in one round."""
        return len(self.moments)

    def jpeg(self, endcap: int, tick: int) -> bytes:
        """The picture of an endcap's camera."""
        moment = self.moments[tick % self.ticks]
        return self.pictures[_key(self.scene, endcap, moment, tick)]

    def touching(self, tick: int) -> tuple[bool, ...]:
        """Whether each endcap carries load."""
        moment = self.moments[tick % self.ticks]
        return tuple(moment.stand >= 0 and bool(self.scene.touching[moment.stand, endcap]) for endcap in range(ENDCAPS))

    def truth(self, endcap: int, tick: int) -> NDArray[np.float64]:
        """(6,) wrench on an endcap, N and N m."""
        moment = self.moments[tick % self.ticks]
        if moment.stand < 0 or not self.scene.touching[moment.stand, endcap]:
            return np.zeros(6)
        return self.scene.state(moment.stand, endcap, moment.step / RAMP)[1]


def load_film(
    folder: Path | None = None, progress: Callable[[int, int], None] | None = None, robot: RobotDesign | None = None
) -> Film:
    """The film, read from ``folder`` if an earlier call wrote it, else rendered (some seconds) and written.

    Args:
        folder: folder of the cache; None keeps nothing.
        progress: called with (pictures made, pictures in all).
        robot: design of the robot; None for D=130 T=8.

    Raises:
        ParameterError: a design outside the library of states.
        FileError: the states of the scene are missing.
    """
    robot = robot or RobotDesign()
    (scene, weight_n), moments = robot.scene(), timeline()
    keys = sorted(
        {_key(scene, endcap, moment, tick) for tick, moment in enumerate(moments) for endcap in range(ENDCAPS)}
    )
    kept = None if folder is None else folder / f"robot_scene_{robot.label}_{_digest(robot)}.npz"
    pictures = None if kept is None else _read(kept, keys)
    if pictures is None:
        pictures = _render(scene, robot.params, keys, progress or (lambda done, total: None))
        if kept is not None:
            _keep(kept, pictures, robot)
    return Film(scene, pictures, moments, weight_n)


def _key(scene: RobotScene, endcap: int, moment: Moment, tick: int) -> Key:
    if moment.stand < 0 or not scene.touching[moment.stand, endcap]:
        return endcap, -1, 0, tick % VARIANTS
    return endcap, moment.stand, moment.step, tick % VARIANTS if moment.step == RAMP else 0


def _render(
    scene: RobotScene, params: EndcapParams, keys: list[Key], progress: Callable[[int, int], None]
) -> dict[Key, bytes]:
    from sensing.simulator.render.dome import DomeRenderer  # takes half a second, which cached pictures do not need
    from sensing.simulator.render.settings import Paint, RenderSettings

    pictures: dict[Key, bytes] = {}
    for endcap in range(ENDCAPS):
        settings = RenderSettings(seed=endcap, paint=Paint(digit=str(endcap))).at_level("draft")
        renderer = DomeRenderer(params, None, settings)
        for number, key in enumerate(k for k in keys if k[0] == endcap):
            _, stand, step, _ = key
            field = None if stand < 0 else scene.state(stand, endcap, step / RAMP)[0]
            azimuth = 0.0 if stand < 0 else float(scene.azimuth_deg[stand, endcap])
            pictures[key] = renderer.render(field, azimuth_deg=azimuth, frame=number).jpeg
            progress(len(pictures), len(keys))
    return pictures


def _digest(robot: RobotDesign) -> str:
    """Digest of everything on which the pictures depend."""
    found = hashlib.sha256(FILE.read_bytes())
    library = FILE.parents[1] / "similarity"
    for path in sorted([*FILE.parents[1].glob("render/*.py"), *library.glob("*.py"), Path(__file__)]):
        found.update(path.read_bytes())
    found.update(identity(robot.params, robot.silicone).digest.encode())
    return found.hexdigest()[:16]


def _read(path: Path, keys: list[Key]) -> dict[Key, bytes] | None:
    """Pictures of a file; None if it is missing or incomplete."""
    damaged = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)
    with contextlib.suppress(*damaged), np.load(path, allow_pickle=False) as data:
        ends, joined = data["end"].tolist(), data["jpeg"].tobytes()
        if len(ends) == len(keys):
            return {key: joined[a:b] for key, a, b in zip(keys, [0, *ends[:-1]], ends, strict=True)}
    return None


def _keep(path: Path, pictures: dict[Key, bytes], robot: RobotDesign) -> None:
    """Write the pictures into the cache; if that fails, the next call renders them again."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        for old in path.parent.glob(f"robot_scene_{robot.label}_*.npz"):  # of an earlier version of the renderer
            old.unlink()
        ordered = [pictures[key] for key in sorted(pictures)]
        ends = np.cumsum([len(p) for p in ordered])
        np.savez(buffer := io.BytesIO(), jpeg=np.frombuffer(b"".join(ordered), np.uint8), end=ends)
        put_file(path, buffer.getvalue())
