"""gtsam's legged filter on the simulated robot: ``python bench/bench_robot_gtsam.py table`` writes robot_gtsam.csv.

    pip install 'gtsam>=4.3'                            # BSD; this comparison alone needs it
    python bench/bench_robot_gtsam.py tune              # its free setting, on tuning runs
    python bench/bench_robot_gtsam.py table             # the held-out runs of bench_robot.py, a row each

``LeggedInvariantEKF`` (contact-aided invariant filter: Hartley et al. 2020, doi:10.1177/0278364919894385) knows one
base with an inertial sensor, and footholds that stand still while they touch. Base: the bar with the accelerometer.
Footholds: the centres of the endcaps' spheres. Its inertial samples and contact bits are those of the same streams;
what our estimator has to find it is **given as the truth**: the robot's shape at every moment, pose and velocity when
it begins, the mean errors of both inertial sensors (it has none of its own), and no sample comes late. Contacts are
left to it: one covariance for all of them, no rolling, and slip as a random walk of the foothold alone.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bench_robot import MAIN, add_run_arguments
from one_line import in_one_line
from robot_runs import ASKED_S, FIRST_SEED, Score, errors, held_out, score, tuning_run
from table_file import write_table

from cad.messages import LOG
from sensing.robot.estimate import BarEstimate, Health, RobotEstimate
from sensing.robot.settings import DEFAULTS
from sensing.simulator.walk.gait import endcap_centres
from sensing.simulator.walk.stream import SensorSet, sensor_stream
from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import GRAVITY_M_S2, Array, InertialSensor, TensegrityRobot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample

try:
    import gtsam
except ImportError:
    LOG.error("bench_robot_gtsam: gtsam is not installed: run pip install 'gtsam>=4.3'")
    sys.exit(2)

HERE = Path(__file__).parent
CONTACTS_HZ = 30.0  # the rate of the contact bits
TUNING_SEEDS = (1, 2)
WALKS_M_RTS = (0.03, 0.1, 0.2, 0.3, 0.5, 1.0)  # of `tune`
FOOT_WALK_M_RTS = 0.1  # random walk of a foot on the ground, chosen by `tune`
FIRST_SD = (1e-3,) * 6 + (0.01,) * 3  # rad, m, m/s
COLUMNS = (
    "terrain", "seed", "path_m", "drift_percent", "height_percent", "tilt_deg", "yaw_deg", "yaw_10m_deg", "core"
)  # fmt: skip


def filter_of(walk: Walk, robot: TensegrityRobot, sensor: InertialSensor, first: int, foot_walk: float) -> Any:
    """The filter at one time, begun with the truth.

    Args:
        walk: what happened. robot: whose. sensor: the base. first: row of the walk. foot_walk: of a foot, m/sqrt(s).
    """
    params, count = gtsam.LeggedEstimatorParams(), len(robot.endcaps)
    noise = params.preintegrationParams = gtsam.PreintegrationParams.MakeSharedU(GRAVITY_M_S2)
    noise.setGyroscopeCovariance(DEFAULTS.rate_noise**2 * np.eye(3))
    noise.setAccelerometerCovariance(DEFAULTS.force_noise**2 * np.eye(3))
    noise.setIntegrationCovariance(1e-10 * np.eye(3))
    params.body_P_imu = gtsam.Pose3()
    params.contactCovariance = DEFAULTS.bit_sd_m**2 * np.eye(3)
    params.footholdProcessSigma = foot_walk
    params.footholdInitSigma = 10.0  # a foot that lands says nothing of the base
    params.useFullContactInitialization = False
    params.marginalizeLeavingFoot = True
    bar = robot.bar_number(sensor.bar)
    pose, motion = walk.T_world_bar[first, bar] @ sensor.T_bar_imu, walk.velocity[first, bar]
    lever = np.cross(motion[3:], sensor.T_bar_imu[:3, 3])
    speed = motion[:3] + walk.T_world_bar[first, bar, :3, :3] @ lever
    covariance = np.diag([sd**2 for sd in FIRST_SD] + [params.footholdInitSigma**2] * 3 * count)
    state = gtsam.NavState(gtsam.Rot3(pose[:3, :3]), pose[:3, 3], speed)
    names = [f"foot{number}" for number in range(count)]
    return gtsam.LeggedInvariantEKF(state, np.zeros((3, count)), covariance, params, names)


def without_offsets(walk: Walk, robot: TensegrityRobot, sensor: InertialSensor) -> Iterator[tuple[float, Array, Array]]:
    """(time, rate, specific force) of the base's samples, less the true mean of their errors over the run."""
    perfect = SensorSet(
        gyro_rad_s_rthz=0, acceleration_m_s2_rthz=0, gyro_zero_rad_s=0, acceleration_zero_m_s2=0, gyro_walk=0,
        acceleration_walk=0,
    )  # fmt: skip
    measured, true = (_inertial(walk, robot, sensor, sensors) for sensors in (SensorSet(), perfect))
    values = np.array([[s.rate_rad_s, s.acceleration_m_s2] for s in measured])
    values -= (values - np.array([[s.rate_rad_s, s.acceleration_m_s2] for s in true])).mean(axis=0)
    for sample, (rate, force) in zip(measured, values, strict=True):
        yield sample.time_s, rate, force


def _inertial(walk: Walk, robot: TensegrityRobot, sensor: InertialSensor, sensors: SensorSet) -> list[InertialSample]:
    samples = [arrival.sample for arrival in sensor_stream(walk, robot, sensors, walk.seed)]
    mine = [one for one in samples if isinstance(one, InertialSample) and one.sensor == sensor.name]
    return sorted(mine, key=lambda one: one.time_s)


def followed(walk: Walk, robot: TensegrityRobot, foot_walk: float) -> tuple[list[RobotEstimate], int, float]:
    """(estimates, inertial samples, processor time in s) of a run.

    Args:
        walk: what happened; its seed is that of the sensors' noise, too. robot: whose. foot_walk: of a foot, m/sqrt(s).
    """
    sensor = next(one for one in robot.sensors if one.accelerometer)
    samples = [arrival.sample for arrival in sensor_stream(walk, robot, SensorSet(), walk.seed)]
    bits = sorted((one for one in samples if isinstance(one, FootSample)), key=lambda one: one.time_s, reverse=True)
    places, touching = footholds_in(walk, robot, sensor), {endcap.name: False for endcap in robot.endcaps}
    step, before_s = walk.time_s[1] - walk.time_s[0], DEFAULTS.start_s
    found, packet_s, ask_s = filter_of(walk, robot, sensor, round(before_s / step), foot_walk), before_s, before_s
    estimates, count, spent = [], 0, 0.0
    for time_s, rate, force in without_offsets(walk, robot, sensor):
        if time_s < DEFAULTS.start_s + step / 2:
            continue
        row = round(time_s / step)
        while bits and bits[-1].time_s <= time_s:
            bit = bits.pop()
            touching[bit.endcap] = bool(bit.touching)
        begun = time.process_time()
        found.predict(rate, force, time_s - before_s)
        if time_s >= packet_s:
            found.processContacts([contact(k, places[row, k]) for k, held in enumerate(touching.values()) if held])
            packet_s += 1 / CONTACTS_HZ
        spent, before_s, count = spent + time.process_time() - begun, time_s, count + 1
        if time_s >= ask_s:
            estimates.append(estimate_of(found, walk, robot, sensor, row))
            ask_s += ASKED_S
    return estimates, count, spent


def footholds_in(walk: Walk, robot: TensegrityRobot, sensor: InertialSensor) -> Array:
    """(N, E, 3) m, true places of the spheres' centres in the sensor's axes."""
    poses = walk.T_world_bar[:, robot.bar_number(sensor.bar)] @ sensor.T_bar_imu
    centres = np.array([endcap_centres(robot, bars) for bars in walk.T_world_bar])
    return np.einsum("nji,nej->nei", poses[:, :3, :3], centres - poses[:, None, :3, 3])


def contact(foot: int, place_m: Array) -> Any:
    """A foot that touches."""
    made = gtsam.ContactMeasurement()
    made.foot, made.bodyPoint, made.touchdown = foot, place_m, False
    return made


def estimate_of(found: Any, walk: Walk, robot: TensegrityRobot, sensor: InertialSensor, row: int) -> RobotEstimate:
    """The robot with the filter's base and the true shape; NaN for what the filter does not estimate."""
    state, leader = found.estimate(), robot.bar_number(sensor.bar)
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = state.rotation().matrix(), state.x(0)
    truth = walk.T_world_bar[row]
    move = base @ np.linalg.inv(truth[leader] @ sensor.T_bar_imu)
    none, unknown = np.full(3, np.nan), np.full((9, 9), np.nan)
    bars = tuple(
        BarEstimate(bar.name, move @ pose, none, none, unknown, unknown[:3, :3], unknown[:3, :3])
        for bar, pose in zip(robot.bars, truth, strict=True)
    )
    time_s, nan = float(walk.time_s[row]), float("nan")
    return RobotEstimate(
        time_s, time_s, bars, (), none, unknown[:3, :3], nan, nan, nan, nan, nan, nan, Health(nan, nan, nan, 0, 0, ()),
    )  # fmt: skip


def judged(walk: Walk, robot: TensegrityRobot, foot_walk: float = FOOT_WALK_M_RTS) -> Score:
    """Follow a run and judge it as bench_robot.py does."""
    estimates, count, spent = followed(walk, robot, foot_walk)
    return score(walk, errors(walk, robot, estimates), (count, spent, np.zeros(1)), ("gtsam", "", 0.0))


def tune(robot: TensegrityRobot, folder: Path, duration_s: float) -> None:
    """Median drift over the tuning runs, by the foot's random walk."""
    walks = [tuning_run(robot, *one, duration_s, folder) for one in itertools.product(MAIN, TUNING_SEEDS)]
    print("| foot's random walk, m/sqrt(s) | median drift, % |", "|---|---|", sep="\n")
    for foot_walk in WALKS_M_RTS:
        drifts = [judged(walk, robot, foot_walk).drift_percent for walk in walks]
        print(f"| {foot_walk:g} | {np.median(drifts):.3g} |", flush=True)


def table(robot: TensegrityRobot, options: argparse.Namespace) -> None:
    """Judge the held-out runs, write a row each and print a line a terrain."""
    rows = [
        judged(held_out(robot, terrain, seed, options.seconds, options.walks), robot)
        for terrain in options.terrains
        for seed in range(FIRST_SEED, FIRST_SEED + options.seeds)
    ]
    write_table(options.out, [{name: getattr(row, name) for name in COLUMNS} for row in rows], figures=4)
    print("| terrain | runs | " + " | ".join(COLUMNS[2:]) + " |", "|---" * len(COLUMNS) + "|", sep="\n")
    for terrain in options.terrains:
        group = [row for row in rows if row.terrain == terrain.value]
        columns = [np.array([getattr(row, name) for row in group]) for name in COLUMNS[2:]]
        cells = [f"{np.median(column):.2g} ({np.quantile(column, 0.95):.2g})" for column in columns]
        print(f"| {terrain.value} | {len(group)} | " + " | ".join(cells) + " |")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(description="gtsam's LeggedInvariantEKF on the simulated robot.")
    parser.add_argument("what", nargs="?", choices=("tune", "table"), default="table")
    add_run_arguments(parser, MAIN, 20, 40.0, HERE / "robot_gtsam.csv")
    options = parser.parse_args(arguments)
    if options.what == "tune":
        tune(load_robot(), options.walks, options.seconds)
    else:
        table(load_robot(), options)
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
