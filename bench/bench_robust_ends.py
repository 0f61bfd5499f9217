"""Random ends of ``python -m sensing.live``: any signal at any moment, with cameras that hang and full disks.

    python bench/bench_robust_ends.py --cases 1000 --workers 4

Writes bench/robust_ends.csv: how many of each kind, how many were bad, and how long an end took. Good is a documented
exit status, no traceback or abort, and a recording that can be read to its end.
"""

from __future__ import annotations

import argparse
import csv
import random
import signal
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.robust.cases import Outcome, run_case
from bench.robust.inputs import cameras, prepare, write_inputs
from cad.errors import EndcapError
from sensing.live.cli import main as live
from sensing.live.mcap_records import read_records

HERE = Path(__file__).resolve().parent
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LIMIT_S = 60.0
COLUMNS = ("kind", "cases", "bad", "median_end_s", "largest_end_s", "most_mb")


def arguments_of(
    rng: random.Random, urls: dict[str, str], inputs: Path, file: Path, only: str = ""
) -> tuple[str, list[str], str | None]:
    """(kind, options, path for standard output) of a case; ``only`` names its kind."""
    kind = rng.choice(("camera", "camera", "cameras", "hung", "photos", "replay", "json", "full"))
    kind = only or kind
    named = {"cameras": ("good", "good", "good"), "hung": ("good", "silent", "slow", "silent")}
    if kind == "photos":
        options = ["--photos", str(inputs / "photos"), "--rate", "30", "--speed", rng.choice(("0", "1"))]
    elif kind == "replay":
        options = ["--replay", str(inputs / "run.mcap"), "--speed", rng.choice(("0", "1"))]
    else:
        options = [word for name in named.get(kind, ("good",)) for word in ("--url", urls[name])]
    if rng.random() < 0.6:
        options += ["--record", str(file)]
    options += ["--port", "0"] if rng.random() < 0.15 else ["--no-page"]
    if kind in ("json", "full"):
        options.append("--json")
    if rng.random() < 0.2:
        options += ["--seconds", f"{rng.uniform(0.01, 1.0):.2f}"]
    return kind, options, "/dev/full" if kind == "full" else None


def one_case(seed: int, urls: dict[str, str], folder: Path, only: str = "") -> tuple[str, Outcome, str]:
    """(kind, outcome, fault) of a case; ``only`` names its kind."""
    rng, file = random.Random(seed), folder / f"{seed}.mcap"
    kind, options, stdout = arguments_of(rng, urls, folder, file, only)
    end = rng.choice(SIGNALS), rng.uniform(0.0, 2.0), rng.random() < 0.7
    outcome = run_case(lambda: live(options), LIMIT_S, end, stdout)
    early = tuple(128 + number for number in SIGNALS)
    fault = outcome.fault((0, 1, *early) if kind == "full" else (0, *early))
    if not fault and file.exists():
        try:
            for _ in read_records(file):
                pass
        except EndcapError as error:
            fault = "" if outcome.status in early else str(error)
        file.unlink()
    return kind, outcome, fault


def ends(cases: int, workers: int, seed: int = 0, only: str = "") -> Iterator[tuple[str, Outcome, str]]:
    """All cases, as they end.

    Args:
        cases: how many. workers: at a time. seed: of the first. only: kind; empty for all.
    """
    prepare()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_inputs(folder)
        with cameras() as urls, ThreadPoolExecutor(workers) as pool:
            seeds = range(seed, seed + cases)
            yield from pool.map(lambda each: one_case(each, urls, folder, only), seeds)


def main() -> int:
    """Runs and writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000, metavar="N", help="(1000)")
    parser.add_argument("--workers", type=int, default=4, metavar="N", help="at a time (4)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the first case (0)")
    parser.add_argument("--kind", default="", help="only this one, as hung: cameras that never answer or drip")
    parser.add_argument("--out", type=Path, default=HERE / "robust_ends.csv", help="(bench/robust_ends.csv)")
    options = parser.parse_args()
    rows: dict[str, list[tuple[Outcome, str]]] = defaultdict(list)
    for number, (kind, outcome, fault) in enumerate(ends(options.cases, options.workers, options.seed, options.kind)):
        rows[kind].append((outcome, fault))
        if fault:
            print(f"seed {options.seed + number}, {kind}: {fault}\n{outcome.text[-2000:]}", file=sys.stderr, flush=True)
    with options.out.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        for kind, found in sorted(rows.items()):
            times = [outcome.end_s for outcome, _ in found]
            bad, most = sum(bool(fault) for _, fault in found), max(outcome.most_mb for outcome, _ in found)
            row = [kind, len(found), bad, f"{np.median(times):.2f}", f"{max(times):.2f}", f"{most:.0f}"]
            print(*row)
            writer.writerow(row)
    return int(any(fault for found in rows.values() for _, fault in found))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
