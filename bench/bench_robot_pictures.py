"""The robot's estimate from pictures: every frame of six endcaps rendered, tracked and estimated by the live pipeline.

    python bench/bench_robot_pictures.py run             # robot_pictures.csv, robot_pictures_readings.csv
    python bench/bench_robot_pictures.py picture         # six cameras at one moment: robot_pictures.jpg

The same held-out run is judged twice: with the wrenches of its pictures, and with those of the noise model of
``bench_robot.py`` at the same rate. Every contact is solved by itself: an hour of one core for 20 s at 10 Hz, kept in
``exports/bench/robot_pictures``; the pictures take two minutes more. The robot has half the mass of the one that ships,
and half its cables' stiffness: its loads lie within the sensor's range, those of 12 kg mostly do not.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
from numpy.typing import NDArray
from one_line import in_one_line
from robot_pictures import Readings, Stage, frame_times, walk_step, with_pictures
from robot_runs import held_out, judge_arrivals
from table_file import write_table

from cad.whole_file import replace_file
from sensing.live.core.gate import UNCONFIRMED
from sensing.robot.settings import DEFAULTS
from sensing.simulator.walk.stream import Arrival, SensorSet, sensor_stream, true_wrenches
from sensing.simulator.walk.terrain import Terrain
from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample

Array = NDArray[np.float64]
HERE = Path(__file__).parent
FOLDER = HERE.parent / "exports" / "bench" / "robot_pictures"
RANGE_N, RANGE_DEG, LEAST_N = 75.0, 78.0, 1.0  # of the weights' training; load from which a reading is one of a contact
INSIDE_95 = 1.96
SHOWN_S, VIEW_PX = 18.5, (320, 240)  # moment of the run, and size of a view on the sheet
SEEDS = (301, 201)  # on neither was anything chosen; the first was made when all choices stood
ROBOTS = {"12kg": 1.0, "6kg": 0.5}  # mass and cables' stiffness as parts of those of the robot that ships


@dataclass(frozen=True)
class ReadingErrors:
    """Errors of the readings of one run within one range of its contacts, over all endcaps.

    Attributes:
        robot, seed, source: which run, and whether of pictures or of the noise model.
        where: ``inside`` 75 N and 78 degrees, ``beyond``, or ``free``: no contact.
        readings: how many. rmse_force_n, rmse_torque_nm: of an axis. median_force_percent: of the load.
        covered: part of the axes within 1.96 stated standard deviations. flagged: part with ``out_of_range``.
        unconfirmed: part that the pipeline marks so: a sudden change that no second picture has confirmed yet.
        confirmed_rmse_n: of an axis of the force of the others.
        lost: part without a number. wrong_bit: part whose contact bit is wrong. clamped: part whose picture shows a
            contact near the run's. apart_n, apart_nm: root mean square of an axis by which the state in the picture and
            the run differ.
    """

    robot: str
    seed: int
    source: str
    where: str
    readings: int
    rmse_force_n: float
    rmse_torque_nm: float
    median_force_percent: float
    covered: float
    flagged: float
    unconfirmed: float
    confirmed_rmse_n: float
    lost: float
    wrong_bit: float
    clamped: float
    apart_n: float
    apart_nm: float


def robot_of(share: float) -> TensegrityRobot:
    """The robot that ships with a part of its mass, and its cables as much softer: the same shape, the same gait."""
    robot = load_robot()
    bars = [replace(bar, mass_kg=share * bar.mass_kg, inertia_kg_m2=share * bar.inertia_kg_m2) for bar in robot.bars]
    cables = [replace(cable, stiffness_n_m=share * cable.stiffness_n_m) for cable in robot.cables]
    return replace(robot, bars=tuple(bars), cables=tuple(cables))


def noise_readings(
    walk: Walk, robot: TensegrityRobot, arrivals: Sequence[Arrival], like: dict[str, Readings]
) -> dict[str, Readings]:
    """The noise model's samples in the form of those of pictures.

    Args:
        walk, robot: the run. arrivals: of it. like: readings of pictures at the same times.
    """
    found = {}
    for endcap in robot.endcaps:
        part = like[endcap.name]
        foot_samples = [
            one.sample for one in arrivals if isinstance(one.sample, FootSample) and one.sample.endcap == endcap.name
        ]
        foot_samples.sort(key=lambda foot: foot.time_s)
        rows = np.round(part.time_s / walk_step(walk)).astype(int)
        found[endcap.name] = replace(
            part, wrench=np.array([np.concatenate([foot.force_n, foot.torque_nm]) for foot in foot_samples]),
            covariance=np.array([foot.covariance for foot in foot_samples]),
            touching=np.array([int(bool(foot.touching)) for foot in foot_samples]),
            flags=np.array([" ".join(sorted(foot.flags)) for foot in foot_samples]),
            shown=true_wrenches(walk, robot, endcap, rows)[0], clamped=np.zeros(len(foot_samples), dtype=bool),
        )  # fmt: skip
    return found


def reading_errors(found: dict[str, Readings], label: tuple[str, int, str]) -> Iterator[ReadingErrors]:
    """Errors by range.

    Args:
        found: of all endcaps of a run. label: (robot, seed, source).
    """
    joined = {
        entry.name: np.concatenate([getattr(part, entry.name) for part in found.values()]) for entry in fields(Readings)
    }
    every = Readings(**joined)
    inside = (every.load_n <= RANGE_N) & (every.tilt_deg <= RANGE_DEG)
    touching = every.load_n > LEAST_N
    for where, rows in (("inside", touching & inside), ("beyond", touching & ~inside), ("free", every.load_n == 0)):
        error = every.wrench[rows] - every.shown[rows]
        known = np.isfinite(error).all(axis=1)
        error, sigma = error[known], np.sqrt(np.diagonal(every.covariance[rows][known], axis1=1, axis2=2))
        bit = every.touching[rows]
        load = every.load_n[rows][known]
        share = np.linalg.norm(error[:, :3], axis=1)[load > 0] / load[load > 0]
        flags = every.flags[rows]
        unconfirmed = np.array([UNCONFIRMED in word.split() for word in flags], dtype=bool)
        yield ReadingErrors(
            *label, where, int(rows.sum()), _rms(error[:, :3]), _rms(error[:, 3:]),
            100 * float(np.median(share)) if len(share) else float("nan"),
            float((np.abs(error) < INSIDE_95 * sigma).mean()) if known.any() else float("nan"),
            float(np.mean(["out_of_range" in word for word in flags])),
            float(unconfirmed.mean()), _rms(error[~unconfirmed[known], :3]),
            1 - float(known.mean()), float((bit != (every.load_n[rows] > 0)).mean()), float(every.clamped[rows].mean()),
            _rms((every.ran - every.shown)[rows, :3]), _rms((every.ran - every.shown)[rows, 3:]),
        )  # fmt: skip


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean())) if values.size else float("nan")


def run(options: argparse.Namespace, stage: Stage) -> None:
    """Read and judge every run that is asked for; both files are written anew after each.

    Args:
        options: of the command. stage: what the runs share.
    """
    scores: list[dict[str, Any]] = []
    errors: list[dict[str, Any]] = []
    for seed in options.seeds:
        for name in options.robots:
            robot = robot_of(ROBOTS[name])
            walk = held_out(robot, Terrain.FLAT, seed, options.seconds, stage.folder / name)
            arrivals = sensor_stream(walk, robot, SensorSet(wrench_hz=options.hz), seed)
            pictured = stage.read(walk, robot, frame_times(arrivals), run_name(name, seed, options))
            for source, found, stream in (
                ("pictures", pictured, with_pictures(arrivals, pictured)),
                ("noise", noise_readings(walk, robot, arrivals, pictured), arrivals),
            ):
                judge_arrivals(walk, robot, stream[:2000], DEFAULTS, ("", 0.0))  # compiles; else times are those of it
                score = judge_arrivals(walk, robot, stream, DEFAULTS, (source, 0.0))
                scores.append({"robot": name, **asdict(score)})
                errors += [asdict(part) for part in reading_errors(found, (name, seed, source))]
            write_table(options.out, scores, figures=5)
            write_table(options.out.with_name(f"{options.out.stem}_readings.csv"), errors, figures=5)


def picture(options: argparse.Namespace, stage: Stage) -> bytes:
    """What the six cameras of the first run see :data:`SHOWN_S` after its start, as JPEG."""
    name = options.robots[0]
    robot = robot_of(ROBOTS[name])
    walk = held_out(robot, Terrain.FLAT, options.seeds[0], options.seconds, stage.folder / name)
    rows = np.array([round(SHOWN_S / walk_step(walk))])
    views = []
    for endcap in robot.endcaps:
        view = cv2.resize(stage.picture(walk, robot, endcap, SHOWN_S), VIEW_PX, interpolation=cv2.INTER_AREA)
        load = float(np.linalg.norm(true_wrenches(walk, robot, endcap, rows)[0][0, :3]))
        label = f"{endcap.name}: {load:.1f} N"
        view = cv2.copyMakeBorder(view, 24, 0, 0, 0, cv2.BORDER_CONSTANT, value=(255, 255, 255))
        cv2.putText(view, label, (8, 17), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
        views.append(view)
    sheet = np.vstack([np.hstack(views[:3]), np.hstack(views[3:])])
    return cv2.imencode(".jpg", sheet, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()


def run_name(robot: str, seed: int, options: argparse.Namespace) -> str:
    """Of the files that keep a run's solved states."""
    return f"{robot}_flat_{seed}_{options.seconds:g}s_{options.hz:g}hz"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(description="The robot's estimate from rendered frames through the live pipeline.")
    parser.add_argument("what", choices=("run", "picture"))
    parser.add_argument("--robots", nargs="+", choices=tuple(ROBOTS), default=["6kg"], help="(default: 6kg)")
    parser.add_argument("--seeds", nargs="+", type=int, default=list(SEEDS), help="of the runs (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each run (default: %(default)g)")
    parser.add_argument("--hz", type=float, default=10.0, help="frames a second of an endcap (default: %(default)g)")
    parser.add_argument("--workers", type=int, default=1, help="processes that solve contacts (default: %(default)s)")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="of the solved states (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=HERE / "robot_pictures.csv")
    options = parser.parse_args(arguments)
    terminal = sys.stderr.isatty()

    def say(text: str) -> None:
        print(f"\r{text:<60}" if terminal else text, end="" if terminal else "\n", file=sys.stderr, flush=True)

    stage = Stage(options.folder, say, options.workers)
    if options.what == "run":
        run(options, stage)
        print(options.out.read_text(), options.out.with_name(f"{options.out.stem}_readings.csv").read_text(), sep="\n")
    else:
        replace_file(options.out.with_suffix(".jpg"), picture(options, stage))
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
