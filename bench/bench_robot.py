"""Where the robot is, from its endcaps: ``python bench/bench_robot.py`` writes robot.csv, and goes on where it was.

    python bench/bench_robot.py table                   # five kinds of contact knowledge on every terrain
    python bench/bench_robot.py curves                  # rates, delay, noise, gyroscopes, wrong silicone
    python bench/bench_robot.py report                  # both, of what is there; and robot.png

A row of the file is one run, one kind of knowledge and one set of sensors; a run that is in it is not done again.
Hours on one core for all of it (``--seeds`` and ``--terrains`` for less).
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
from robot_runs import FIRST_SEED, Score, held_out, judge

from sensing.robot.settings import DEFAULTS, Contacts, Settings
from sensing.simulator.walk.stream import SensorSet
from sensing.simulator.walk.terrain import Terrain
from sensing.tensegrity.robot_file import load_robot

HERE = Path(__file__).parent
WALKS = HERE.parent / "exports" / "bench" / "robot"
MAIN = (Terrain.FLAT, Terrain.ROUGH, Terrain.SLOPE, Terrain.LOW_FRICTION)
CURVES: dict[str, tuple[float, ...]] = {  # knob of the sensors -> its levels; 1.0 and the defaults stand in the table
    "inertial_hz": (25, 50, 100, 200),
    "wrench_hz": (5, 10, 20, 30, 60),
    "wrench_delay_s": (0.0, 0.035, 0.1, 0.3),
    "wrench_noise": (0.0, 1.0, 3.0, 10.0),
    "length_m": (0.0005, 0.002, 0.005),
    "gyroscopes": (1, 2, 3),
    "force_scale": (0.74, 1.0, 1.35),
}
COLUMNS = ("drift_percent", "height_percent", "tilt_deg", "yaw_deg", "yaw_10m_deg", "axis_deg", "endcaps_mm",
           "nees_place", "nees_turn", "inside_place", "inside_turn", "sample_ms", "core", "late_ms")  # fmt: skip
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
                    whole = isinstance(getattr(SensorSet(), knob), int)
                    sensors = replace(SensorSet(), **{knob: int(level) if whole else level})
                    yield terrain, seed, DEFAULTS, sensors, knob, float(level)


def run(plans: Sequence[Plan], out: Path, walks: Path, duration_s: float) -> None:
    """Do what is not in the file yet; a row is written as soon as it is there.

    Args:
        plans: what is wanted. out: the file. walks: folder of simulated runs. duration_s: of each run.
    """
    robot, rows = load_robot(), read(out)
    done = {(row.terrain, row.seed, row.contacts, row.knob, row.level) for row in rows}
    new, compiled = not out.exists(), False
    with out.open("a", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        if new:
            writer.writerow([entry.name for entry in fields(Score)])
        for number, (terrain, seed, settings, sensors, knob, level) in enumerate(plans):
            if sys.stderr.isatty():
                print(f"\r{number + 1}/{len(plans)} {terrain.value} {seed} {knob}      ", end="", file=sys.stderr)
            if (terrain.value, seed, settings.contacts.value, knob, level) in done:
                continue
            walk = held_out(robot, terrain, seed, duration_s, walks)
            if not compiled:  # else the first row's times are those of the compiler
                compiled = judge(walk, robot, sensors, settings, knob, level) is not None
            found = judge(walk, robot, sensors, settings, knob, level)
            writer.writerow([f"{value:.6g}" if isinstance(value, float) else value for value in asdict(found).values()])
            stream.flush()


def read(path: Path) -> list[Score]:
    """Rows of the file; none where there is none."""
    if not path.exists():
        return []
    kinds = {entry.name: {"str": str, "int": int, "float": float}[str(entry.type)] for entry in fields(Score)}
    with path.open(encoding="utf-8", newline="") as stream:
        return [Score(**{name: kinds[name](text) for name, text in row.items()}) for row in csv.DictReader(stream)]


def table(rows: Sequence[Score]) -> str:
    """Median and 95 % quantile of every number, a line a terrain and kind of knowledge."""
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
    values = [np.array([getattr(row, name) for row in group]) for name in COLUMNS]
    return [f"{np.median(column):.3g} ({np.quantile(column, 0.95):.3g})" for column in values]


def plot(rows: Sequence[Score], path: Path) -> None:
    """Drift of every kind of knowledge on every terrain, and the curves."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 4, figsize=(16, 7), layout="constrained")
    first, plain = axes.flat[0], [row for row in rows if not row.knob]
    terrains = list(dict.fromkeys(row.terrain for row in plain))
    for kind in dict.fromkeys(row.contacts for row in plain):
        drift = [[row.drift_percent for row in plain if (row.terrain, row.contacts) == (t, kind)] for t in terrains]
        first.plot(terrains, [np.median(values) if values else np.nan for values in drift], "o-", label=kind)
    first.set(yscale="log", ylabel="drift, % of the path (median)")
    first.tick_params(axis="x", rotation=30)
    first.legend()
    for axis, (knob, levels) in zip(axes.flat[1:], CURVES.items(), strict=True):
        groups = [[r.drift_percent for r in rows if r.knob == knob and np.isclose(r.level, x)] for x in levels]
        kept = [(x, values) for x, values in zip(levels, groups, strict=True) if values]
        for x, values in kept:
            axis.plot([x] * len(values), values, ".", color="0.7")
        axis.plot([x for x, _ in kept], [np.median(values) for _, values in kept], "o-")
        axis.set(xlabel=knob, ylabel="drift, %", yscale="log")
    figure.savefig(path, dpi=80)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; returns the exit status."""
    parser = argparse.ArgumentParser(description="Estimate of the simulated robot against the truth.")
    parser.add_argument("what", choices=("walks", "table", "curves", "report"))
    parser.add_argument(
        "--terrains", nargs="+", type=Terrain, default=list(MAIN), metavar="NAME",
        help=f"of {', '.join(one.value for one in Terrain)} (default: {', '.join(one.value for one in MAIN)})",
    )  # fmt: skip
    parser.add_argument(
        "--kinds", nargs="+", type=Contacts, default=list(Contacts)[::-1], metavar="NAME",
        help=f"of {', '.join(one.value for one in Contacts)} (default: all)",
    )  # fmt: skip
    parser.add_argument("--seeds", type=int, default=20, help="runs a terrain (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each run (default: %(default)g)")
    parser.add_argument("--out", type=Path, default=HERE / "robot.csv")
    parser.add_argument("--walks", type=Path, default=WALKS, help="folder that keeps the simulated runs")
    options = parser.parse_args(arguments)
    if options.what == "walks":
        for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
            for terrain in options.terrains:
                held_out(load_robot(), terrain, seed, options.seconds, options.walks)
    elif options.what == "table":
        run(
            list(table_plan(options.terrains, options.seeds, options.kinds)),
            options.out,
            options.walks,
            options.seconds,
        )
    elif options.what == "curves":
        run(list(curve_plan(options.terrains, options.seeds)), options.out, options.walks, options.seconds)
    rows = read(options.out)
    print(table(rows), curves(rows), sep="\n\n")
    if options.what == "report":
        plot(rows, options.out.with_suffix(".png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
