"""Mutated configurations and damaged recordings given to ``python -m sensing.live``.

    python bench/bench_robust_files.py --cases 1000

Writes bench/robust_files.csv: how many of each, how many were bad, by which exit status they ended, time and memory of
the worst. Good is a documented exit status, one line an error, no traceback, no hang, and at most 1 GB.
"""

from __future__ import annotations

import argparse
import csv
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.robust.cases import Outcome, run_case
from bench.robust.inputs import prepare, write_inputs
from bench.robust.mutations import mutated_recording, mutated_text
from sensing.live.cli import main as live

HERE = Path(__file__).resolve().parent
LIMIT_S = 60.0
SAY_EVERY = 20
COLUMNS = ("kind", "cases", "bad", "status_0", "status_1", "status_2", "longest_s", "most_mb")
CONFIG = """\
model = "default"
weights = ""
method = "dots"
weight_n = 117.7

[[endcap]]
name = "endcap_0"
source = "SOURCE"
zero = "zero.npz"
contact_on_n = 0.8
contact_off_n = 0.5
diameter_mm = 130.0
wall_mm = 8.0
T_robot_endcap = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 5.0], [0.0, 0.0, 0.0, 1.0]]

[[endcap]]
name = "endcap_1"
source = "SOURCE"
"""


def configuration_case(seed: int, folder: Path) -> Outcome:
    """One mutated configuration, run for a moment."""
    rng, path = random.Random(seed), folder / f"{seed}.toml"
    text = CONFIG.replace("SOURCE", str(folder / "photos"))
    for _ in range(rng.randint(1, 2)):
        text = mutated_text(rng, text)
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    options = ["--config", str(path), "--no-page", "--seconds", "0.3"]
    return run_case(lambda: live(options), LIMIT_S, stdout=os.devnull)


def recording_case(seed: int, folder: Path) -> Outcome:
    """One damaged recording, checked or replayed."""
    rng, path = random.Random(seed), folder / f"{seed}.mcap"
    path.write_bytes(mutated_recording(rng, folder / "run.mcap"))
    options = ["--replay", str(path)]
    options += rng.choice((["--check"], ["--no-page", "--speed", "0", "--json"]))
    outcome = run_case(lambda: live(options), LIMIT_S, stdout=os.devnull)
    path.unlink()
    return outcome


KINDS = {"configuration": configuration_case, "recording": recording_case}


def fault_of(outcome: Outcome) -> str:
    """What is bad; an error is a single line."""
    errors = [line for line in outcome.text.splitlines() if line.startswith("sensing.live: ")]
    if outcome.status == 2 and len(outcome.text.splitlines()) - len(errors) > 1:
        return "more than a line"
    if outcome.status == 2 and len(errors) != 1:
        return "no line"
    return outcome.fault((0, 1, 2))


def cases(kind: str, count: int, workers: int, seed: int = 0) -> Iterator[tuple[Outcome, str]]:
    """(outcome, fault) of all cases of a kind, as they end."""
    prepare()
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(workers) as pool:
        folder = Path(name)
        write_inputs(folder, 5)
        for outcome in pool.map(lambda each: KINDS[kind](each, folder), range(seed, seed + count)):
            yield outcome, fault_of(outcome)


def row_of(kind: str, found: list[tuple[Outcome, str]]) -> list[object]:
    """A line of the table."""
    status = Counter(outcome.status for outcome, _ in found)
    longest, most = max(outcome.seconds for outcome, _ in found), max(outcome.most_mb for outcome, _ in found)
    bad = sum(bool(fault) for _, fault in found)
    return [kind, len(found), bad, *(status[k] for k in range(3)), f"{longest:.1f}", f"{most:.0f}"]


def main() -> int:
    """Runs and writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=1000, metavar="N", help="of each kind (1000)")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="at a time (2)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the first case (0)")
    parser.add_argument("--kind", choices=KINDS, action="append", help="only this one")
    options = parser.parse_args()
    rows = []
    for kind in options.kind or KINDS:
        found = []
        for number, (outcome, fault) in enumerate(cases(kind, options.cases, options.workers, options.seed)):
            found.append((outcome, fault))
            if fault:
                print(f"{kind} {options.seed + number}: {fault}\n{outcome.text[-3000:]}", file=sys.stderr, flush=True)
            if len(found) % SAY_EVERY == 0:
                print(*row_of(kind, found), flush=True)
        rows.append(row_of(kind, found))
        print(*rows[-1])
    with (HERE / "robust_files.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows([COLUMNS, *rows])
    return int(any(row[2] for row in rows))


if __name__ == "__main__":
    sys.exit(in_one_line(main))
