"""How well each noise of the robot's estimator suits: ``python bench/bench_robot_tune.py`` writes robot_tune.csv, .png.

    python bench/bench_robot_tune.py             # each noise alone, halved and doubled: an hour of one core
    python bench/bench_robot_tune.py --set slip_share=0.7 anchor_sd_m=3e-4   # one line for settings of your own

Tuning runs only: another gait and other seeds than those of the published tables. Every second seed has wrong silicone:
forces times 1.2, or a compliance wrong by a fifth. So no noise is chosen for silicone that is known perfectly. What
decides is the logarithmic score e' P^-1 e + log det P of the stated poses (Gneiting and Raftery 2007,
doi:10.1198/016214506000001437), mean over bars, times and runs: a covariance too wide loses by it as one too narrow.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from pathlib import Path

import joblib
import numpy as np
from bench_robot import add_run_arguments
from one_line import in_one_line
from robot_runs import errors, followed, score, tuning_run
from table_file import write_table

from sensing.robot.settings import DEFAULTS, Settings
from sensing.simulator.walk.stream import SensorSet, sensor_stream
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot

HERE = Path(__file__).parent
NOISES = (
    "shape_rate_noise", "relative_noise", "relative_share", "length_error_m", "compliance_share", "anchor_sd_m",
    "softness_sd", "softness_stays_s", "error_stays_s", "roll_share", "anchor_walk", "creep_sd", "slip_sd_m_s",
    "slip_share", "slip_across", "normal_sd", "normal_walk",
)  # fmt: skip
FACTORS = (0.5, 2.0)
WRONG = {  # seed modulo 4: sensors, and the compliance as a part of the true one; the others are perfect
    2: (SensorSet(force_scale=1.2), 1.0),
    0: (SensorSet(), 0.8),
}


@dataclass(frozen=True)
class Tried:
    """What the tuning runs say of one choice of settings.

    Attributes:
        setting, factor: what was changed, by how much; empty and 1 for the defaults.
        log_score: mean; the lower, the better. nees_place, nees_wrong: median over runs of the runs' medians, a third
            of e' P^-1 e of the place, with the silicone known and wrong. nees_turn: the same of the turn, of all runs.
            inside_place, inside_wrong, inside_turn: share within the 95 % region. drift_percent, worst_percent: median
            and largest of the runs' drifts.
    """

    setting: str
    factor: float
    log_score: float
    nees_place: float
    nees_wrong: float
    nees_turn: float
    inside_place: float
    inside_wrong: float
    inside_turn: float
    drift_percent: float
    worst_percent: float


def one_run(terrain: Terrain, seed: int, settings: Settings, duration_s: float, folder: Path) -> tuple[float, ...]:
    """(log score, NEES of place and turn, shares inside, drift in percent) of one tuning run.

    Args:
        terrain, seed, duration_s: of the run. settings: of the estimator. folder: where runs are kept.
    """
    robot = load_robot()
    walk = tuning_run(robot, terrain, seed, duration_s, folder)
    sensors, compliance = WRONG.get(seed % 4, (SensorSet(), 1.0))
    wrong = replace(settings, compliance_m_n=compliance * settings.compliance_m_n)
    estimates, spent, walls = followed(walk, robot, sensor_stream(walk, robot, sensors, seed), wrong)
    found = errors(walk, robot, estimates)
    row = score(walk, found, (len(walls), spent, walls), (settings.contacts.value, "", 0.0))
    log_score = float(found.log_score.mean())
    return log_score, row.nees_place, row.nees_turn, row.inside_place, row.inside_turn, row.drift_percent


def tried(setting: str, factor: float, settings: Settings, options: argparse.Namespace) -> Tried:
    """All tuning runs with some settings.

    Args:
        setting, factor: the label. settings: of the estimator. options: terrains, seeds, seconds, walks, workers.
    """
    plan = [(terrain, seed) for seed in range(1, 1 + options.seeds) for terrain in options.terrains]
    jobs = (joblib.delayed(one_run)(*run, settings, options.seconds, options.walks) for run in plan)
    scores, place, turn, in_place, in_turn, drift = np.array(joblib.Parallel(options.workers)(jobs)).T
    wrong = np.array([seed % 4 in WRONG for _, seed in plan])
    return Tried(
        setting, factor, float(scores.mean()),
        float(np.median(place[~wrong])), float(np.median(place[wrong])), float(np.median(turn)),
        float(in_place[~wrong].mean()), float(in_place[wrong].mean()), float(in_turn.mean()),
        float(np.median(drift)), float(drift.max()),
    )  # fmt: skip


def line(row: Tried) -> str:
    """A row of the table."""
    numbers = " | ".join(f"{value:.3g}" if value < 100 else f"{value:.0f}" for value in astuple(row)[3:])
    return f"| {row.setting or 'as they are'} | {row.factor:g} | {row.log_score:.3f} | {numbers} |"


def plot(rows: Sequence[Tried], path: Path) -> None:
    """Score by the factor of each noise."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    as_they_are = next(row for row in rows if not row.setting)
    figure, axes = pyplot.subplots(3, 6, figsize=(17, 7.5), layout="constrained", sharex=True, sharey=True)
    for axis, noise in zip(axes.flat, NOISES, strict=False):
        group = sorted([as_they_are, *(row for row in rows if row.setting == noise)], key=lambda row: row.factor)
        axis.plot([row.factor for row in group], [row.log_score - as_they_are.log_score for row in group], "o-")
        axis.axhline(0.0, color="0.8", zorder=0)
        axis.set(title=f"{noise} = {getattr(DEFAULTS, noise):g}", xscale="log")
        axis.set_xticks((0.5, 1.0, 2.0), ("0.5", "1", "2"))
        axis.minorticks_off()
    for axis in axes.flat[len(NOISES) :]:
        axis.remove()
    for axis in axes[:, 0]:
        axis.set_ylabel("log score less that\nof the defaults")
    for axis in axes[-1]:
        axis.set_xlabel("times the default")
    figure.savefig(path, dpi=80)
    pyplot.close(figure)


def choices(options: argparse.Namespace) -> list[tuple[str, float, Settings]]:
    """(label, factor, settings) of what is tried."""
    if options.set:
        given = {name: float(value) for name, value in (word.split("=") for word in options.set)}
        return [(" ".join(options.set), 1.0, replace(DEFAULTS, **given))]
    alone = [
        (noise, factor, replace(DEFAULTS, **{noise: factor * getattr(DEFAULTS, noise)}))
        for noise in NOISES
        for factor in FACTORS
    ]
    return [("", 1.0, DEFAULTS), *alone]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--set", nargs="+", metavar="NAME=VALUE", help="try these settings only, and write no file")
    add_run_arguments(parser, list(Terrain), 2, 20.0, HERE / "robot_tune.csv")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: %(default)s)")
    options = parser.parse_args(arguments)
    if not 2 <= options.seeds <= 8:
        parser.error(f"--seeds {options.seeds}: tuning runs have seeds 1 to 8, every second one wrong silicone: 2 to 8")
    head = ("setting", "times", *(entry.name for entry in fields(Tried)[2:]))
    print("| " + " | ".join(head) + " |", "|---" * len(head) + "|", sep="\n")
    rows = []
    for choice in choices(options):
        rows.append(tried(*choice, options))
        print(line(rows[-1]), flush=True)
    if not options.set:
        write_table(options.out, list(map(asdict, rows)), figures=5)
        plot(rows, options.out.with_suffix(".png"))
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
