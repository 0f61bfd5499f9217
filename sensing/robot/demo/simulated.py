"""The simulated robot as a source: samples of its sensors in the order of arrival, at the run's pace.

    source = SimulatedRobot(load_robot(), Terrain.FLAT, seed=1, seconds=40.0)

A run is simulated once on a computer and kept in the user's cache folder.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from cad.errors import FileError, ParameterError
from cad.user_folders import cache_folder
from sensing.simulator.walk.simulate import simulate_walk
from sensing.simulator.walk.stream import sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.simulator.walk.truth import Walk, load_walk, save_walk
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.samples import Sample

LONGEST_S = 600.0  # longest run
SHORTEST_S = 3.0  # shortest run
MOST_SPEED = 1000.0  # largest factor on the pace of a run
TERRAINS = tuple(terrain.value for terrain in Terrain)  # names of the terrains


class SimulatedRobot:
    """A run of the simulated robot.

    Args:
        robot: robot that rolls.
        terrain: name of the terrain, one of :data:`TERRAINS`.
        seed: seed of all random numbers.
        seconds: duration of the run, s.
        speed: factor on its pace; 0 is as fast as possible.
        say: called with the simulated time, s, during the simulation.

    Raises:
        ParameterError: an unknown terrain, a negative seed, seconds outside 3..600, or a speed outside 0..1000.
    """

    def __init__(
        self,
        robot: TensegrityRobot,
        terrain: str = "flat",
        seed: int = 1,
        seconds: float = 40.0,
        speed: float = 1.0,
        say: Callable[[float], None] | None = None,
    ) -> None:
        if terrain not in TERRAINS:
            raise ParameterError(f"terrain={terrain!r}: choose {', '.join(TERRAINS)}", name="terrain", value=terrain)
        if seed < 0:
            raise ParameterError(
                f"seed={seed} is negative: a seed is a whole number from 0 on", name="seed", value=seed
            )
        if not SHORTEST_S <= seconds <= LONGEST_S:
            raise ParameterError(
                f"seconds={seconds:g} outside {SHORTEST_S:g}..{LONGEST_S:g} of a simulated run", name="seconds"
            )
        if not 0 <= speed <= MOST_SPEED:
            raise ParameterError(
                f"speed={speed:g} outside 0..{MOST_SPEED:g}: 1 is the run's own pace, 0 as fast as possible",
                name="speed",
            )
        self.robot, self._speed = robot, speed
        self._walk = _walk(robot, Terrain(terrain), seed, seconds, say)
        self._arrivals = sensor_stream(self._walk, robot, seed=seed)

    def arrivals(self) -> Iterator[tuple[float, Sample] | None]:
        """(time of arrival, sample), on the clock of the samples; None now and then while none is due."""
        begin_s = time.monotonic()
        for arrival in self._arrivals:
            while self._speed and (wait_s := begin_s + arrival.at_s / self._speed - time.monotonic()) > 0:
                time.sleep(min(wait_s, 0.1))
                yield None
            yield arrival.at_s, arrival.sample

    def truth(self, time_s: float) -> Array | None:
        """(B, 4, 4) m T_world_bar nearest to a time, in the simulator's world."""
        row = int(np.searchsorted(self._walk.time_s, time_s))
        return np.asarray(self._walk.T_world_bar[min(row, len(self._walk.time_s) - 1)])


def _walk(
    robot: TensegrityRobot, terrain: Terrain, seed: int, seconds: float, say: Callable[[float], None] | None
) -> Walk:
    import sensing.simulator.walk as package

    code = hashlib.sha256(repr(robot).encode())
    for path in sorted(Path(package.__path__[0]).iterdir()):
        if path.is_file():
            code.update(path.read_bytes())
    folder = cache_folder()
    path = folder / f"walk_{terrain.value}_{seed}_{seconds:g}s_{code.hexdigest()[:16]}.npz"
    if path.is_file():
        try:
            return load_walk(path)
        except FileError:
            path.unlink()  # a damaged file is simulated again
    walk = simulate_walk(robot, terrain, seed=seed, duration_s=seconds, progress=say)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        save_walk(walk, path)
    except (OSError, FileError):
        pass  # without a cache only time is lost
    return walk
