"""Does every size come out? Sizes over the whole valid region, each built and gated as `make molds` does it.

    python bench/bench_sizes.py                       as many as start within ten minutes; what this code has made is
                                                      not made again, so each run goes on where the last one ended
    python bench/bench_sizes.py --seconds inf         all of them: a day
    python bench/bench_sizes.py --only edge           one kind: edge, random, round, clearance, options
    python bench/bench_sizes.py --size 200/10 --size 130/8/0.05/dot_mm=5     these, whatever the table holds
    python bench/bench_sizes.py --today 3             three sizes of today's seed, nothing written: for continuous tests
    python bench/bench_sizes.py --plot                the map again from the table

Writes beside this file: sizes.csv (a row a size: kind, D, T, clearance, options, digest of the code that made it,
processor seconds, number of checks, what failed, and the used share of the limit of each check that changes from size
to size: 1 is the limit; empty in rows from before those columns), sizes.png, the map, and sizes_used.png, those shares.
A row is appended as soon as its size is done, so a run may be stopped at any time. Sizes run are those of every digest
in the table; the newest row of a size counts.
"""

from __future__ import annotations

import argparse
import csv
import math
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack
from datetime import date
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.sizes import WATCHED, Made, Size, code_digest, make, older_digests, option_sizes, random_sizes, survey
from cad.errors import EndcapError, ParameterError
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.mold.layout import JOINT_CLEARANCE_MM
from cad.options import DESIGN_DEFAULTS, PATTERN_DEFAULTS, parse_design, parse_length, parse_options
from cad.plain_numbers import plain
from fab.workers import end_with_parent, processes_with_room

HERE = Path(__file__).parent
TABLE = HERE / "sizes.csv"
TASKS_A_WORKER = 10  # the kernel gives little back: three gigabytes after ten large sizes
KEY = ("D_mm", "T_mm", "clearance_mm", "options")
HEADER = ("kind", *KEY, "code", "cpu_s", "checks", "failed", *WATCHED)
NUMBERS = ("D", "T", "joint_clearance")
DEFAULTS = DESIGN_DEFAULTS | PATTERN_DEFAULTS | {"joint_clearance": plain(JOINT_CLEARANCE_MM)}
KINDS = {"edge": "s", "random": "o", "round": "D", "clearance": "^", "options": "v", "named": "*"}


def main() -> int:
    """Run what is not done yet, then draw the map; returns 1 where a size failed."""
    options = _options()
    if options.today:
        return _today(options.today, options.date, options.workers)
    code = code_digest()
    if not options.plot:
        sizes = options.size or _open_sizes(code, options.only)
        for done in _made(sizes, options.workers, options.seconds):
            _append(done, code)
    rows = _newest()
    _draw_map(rows)
    _draw_used(rows)
    failed = [row for row in rows if row["failed"]]
    codes = len({row["code"] for row in rows})
    print(f"{len(rows)} sizes in {TABLE.name}, {len(failed)} failed, {codes} versions of the code")
    return int(bool(failed))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, prog="bench_sizes.py"
    )
    parser.add_argument("--seconds", type=float, default=600.0, help="start no size after so long (default: 600)")
    room = processes_with_room()
    parser.add_argument("--workers", type=int, default=room, help="processes (default: as cores and memory allow)")
    parser.add_argument("--only", choices=sorted(set(KINDS) - {"named"}), help="one kind of sizes")
    form = "D/T[/CLEARANCE][/OPTION=...]"
    parser.add_argument("--size", action="append", type=_named, default=[], metavar=form, help="a size of your own")
    parser.add_argument("--today", type=int, default=0, metavar="N", help="N sizes of the day's seed")
    parser.add_argument("--date", type=date.fromisoformat, default=date.today(), help="the day, YYYY-MM-DD")
    parser.add_argument("--plot", action="store_true", help="draw only")
    return parser.parse_args()


def _today(count: int, day: date, workers: int) -> int:
    """Sizes that no list holds, others every day, the last with options of its own; 1 where one failed."""
    status, seed = 0, day.toordinal()
    sizes = random_sizes(seed, count - 1, "today") + option_sizes(seed, 1, "today")
    for made in _made(sizes, workers, math.inf):
        print(f"{_words(made.size)}: {'; '.join(made.failed) or 'passed'}", flush=True)
        if made.failed:
            status = 1
            print(f"again: python bench/bench_sizes.py --today {count} --date {day}", file=sys.stderr)
    return status


def _named(text: str) -> Size:
    """A size of the command line.

    Raises:
        argparse.ArgumentTypeError: it is none, or lies outside the valid region.
    """
    words = text.split("/")
    numbers = [word for word in words if "=" not in word]
    try:
        if not 2 <= len(numbers) <= len(NUMBERS):
            form = "D/T or D/T/CLEARANCE, in mm, with /dots=1-6-10, /dot_mm=5, /gyroid=0.1 as you like"
            raise ParameterError(f"{text!r} is not of the form {form}")
        typed = [f"{name}={number}" for name, number in zip(NUMBERS, numbers, strict=False)]
        options = parse_options([*typed, *(word for word in words if "=" in word)], DEFAULTS)
        design, clearance = parse_design(options), parse_length("joint_clearance", options["joint_clearance"])
        size = Size(
            "named", design.diameter_mm, design.wall_mm, clearance, design.dot_rings, design.dot_mm, design.gyroid
        )
        size.layout  # noqa: B018 - refuses what cannot be made
    except EndcapError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return next((listed for listed in survey() if listed.key == size.key), size)  # which keeps its kind


def _open_sizes(code: str, only: str | None) -> list[Size]:
    older = older_digests()
    standing = [row for row in _rows() if row["code"] == code or (row["code"] in older and not row["failed"])]
    done = {_key(row) for row in standing}
    return [size for size in survey() if size.key not in done and only in (None, size.kind)]


def _made(sizes: list[Size], workers: int, seconds: float) -> Iterator[Made]:
    """The sizes, made side by side, each as it ends."""
    end = time.monotonic() + seconds
    context = multiprocessing.get_context("spawn")
    queue, running = iter(sizes), dict[Future[Made], ProcessPoolExecutor]()
    with ExitStack() as pools:
        # A pool each: one pool of many would start the next worker on a core where another still works.
        idle = [
            pools.enter_context(
                ProcessPoolExecutor(
                    1, context, _start_worker, (number, os.getpid()), max_tasks_per_child=TASKS_A_WORKER
                )
            )
            for number in range(workers)
        ]
        while True:
            while idle and time.monotonic() < end and (size := next(queue, None)) is not None:
                pool = idle.pop()
                running[pool.submit(make, size)] = pool
            if not running:
                return
            ended, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                idle.append(running.pop(future))
                yield future.result()


def _start_worker(number: int, parent: int) -> None:
    """End with the parent, and keep to a core: the mesh kernel's threads would wait for each other, burning time."""
    end_with_parent(parent)
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})


def _append(made: Made, code: str) -> None:
    size = made.size
    fresh = not TABLE.exists()
    with TABLE.open("a", newline="") as stream:
        writer = csv.writer(stream)
        if fresh:
            writer.writerow(HEADER)
        used = [f"{made.used[name]:.3f}" if name in made.used else "" for name in WATCHED]
        writer.writerow([size.kind, *size.key, code, f"{made.cpu_s:.1f}", made.checks, "; ".join(made.failed), *used])
    print(f"{_words(size)}: {'; '.join(made.failed) or 'passed'}", flush=True)


def _words(size: Size) -> str:
    diameter, wall, clearance, options = size.key
    return f"D={diameter} T={wall} clearance {clearance} {options}".rstrip()


def _key(row: dict[str, str]) -> tuple[str, ...]:
    return tuple(row[name] for name in KEY)


def _rows() -> list[dict[str, str]]:
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as stream:
        return list(csv.DictReader(stream))


def _newest() -> list[dict[str, str]]:
    """The last row of each size."""
    return list({_key(row): row for row in _rows()}.values())


def _draw_map(rows: list[dict[str, str]]) -> None:
    """Passed and failed over the valid region."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    diameters = np.linspace(*diameter_range_mm(), 600)
    limits = np.array([wall_range_mm(float(diameter)) for diameter in diameters])
    limits[~np.isfinite(limits)] = np.nan
    figure, axes = plt.subplots(figsize=(8, 5), dpi=120)
    axes.fill_between(diameters, limits[:, 0], limits[:, 1], color="0.92", label="valid region")
    small = 40 if len(rows) < 100 else 14
    for kind, marker in KINDS.items():
        for passed, color in ((True, "tab:green"), (False, "tab:red")):
            chosen = [row for row in rows if row["kind"] == kind and (not row["failed"]) == passed]
            if chosen:
                places = np.array([(float(row["D_mm"]), float(row["T_mm"])) for row in chosen])
                label = f"{kind}: {len(chosen)} {'passed' if passed else 'failed'}"
                axes.scatter(*places.T, s=small if passed else 60, marker=marker, color=color, label=label, lw=0)
    axes.set(xlabel="D, mm", ylabel="T, mm", title=f"{len(rows)} sizes made, through every gate of the export")
    axes.legend(loc="upper left", fontsize=8)
    figure.tight_layout()
    figure.savefig(HERE / "sizes.png")
    plt.close(figure)


def _draw_used(rows: list[dict[str, str]]) -> None:
    """How near each check came to its limit, one strip a check, one dot a size."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    made = [row for row in rows if row.get(WATCHED[0])]
    if not made:
        return
    figure, axes = plt.subplots(figsize=(8, 5), dpi=120)
    diameters = np.array([float(row["D_mm"]) for row in made])
    for line, name in enumerate(WATCHED):
        used = np.array([float(row[name] or "nan") for row in made])
        spread = np.random.default_rng(line).uniform(-0.3, 0.3, len(used))
        dots = axes.scatter(used, line + spread, c=diameters, s=5, lw=0, cmap="viridis")
    axes.axvline(1.0, color="tab:red", lw=1)
    axes.set(xlabel="share of the limit that is used (1: refused)", xlim=(0, 1.05), ylim=(len(WATCHED) - 0.5, -0.5))
    axes.set_yticks(range(len(WATCHED)), WATCHED, fontsize=8)
    axes.set_title(f"how near checks come to their limits, {len(made)} sizes")
    figure.colorbar(dots, label="D, mm")
    figure.tight_layout()
    figure.savefig(HERE / "sizes_used.png")
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
