"""Where the robot is, from its endcaps: ``python bench/bench_robot.py`` writes robot.csv, and goes on where it was.

    python bench/bench_robot.py table                   # five kinds of contact knowledge on every terrain
    python bench/bench_robot.py curves                  # rates, delay, noise, gyroscopes, silicone, wrong settings
    python bench/bench_robot.py report                  # both, of what is there; and robot.png
    python bench/bench_robot.py table --config FILE --seconds 25 --out bench/robot_six_bar.csv     # six bars

A row of the file is one run, one kind of knowledge and one set of sensors; a run that is in it is not done again.
A run of 40 s takes about eight seconds of one core; ``--workers`` shares the runs among processes.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path

import joblib
import numpy as np
from one_line import in_one_line
from robot_runs import FIRST_SEED, Score, held_out, judge

from sensing.robot.settings import DEFAULTS, Contacts, Settings
from sensing.simulator.walk.stream import SensorSet
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import SHIPPED, load_robot

HERE = Path(__file__).parent
WALKS = HERE.parent / "exports" / "bench" / "robot"
MAIN = (Terrain.FLAT, Terrain.ROUGH, Terrain.SLOPE, Terrain.LOW_FRICTION)
CURVES: dict[str, tuple[float, ...]] = {  # knob of the sensors, or of the estimator's Settings -> its levels
    "inertial_hz": (15, 25, 50, 100, 200),
    "wrench_hz": (5, 10, 20, 30, 60),
    "wrench_delay_s": (0.0, 0.035, 0.1, 0.3),
    "wrench_noise": (0.0, 1.0, 3.0, 10.0),
    "beyond_noise": (1.0, 2.0, 5.0),
    "length_m": (0.0005, 0.002, 0.005),
    "gyroscopes": (1, 2, 3),
    "force_scale": (0.74, 1.0, 1.35),
    "compliance_m_n": (1.75e-4, 2.5e-4, 3.5e-4),
    "yield_delay_s": (0.0, 0.01, 0.02),
    "slip_gain": (1.0, 2.0, 3.0),
}
COLUMNS = ("drift_percent", "height_percent", "tilt_deg", "yaw_deg", "yaw_10m_deg", "axis_deg", "endcaps_mm",
           "nees_place", "nees_turn", "inside_place", "inside_turn", "sample_ms", "core", "late_ms")  # fmt: skip
_COMPILED = [False]  # in this process
Plan = tuple[Terrain, int, Settings, SensorSet, str, float]


def table_plan(terrains: Sequence[Terrain], seeds: int, kinds: Sequence[Contacts]) -> Iterator[Plan]:
    """Every kind of knowledge on every run; the runs of a seed on all terrains before those of the next.

    Args:
        terrains: on which. seeds: runs a terrain. kinds: of knowledge.
    """
    for kind in kinds:
        for seed in range(FIRST_SEED, FIRST_SEED + seeds):
            for terrain in terrains:
                yield terrain, seed, replace(DEFAULTS, contacts=kind), SensorSet(), "", 0.0


def curve_plan(terrains: Sequence[Terrain], seeds: int) -> Iterator[Plan]:
    """Every knob at every level, by the six-axis wrench."""
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for terrain in terrains:
            for knob, levels in CURVES.items():
                for level in levels:
                    yield terrain, seed, *with_knob(knob, level), knob, float(level)


def with_knob(knob: str, level: float) -> tuple[Settings, SensorSet]:
    """The defaults but for one knob, of the estimator's settings or of the sensors."""
    sensors = SensorSet()
    if hasattr(DEFAULTS, knob):
        return replace(DEFAULTS, **{knob: level}), sensors
    whole = isinstance(getattr(sensors, knob), int)
    return DEFAULTS, replace(sensors, **{knob: int(level) if whole else level})


def run(
    plans: Sequence[Plan], out: Path, walks: Path, duration_s: float, workers: int = 1, config: Path | None = None
) -> None:
    """Do what is not in the file yet; a row is written as soon as it and those before it are there.

    Args:
        plans: what is wanted. out: the file. walks: folder of simulated runs. duration_s: of each run.
        workers: processes. config: the robot's file; None for the one that ships.
    """
    done = {(row.terrain, row.seed, row.contacts, row.knob, row.level) for row in read(out)}
    left = [plan for plan in plans if (plan[0].value, plan[1], plan[2].contacts.value, *plan[4:]) not in done]
    new = not out.exists()
    with out.open("a", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        if new:
            writer.writerow([entry.name for entry in fields(Score)])
        jobs = (joblib.delayed(score_of)(plan, walks, duration_s, config) for plan in left)
        for number, found in enumerate(joblib.Parallel(workers, return_as="generator")(jobs)):
            if sys.stderr.isatty():
                print(
                    f"\r{number + 1}/{len(left)} {found.terrain} {found.seed} {found.knob}    ", end="", file=sys.stderr
                )
            writer.writerow([f"{value:.6g}" if isinstance(value, float) else value for value in asdict(found).values()])
            stream.flush()


def score_of(plan: Plan, walks: Path, duration_s: float, config: Path | None = None) -> Score:
    """Simulate one run, unless it is kept, and judge its estimate.

    Args:
        plan: which. walks: folder of simulated runs. duration_s: of the run. config: the robot's file.
    """
    terrain, seed, settings, sensors, knob, level = plan
    robot = load_robot(config or SHIPPED)
    walk = held_out(robot, terrain, seed, duration_s, walks)
    if not compiled():  # else a process's first times are those of the compiler
        judge(walk, robot, sensors, settings, knob, level)
    return judge(walk, robot, sensors, settings, knob, level)


def compiled() -> bool:
    """Whether this process has followed a run before."""
    before, _COMPILED[0] = _COMPILED[0], True
    return before


def read(path: Path) -> list[Score]:
    """Rows of the file; none where there is none."""
    if not path.exists():
        return []
    kinds = {entry.name: {"str": str, "int": int, "float": float}[str(entry.type)] for entry in fields(Score)}
    with path.open(encoding="utf-8", newline="") as stream:
        return [Score(**{name: kinds[name](text) for name, text in row.items()}) for row in csv.DictReader(stream)]


def table(rows: Sequence[Score]) -> str:
    """A line a terrain and kind of knowledge: median and 95 % quantile; of the shares inside a region, the mean."""
    lines = ["| terrain | contacts | runs | path m | " + " | ".join(COLUMNS) + " |", "|---" * (4 + len(COLUMNS)) + "|"]
    plain = [row for row in rows if not row.knob]
    for terrain in dict.fromkeys(row.terrain for row in plain):
        for kind in dict.fromkeys(row.contacts for row in plain):
            group = [row for row in plain if row.terrain == terrain and row.contacts == kind]
            if group:
                path = np.median([row.path_m for row in group])
                lines.append(f"| {terrain} | {kind} | {len(group)} | {path:.1f} | " + " | ".join(_cells(group)) + " |")
    return "\n".join(lines)


def curves(rows: Sequence[Score]) -> str:
    """The same, a line a knob and level."""
    lines = ["| knob | level | runs | " + " | ".join(COLUMNS) + " |", "|---" * (3 + len(COLUMNS)) + "|"]
    for knob, levels in CURVES.items():
        for level in levels:
            group = [row for row in rows if row.knob == knob and np.isclose(row.level, level)]
            if group:
                lines.append(f"| {knob} | {level:g} | {len(group)} | " + " | ".join(_cells(group)) + " |")
    return "\n".join(lines)


def _cells(group: Sequence[Score]) -> list[str]:
    values = {name: np.array([getattr(row, name) for row in group]) for name in COLUMNS}
    return [
        f"{column.mean():.3f}"
        if name.startswith("inside")
        else f"{np.median(column):.3g} ({np.quantile(column, 0.95):.3g})"
        for name, column in values.items()
    ]


def plot(rows: Sequence[Score], path: Path) -> None:
    """Drift of every kind of knowledge on every terrain, and the curves."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from plain_ticks import plain_digits

    figure, axes = pyplot.subplots(3, 4, figsize=(16, 10), layout="constrained")
    first, plain = axes.flat[0], [row for row in rows if not row.knob]
    terrains = list(dict.fromkeys(row.terrain for row in plain))
    for kind in dict.fromkeys(row.contacts for row in plain):
        drift = [[row.drift_percent for row in plain if (row.terrain, row.contacts) == (t, kind)] for t in terrains]
        first.plot(terrains, [np.median(values) if values else np.nan for values in drift], "o-", label=kind)
    first.set(yscale="log", ylabel="drift, % of the path (median)")
    plain_digits(first.yaxis)
    first.tick_params(axis="x", rotation=30)
    first.legend()
    for axis, (knob, levels) in zip(axes.flat[1:], CURVES.items(), strict=False):
        groups = [[r.drift_percent for r in rows if r.knob == knob and np.isclose(r.level, x)] for x in levels]
        kept = [(x, values) for x, values in zip(levels, groups, strict=True) if values]
        for x, values in kept:
            axis.plot([x] * len(values), values, ".", color="0.7")
        axis.plot([x for x, _ in kept], [np.median(values) for _, values in kept], "o-")
        axis.set(xlabel=knob, ylabel="drift, %", yscale="log")
        plain_digits(axis.yaxis)
    for axis in axes.flat[1 + len(CURVES) :]:
        axis.remove()
    figure.savefig(path, dpi=80)


def add_run_arguments(
    parser: argparse.ArgumentParser, terrains: Sequence[Terrain], seeds: int, seconds: float, out: Path
) -> None:
    """Options that the benches of the robot have in common.

    Args:
        parser: receives them. terrains, seeds, seconds, out: the defaults.
    """
    parser.add_argument(
        "--terrains", nargs="+", type=Terrain, default=list(terrains), metavar="NAME",
        help=f"of {', '.join(one.value for one in Terrain)} (default: {', '.join(one.value for one in terrains)})",
    )  # fmt: skip
    parser.add_argument("--seeds", type=int, default=seeds, help="runs a terrain (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=seconds, help="of each run (default: %(default)g)")
    parser.add_argument("--out", type=Path, default=out)
    parser.add_argument("--walks", type=Path, default=WALKS, help="folder that keeps the simulated runs")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(description="Estimate of the simulated robot against the truth.")
    parser.add_argument("what", nargs="?", choices=("walks", "table", "curves", "report"), default="table")
    add_run_arguments(parser, MAIN, 20, 40.0, HERE / "robot.csv")
    parser.add_argument(
        "--kinds", nargs="+", type=Contacts, default=list(Contacts)[::-1], metavar="NAME",
        help=f"of {', '.join(one.value for one in Contacts)} (default: all)",
    )  # fmt: skip
    parser.add_argument("--config", type=Path, metavar="FILE", help="robot.toml of another robot")
    parser.add_argument("--workers", type=int, default=1, help="processes (default: %(default)s)")
    options = parser.parse_args(arguments)
    if options.what == "walks":
        for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
            for terrain in options.terrains:
                held_out(load_robot(options.config or SHIPPED), terrain, seed, options.seconds, options.walks)
    elif options.what != "report":
        if options.what == "table":
            plans = table_plan(options.terrains, options.seeds, options.kinds)
        else:
            plans = curve_plan(options.terrains, options.seeds)
        run(list(plans), options.out, options.walks, options.seconds, options.workers, options.config)
    rows = read(options.out)
    print(table(rows), curves(rows), sep="\n\n")
    if options.what == "report":
        plot(rows, options.out.with_suffix(".png"))
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
