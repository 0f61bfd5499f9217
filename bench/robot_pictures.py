"""A run of the simulated robot through pictures: every frame of every endcap rendered, tracked and estimated.

    stage = Stage(folder)                                        # shell and weights; keeps the solved states
    arrivals = sensor_stream(walk, robot, SensorSet(wrench_hz=10.0), walk.seed)
    readings = stage.read(walk, robot, frame_times(arrivals), "flat_101")      # six endcaps
    arrivals = with_pictures(arrivals, readings)

Forces in N, torques in N m on the endcap at its origin, times in s of the run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.materials import silicone
from cad.params import EndcapParams
from cad.whole_file import make_folder
from sensing.calibration.dots import find_blobs
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.decode import decode_bgr
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import LiveModel, load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.records import Image
from sensing.robot.readings import foot_sample
from sensing.simulator.levels import Simulator
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.walk.contacts import Contacts, contacts_of
from sensing.simulator.walk.pictures import WalkSensor
from sensing.simulator.walk.pressed import PressedStates, load_states, save_states, solve_contacts
from sensing.simulator.walk.stream import Arrival, true_wrenches
from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import MountedEndcap, TensegrityRobot
from sensing.tensegrity.samples import FootSample
from sensing.tracking.zero import take_zero

Array = NDArray[np.float64]
Say = Callable[[str], None]
PARAMS = EndcapParams(130.0, 8.0)
FIRST_SENSOR = 201  # no training, tuning or test has seen these
TOLERANCE = 1e-2  # of level 2: markers within 0.01 % of level 1 (docs/simulator.md)


def shell() -> Simulator:
    """The shell of the endcaps."""
    return Simulator(ShellGeometry.from_params(PARAMS), silicone().neo_hooke(), tolerance=TOLERANCE)


def solve_file(contacts: Contacts, path: Path) -> Path:
    """Solve one endcap's contacts into a file; what a worker does."""
    save_states(solve_contacts(shell(), contacts), path)
    return path


class Stage:
    """What all runs share: the shell, the weights that ship, and the folder of solved states.

    Args:
        folder: where solved states are kept. say: is called with what goes on. workers: processes that solve.
    """

    def __init__(self, folder: Path, say: Say = lambda text: None, workers: int = 1) -> None:
        self.folder, self.say, self.workers = folder, say, workers
        self.simulator = shell()

    @cached_property
    def model(self) -> LiveModel:
        """The weights that ship."""
        return load_model("default", PARAMS)

    def read(self, walk: Walk, robot: TensegrityRobot, times: dict[str, Array], name: str) -> dict[str, Readings]:
        """Readings of every endcap.

        Args:
            walk: what happened. robot: whose. times: of each endcap's frames. name: of the run, part of files' names.
        """
        rows = {end.name: np.round(times[end.name] / walk_step(walk)).astype(int) for end in robot.endcaps}
        contacts = {end.name: contacts_of(walk, robot, end, rows[end.name]) for end in robot.endcaps}
        states = self.states(contacts, name)
        found = {}
        for number, endcap in enumerate(robot.endcaps):
            self.say(f"endcap {endcap.name}: {len(times[endcap.name])} frames")
            sensor = WalkSensor(self.simulator, FIRST_SENSOR + number)
            pipeline = self.pipeline(sensor, endcap.name)
            frames = sensor.frames(states[endcap.name], contacts[endcap.name])
            readings = [reading for frame in frames if (reading := pipeline.update(frame)) is not None]
            pipeline.close()
            ran, _ = true_wrenches(walk, robot, endcap, rows[endcap.name])
            found[endcap.name] = _gathered(readings, states[endcap.name], contacts[endcap.name], ran)
        return found

    def states(self, contacts: dict[str, Contacts], name: str) -> dict[str, PressedStates]:
        """Solved states of all endcaps; those of an earlier call are read from the folder.

        Args:
            contacts: of every endcap. name: of the run.

        Raises:
            ParameterError: kept states of another run.
        """
        make_folder(self.folder)
        paths = {endcap: self.folder / f"{name}_{endcap}.npz" for endcap in contacts}
        missing = [endcap for endcap, path in paths.items() if not path.exists()]
        with ProcessPoolExecutor(max(1, min(self.workers, len(missing)))) as pool:
            jobs = [pool.submit(solve_file, contacts[endcap], paths[endcap]) for endcap in missing]
            for done, job in enumerate(jobs, 1):
                self.say(f"{job.result().name}: solved, {done} of {len(jobs)} endcaps")
        found = {endcap: load_states(path) for endcap, path in paths.items()}
        for endcap, states in found.items():
            if len(states.wrench) != len(contacts[endcap].time_s):
                raise ParameterError(f"{paths[endcap]}: {len(states.wrench)} states of another run: remove it")
        return found

    def pipeline(self, sensor: WalkSensor, name: str) -> EndcapPipeline:
        """Zeroed on ten pictures of the untouched dome, its camera calibrated on them, as ``endcap setup`` does.

        Args:
            sensor: whose pictures. name: of the endcap.
        """
        zero = take_zero(sensor.rest(), sensor.name)
        blobs, _ = find_blobs(zero.image)
        found = calibrate_from_dots(blobs, PARAMS, (zero.image.shape[1], zero.image.shape[0]))
        camera = self.folder / f"camera_{name}.json"
        config = EndcapConfig(f"endcap_{name}", "simulated")
        found.mounted.save(camera, config.identity)
        return EndcapPipeline(replace(config, camera=camera), self.model, zero)

    def picture(self, walk: Walk, robot: TensegrityRobot, endcap: MountedEndcap, time_s: float) -> Image:
        """What the camera of an endcap sees at a moment of a run; the contact is solved for it.

        Args:
            walk: what happened. robot: whose. endcap: which. time_s: when.
        """
        contacts = contacts_of(walk, robot, endcap, np.array([round(time_s / walk_step(walk))]))
        sensor = WalkSensor(self.simulator, FIRST_SENSOR + robot.endcaps.index(endcap))
        return decode_bgr(next(sensor.frames(solve_contacts(self.simulator, contacts), contacts)))


def walk_step(walk: Walk) -> float:
    """Seconds between two samples of the truth."""
    return float(walk.time_s[1] - walk.time_s[0])


@dataclass(frozen=True)
class Readings:
    """What pictures of one endcap gave, n frames.

    Attributes:
        time_s: (n,). wrench: (n, 6) filtered; NaN where it does not count. covariance: (n, 6, 6).
        touching: (n,) 1, 0, or -1 where it is not known. flags: (n,) words, with spaces between.
        shown: (n, 6) wrench of the state in the picture. ran: (n, 6) wrench of the run.
        load_n, tilt_deg: (n,) of the run's contact. clamped: (n,) whether the picture shows a state of another contact
            near it, because the run's lies beyond what can be solved.
    """

    time_s: Array
    wrench: Array
    covariance: Array
    touching: NDArray[np.int64]
    flags: NDArray[np.str_]
    shown: Array
    ran: Array
    load_n: Array
    tilt_deg: Array
    clamped: NDArray[np.bool_]

    def sample(self, endcap: str, k: int) -> FootSample:
        """What the estimator takes of a frame."""
        touching = None if self.touching[k] < 0 else bool(self.touching[k])
        return FootSample(
            float(self.time_s[k]), endcap, self.wrench[k, :3], self.wrench[k, 3:], self.covariance[k], touching,
            frozenset(str(self.flags[k]).split()),
        )  # fmt: skip


def _gathered(readings: Sequence[EndcapReading], states: PressedStates, contacts: Contacts, ran: Array) -> Readings:
    samples = [foot_sample(reading) for reading in readings]
    return Readings(
        contacts.time_s, np.array([np.concatenate([foot.force_n, foot.torque_nm]) for foot in samples]),
        np.array([foot.covariance for foot in samples]),
        np.array([-1 if foot.touching is None else int(foot.touching) for foot in samples]),
        np.array([" ".join(sorted(foot.flags)) for foot in samples]),
        states.wrench, ran, np.linalg.norm(ran[:, :3], axis=1), contacts.tilt_deg, states.clamped,
    )  # fmt: skip


def frame_times(arrivals: Sequence[Arrival]) -> dict[str, Array]:
    """When each endcap takes its frames."""
    found: dict[str, list[float]] = {}
    for arrival in arrivals:
        if isinstance(arrival.sample, FootSample):
            found.setdefault(arrival.sample.endcap, []).append(arrival.sample.time_s)
    return {name: np.sort(np.array(times)) for name, times in found.items()}


def with_pictures(arrivals: Sequence[Arrival], readings: dict[str, Readings]) -> list[Arrival]:
    """The same arrivals with the readings of pictures in place of the noise model's.

    Args:
        arrivals: of a run. readings: of every endcap, at the times of its samples.
    """
    place = {(name, float(time)): k for name, part in readings.items() for k, time in enumerate(part.time_s)}
    return [
        replace(arrival, sample=readings[sample.endcap].sample(sample.endcap, place[sample.endcap, sample.time_s]))
        if isinstance(sample := arrival.sample, FootSample)
        else arrival
        for arrival in arrivals
    ]
