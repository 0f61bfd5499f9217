"""A run of the simulated robot through pictures: every frame of every endcap rendered, tracked and estimated.

    stage = Stage(folder)                                        # shell, states and weights; solves what is missing
    arrivals = sensor_stream(walk, robot, seed=walk.seed)
    readings = read_walk(stage, walk, robot, frame_times(arrivals), "flat_101")      # six endcaps, kept in the folder
    arrivals = with_pictures(arrivals, readings)

Forces in N, torques in N m on the endcap at its origin, times in s of the run.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.materials import silicone
from cad.params import EndcapParams
from cad.whole_file import put_file
from sensing.calibration.dots import find_blobs
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.decode import decode_bgr
from sensing.live.core.config import EndcapConfig
from sensing.live.core.model import LiveModel, known_weights, load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.records import Frame, Image
from sensing.robot.readings import foot_sample
from sensing.simulator.levels import Simulator
from sensing.simulator.reduced.library import Library
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.walk.contacts import Contacts, contacts_of
from sensing.simulator.walk.pictures import WalkSensor
from sensing.simulator.walk.pressed import (
    STATES,
    TILTS_DEG,
    PressedStates,
    Presses,
    fit_presses,
    load_presses,
    save_presses,
    solve_tilt,
    states_of,
)
from sensing.simulator.walk.stream import Arrival, true_wrenches
from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import MountedEndcap, TensegrityRobot
from sensing.tensegrity.samples import FootSample
from sensing.tracking.zero import take_zero

Array = NDArray[np.float64]
Say = Callable[[str], None]
PARAMS = EndcapParams(130.0, 8.0)
FIRST_SENSOR = 201  # no training, tuning or test has seen these
TOLERANCE = 1e-2  # of level 2: markers within 0.01 % of level 1 (docs/simulator.md), the fit is a hundred times worse


class Stage:
    """What all runs share: the shell, its states and the weights that ship.

    Args:
        folder: where solved presses are kept. say: is called with what goes on.
    """

    def __init__(self, folder: Path, say: Say = lambda text: None) -> None:
        self.folder, self.say = folder, say
        self.simulator = Simulator(ShellGeometry.from_params(PARAMS), silicone().neo_hooke(), tolerance=TOLERANCE)

    def presses(self, tilt_deg: float, seed: int = 0, states: int = 0) -> Presses:
        """Solved presses at a tilt, kept.

        Args:
            tilt_deg: of the plane. seed: of the path. states: how many; 0 for what a fit takes.
        """
        path = self.folder / f"presses_{tilt_deg:g}_{seed}.npz"
        if not path.exists():

            def progress(done: int) -> None:
                self.say(f"{tilt_deg:g} degrees: {done} states solved")

            self.folder.mkdir(parents=True, exist_ok=True)
            save_presses(solve_tilt(self.simulator, tilt_deg, states or STATES, seed, progress=progress), path)
            self.simulator.forget()
        return load_presses(path)

    @cached_property
    def library(self) -> Library:
        """Of all presses."""
        return fit_presses(self.simulator, [self.presses(tilt) for tilt in TILTS_DEG])

    @cached_property
    def model(self) -> LiveModel:
        """The weights that ship."""
        return load_model("default", PARAMS)

    @cached_property
    def digest(self) -> str:
        """Of what decides a reading: states and weights."""
        weights = known_weights("default", PARAMS)
        found = hashlib.sha256(weights.read_bytes() if weights else b"")
        for name in ("even", "odd", "modes"):
            found.update(np.round(getattr(self.library, name), 9).tobytes())
        return found.hexdigest()[:10]


@dataclass(frozen=True)
class Readings:
    """What pictures of one endcap gave, n frames.

    Attributes:
        time_s: (n,). wrench: (n, 6) filtered; NaN where it does not count. covariance: (n, 6, 6).
        touching: (n,) 1, 0, or -1 where it is not known. flags: (n,) words, with spaces between.
        shown: (n, 6) wrench of the state in the picture. ran: (n, 6) wrench of the run.
        load_n, tilt_deg: (n,) of the run's contact. clamped: (n,) whether the picture shows another state than the
            run's, the nearest that was solved.
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


def read_walk(
    stage: Stage, walk: Walk, robot: TensegrityRobot, times: dict[str, Array], name: str
) -> dict[str, Readings]:
    """Readings of every endcap; those of an earlier call are read from the stage's folder.

    Args:
        stage: shell, states, weights. walk: what happened. robot: whose. times: of each endcap's frames. name: of the
            run, part of the files' names.
    """
    found = {}
    for number, endcap in enumerate(robot.endcaps):
        path = stage.folder / f"{name}_{endcap.name}_{stage.digest}.npz"
        if not path.exists():
            put_file(path, _read_endcap(stage, walk, robot, endcap, times[endcap.name], FIRST_SENSOR + number))
        with np.load(path, allow_pickle=False) as data:
            found[endcap.name] = Readings(**{entry.name: data[entry.name] for entry in fields(Readings)})
    return found


def _read_endcap(
    stage: Stage, walk: Walk, robot: TensegrityRobot, endcap: MountedEndcap, times: Array, number: int
) -> bytes:
    """Frames of one endcap through a pipeline of its own, as the bytes of a file."""
    rows = np.round(times / float(walk.time_s[1] - walk.time_s[0])).astype(int)
    contacts = contacts_of(walk, robot, endcap, rows)
    states = states_of(stage.library, contacts)
    sensor = WalkSensor(stage.simulator, stage.library, number)
    pipeline = _pipeline(stage, sensor, endcap.name)
    readings = []
    for frame in sensor.frames(states, contacts):
        reading = pipeline.update(frame)
        assert reading is not None  # times only rise
        readings.append(reading)
        if len(readings) % 30 == 0:
            stage.say(f"endcap {endcap.name}: {len(readings)} of {len(rows)} frames")
    pipeline.close()
    np.savez_compressed(
        buffer := io.BytesIO(), **vars(_gathered(readings, states, contacts, walk, robot, endcap, rows))
    )
    return buffer.getvalue()


def _pipeline(stage: Stage, sensor: WalkSensor, name: str) -> EndcapPipeline:
    """Zeroed on ten pictures of the untouched dome, its camera calibrated on them, as ``endcap setup`` does."""
    zero = take_zero(sensor.rest(), sensor.name)
    blobs, _ = find_blobs(zero.image)
    found = calibrate_from_dots(blobs, PARAMS, (zero.image.shape[1], zero.image.shape[0]))
    camera = stage.folder / f"camera_{name}.json"
    config = EndcapConfig(f"endcap_{name}", "simulated")
    found.mounted.save(camera, config.identity)
    return EndcapPipeline(replace(config, camera=camera), stage.model, zero)


def _gathered(
    readings: Sequence[EndcapReading], states: PressedStates, contacts: Contacts, walk: Walk, robot: TensegrityRobot,
    endcap: MountedEndcap, rows: NDArray[np.int64],
) -> Readings:  # fmt: skip
    foot_samples = [foot_sample(reading) for reading in readings]
    ran, _ = true_wrenches(walk, robot, endcap, rows)
    return Readings(
        contacts.time_s, np.array([np.concatenate([foot.force_n, foot.torque_nm]) for foot in foot_samples]),
        np.array([foot.covariance for foot in foot_samples]),
        np.array([-1 if foot.touching is None else int(foot.touching) for foot in foot_samples]),
        np.array([" ".join(sorted(foot.flags)) for foot in foot_samples]),
        states.wrench, ran, np.linalg.norm(ran[:, :3], axis=1), contacts.tilt_deg, states.clamped,
    )  # fmt: skip


def alone(stage: Stage, fields_mm: Array, azimuth_deg: float) -> Array:
    """(n, 6) what the live pipeline estimates of single pictures, each for itself.

    Args:
        stage: shell, weights. fields_mm: (n, k, 3) displacement of the simulator's inner surface. azimuth_deg: of all.
    """
    sensor = WalkSensor(stage.simulator, stage.library, FIRST_SENSOR)
    pipeline, found = _pipeline(stage, sensor, "check"), []
    for number, field in enumerate(fields_mm):
        picture = sensor.picture(field, number, azimuth_deg)
        reading = pipeline.update(Frame(float(number), number, sensor.name, jpeg=picture))
        assert reading is not None  # times only rise
        found.append(np.concatenate([reading.estimate.force_n, reading.estimate.torque_nm]))
    pipeline.close()
    return np.array(found)


def frame_at(stage: Stage, walk: Walk, robot: TensegrityRobot, number: int, time_s: float) -> Image:
    """What the camera of an endcap sees at a moment of a run.

    Args:
        stage: shell and states. walk: what happened. robot: whose. number: of the endcap. time_s: when.
    """
    row = np.array([round(time_s / float(walk.time_s[1] - walk.time_s[0]))])
    contacts = contacts_of(walk, robot, robot.endcaps[number], row)
    sensor = WalkSensor(stage.simulator, stage.library, FIRST_SENSOR + number)
    return decode_bgr(next(sensor.frames(states_of(stage.library, contacts), contacts)))


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
