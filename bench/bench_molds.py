"""How long `make molds` takes: a first run, another clearance, the same again; on one core and on more.

    python bench/bench_molds.py                  three sizes
    python bench/bench_molds.py --size 150/9     one of yours
    python bench/bench_molds.py --plot           the plot again from the table

Each run is the user's command in a folder and with a cache of its own. Writes bench/molds.csv (a row a run: seconds on
the wall, processor seconds of all its processes, what share of the cores other work took meanwhile, and the seconds of
each step as the command prints them) and bench/molds.png. A computer that others use is slower: compare runs of one
table by their ratios, and look at the share of other work first.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from cad.errors import EndcapError
from fab.command import VARIANT_DEFAULTS, parse_variant

HERE = Path(__file__).parent
ROOT = HERE.parent
TABLE = HERE / "molds.csv"
SIZES = ("130/8", "99/6.5", "250/20")
OTHER_CLEARANCE_MM = 0.1
STEP = re.compile(r"^ *(\d+\.\d) s (.+)$", re.MULTILINE)
HEADER = ("D_mm", "T_mm", "run", "cores", "wall_s", "cpu_s", "other_work_ratio", "steps")
RUNS = ("first, one core", "first", "another clearance", "again")


@dataclass(frozen=True)
class Run:
    """One run of the command.

    Attributes:
        size: D and T as typed, with a slash between.
        name: one of ``RUNS``.
        cores: that it could use.
        wall_s: from start to end. cpu_s: of all its processes.
        other_work_ratio: share of those cores' time that other programs took.
        steps: (name, seconds) as the command prints them.
    """

    size: str
    name: str
    cores: int
    wall_s: float
    cpu_s: float
    other_work_ratio: float
    steps: tuple[tuple[str, float], ...]


def main() -> None:
    """Measure, write, plot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, prog="bench_molds.py"
    )
    parser.add_argument("--size", action="append", type=_size, metavar="D/T", help=f"default: {' '.join(SIZES)}")
    parser.add_argument("--plot", action="store_true", help="draw only")
    options = parser.parse_args()
    if not options.plot:
        runs = [run for size in options.size or SIZES for run in runs_of(size)]
        _write(runs)
    _draw(_read())


def _size(text: str) -> str:
    """D/T as typed.

    Raises:
        argparse.ArgumentTypeError: it is of another form, or lies outside the valid region.
    """
    diameter, _, wall = text.partition("/")
    try:
        parse_variant({**VARIANT_DEFAULTS, "D": diameter, "T": wall})
    except EndcapError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: give D/T in mm, such as 150/9: {error}") from None
    return text


def runs_of(size: str) -> list[Run]:
    """All runs of one size, each printed when it ends."""
    cores, runs = sorted(os.sched_getaffinity(0)), []
    with tempfile.TemporaryDirectory(prefix="molds-") as alone, tempfile.TemporaryDirectory(prefix="molds-") as kept:
        other = f"joint_clearance={OTHER_CLEARANCE_MM:g}"
        asked = ((cores[:1], alone, ()), (cores, kept, ()), (cores, kept, (other,)), (cores, kept, ()))
        for name, (use, folder, words) in zip(RUNS, asked, strict=True):
            run = timed(size, name, use, words, Path(folder))
            runs.append(run)
            print(
                f"D/T {size}, {name}: {run.wall_s:.1f} s, {run.cpu_s:.1f} s of a processor, other work took "
                f"{100 * run.other_work_ratio:.0f} % of {run.cores} cores",
                flush=True,
            )
    return runs


def timed(size: str, name: str, cores: list[int], words: tuple[str, ...], folder: Path) -> Run:
    """Run the command once.

    Args:
        size: D/T. name: of the run. cores: that it may use. words: more of what is typed. folder: for cache and files.

    Raises:
        subprocess.CalledProcessError: it failed.
    """
    diameter, wall = size.split("/")
    typed = [sys.executable, "-m", "fab.molds", f"D={diameter}", f"T={wall}", f"exports={folder / 'exports'}", *words]
    before, used, start = _busy_s(cores), _children_s(), time.monotonic()
    done = subprocess.run(
        typed,
        cwd=ROOT,
        env=os.environ | {"XDG_CACHE_HOME": str(folder)},
        check=True,
        capture_output=True,
        text=True,
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    took, cpu = time.monotonic() - start, _children_s() - used
    other = max(0.0, _busy_s(cores) - before - cpu) / (took * len(cores))
    steps = tuple((step, float(seconds)) for seconds, step in STEP.findall(done.stderr))
    return Run(size, name, len(cores), took, cpu, other, steps)


def _children_s() -> float:
    """Processor seconds of all processes that ended as children of this one."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _busy_s(cores: list[int]) -> float:
    """Seconds since its start for which these cores were not idle, stolen ones among them."""
    lines = {words[0]: words[1:] for words in map(str.split, Path("/proc/stat").read_text().splitlines())}
    ticks = 0
    for core in cores:
        user, nice, system, _, _, interrupts, soft, stolen = map(int, lines[f"cpu{core}"][:8])
        ticks += user + nice + system + interrupts + soft + stolen
    return ticks / os.sysconf("SC_CLK_TCK")


def _write(runs: list[Run]) -> None:
    with TABLE.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(HEADER)
        for run in runs:
            steps = "; ".join(f"{name} {seconds:.1f}" for name, seconds in run.steps)
            numbers = (f"{run.wall_s:.1f}", f"{run.cpu_s:.1f}", f"{run.other_work_ratio:.3f}")
            writer.writerow((*run.size.split("/"), run.name, run.cores, *numbers, steps))


def _read() -> list[dict[str, str]]:
    with TABLE.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def _draw(rows: list[dict[str, str]]) -> None:
    """A bar a run; a mark at its processor seconds divided by its cores, below which no division of the work goes."""
    figure, axis = plt.subplots(figsize=(8, 0.45 * len(rows) + 1.2), dpi=110)
    for place, row in enumerate(rows):
        wall, cores = float(row["wall_s"]), int(row["cores"])
        axis.barh(place, wall, color=f"C{RUNS.index(row['run'])}", height=0.7)
        axis.plot(float(row["cpu_s"]) / cores, place, "k|", ms=14, label="" if place else "processor seconds / cores")
        axis.annotate(f"{wall:.1f} s", (wall, place), (4, 0), textcoords="offset points", va="center")
    axis.set_yticks(
        range(len(rows)), [f"D={row['D_mm']} T={row['T_mm']}, {row['run']} ({row['cores']})" for row in rows]
    )
    axis.invert_yaxis()
    other = max(float(row["other_work_ratio"]) for row in rows)
    axis.set_xlabel(f"seconds; other programs took up to {100 * other:.0f} % of the cores")
    axis.legend(loc="lower right")
    axis.margins(x=0.16)
    figure.tight_layout()
    figure.savefig(HERE / "molds.png")


if __name__ == "__main__":
    sys.exit(in_one_line(main))
