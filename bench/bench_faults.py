"""Fault injector: damaged, black, noisy, glaring, dirty, wrong-size frames of untouched endcaps through the pipeline.

python bench/bench_faults.py [--frames 10000] [--seed 1] [--out bench/faults.csv] [--resume]

Each fault lasts for one, two or ten frames between good ones: damage is made anew for every frame, light and dirt stay
where they are. Every fault has its own seed, so that ``--resume`` goes on where a table ends. A force over 0.5 N on
a frame that is neither flagged nor invalid is a miss, and the last line counts them. The pictures are those of the
simulated robot at rest (rendered once on a computer).
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from picture_faults import FAULTS, STAYS, Fault, Rng

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.demo.scene import SceneSource, scene_film
from sensing.records import Frame

ENDCAPS, LEAD, STEP_S = 6, 3, 1 / 30
LIMIT_N = 0.5
LENGTHS = (1, 2, 10)  # frames that a fault lasts
COLUMNS = {  # of the table: attribute of the counts
    "frames": "frames", "invalid": "invalid", "flagged": "flagged", "unflagged": "unflagged", "misses": "misses",
    "largest_unflagged_n": "largest_n", "largest_after_n": "after_n",
}  # fmt: skip


@dataclass
class Count:
    """What became of the frames of one kind of fault."""

    frames: int = 0
    invalid: int = 0
    flagged: int = 0
    unflagged: int = 0
    misses: int = 0
    largest_n: float = 0.0
    after_n: float = 0.0  # on the first good frame behind

    def take(self, reading: EndcapReading) -> None:
        """One frame of a fault."""
        force_n = float(np.linalg.norm(reading.wrench.force_n)) if reading.valid else 0.0
        self.frames += 1
        self.invalid += not reading.valid
        self.flagged += reading.valid and bool(reading.wrench.flags)
        if reading.valid and not reading.wrench.flags:
            self.unflagged += 1
            self.misses += force_n > LIMIT_N
            self.largest_n = max(self.largest_n, force_n)

    def behind(self, reading: EndcapReading) -> None:
        """The first good frame after a fault."""
        if reading.valid and not reading.wrench.flags:
            self.after_n = max(self.after_n, float(np.linalg.norm(reading.wrench.force_n)))


class Bench:
    """Six untouched endcaps, each with its reference."""

    def __init__(self) -> None:
        film, endcap = scene_film(), EndcapConfig("endcap_0", "scene:0")
        model = load_model("default", endcap.params)
        self.jpegs = [[bytes(film.jpeg(k, tick)) for tick in range(3)] for k in range(ENDCAPS)]
        self.pictures = [[cv2.imdecode(np.frombuffer(j, np.uint8), 1) for j in row] for row in self.jpegs]
        self.pipelines = [EndcapPipeline(endcap, model, None, k, 1) for k in range(ENDCAPS)]
        self.count = 0

    def send(self, endcap: int, data: bytes) -> EndcapReading:
        """One frame through the pipeline, its size read from the bytes as a source does."""
        from sensing.decode import jpeg_size

        self.count += 1
        reading = self.pipelines[endcap].update(
            Frame(self.count * STEP_S, self.count, SceneSource.__name__, jpeg=data, size=jpeg_size(data))
        )
        assert reading is not None
        return reading

    def run(self, fault: Fault, length: int, rng: Rng, count: Count) -> None:
        """One fault between good frames."""
        endcap = int(rng.integers(ENDCAPS))
        for k in range(LEAD):
            self.send(endcap, self.jpegs[endcap][k])
        seed = int(rng.integers(2**31))
        for k in range(length):  # the same draw for all frames of a fault of light or dirt: it stays where it is
            variant = int(rng.integers(3))
            stays = fault in STAYS
            own = np.random.default_rng(seed if stays else seed + k)
            picture = self.pictures[endcap][variant].astype(np.float32)
            count.take(self.send(endcap, fault(picture, self.jpegs[endcap][variant], own)))
        count.behind(self.send(endcap, self.jpegs[endcap][0]))


def table(counts: dict[str, Count]) -> list[dict[str, object]]:
    """Rows of the CSV."""
    return [
        {"fault": name.replace("_", " ")} | {key: _entry(getattr(c, field)) for key, field in COLUMNS.items()}
        for name, c in counts.items()
    ]


def _entry(value: float) -> object:
    return f"{value:.3f}" if isinstance(value, float) else value


def read_table(path: Path) -> dict[str, Count]:
    """Counts of a table that was written before."""
    with path.open(newline="", encoding="utf-8") as stream:
        return {
            row["fault"].replace(" ", "_"): Count(
                **{field: (float if key.endswith("_n") else int)(row[key]) for key, field in COLUMNS.items()}
            )
            for row in csv.DictReader(stream)
        }


def turns(frames: int) -> int:
    """How many faults so many frames are."""
    done = turn = 0
    while done < frames:
        done, turn = done + LENGTHS[turn // len(FAULTS) % len(LENGTHS)], turn + 1
    return turn


def main(arguments: list[str] | None = None) -> int:
    """Run and write the table; status 1 if there are misses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10_000, metavar="N", help="faulty frames in all (10000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of all faults (1)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="table as CSV")
    parser.add_argument("--resume", action="store_true", help="go on with the table of --out")
    options = parser.parse_args(arguments)
    counts = {fault.__name__: Count() for fault in FAULTS}
    if options.resume and options.out is not None and options.out.exists():
        counts = read_table(options.out)
    bench, done = Bench(), sum(c.frames for c in counts.values())
    for turn in range(turns(done), turns(options.frames)):
        fault, length = FAULTS[turn % len(FAULTS)], LENGTHS[turn // len(FAULTS) % len(LENGTHS)]
        misses = counts[fault.__name__].misses
        bench.run(fault, length, np.random.default_rng([options.seed, turn]), counts[fault.__name__])
        done += length
        if counts[fault.__name__].misses > misses:
            print(f"turn {turn}: {fault.__name__} for {length} frames: a miss", file=sys.stderr)
        if sys.stderr.isatty():
            print(f"\r{done}/{options.frames} frames ", end="", file=sys.stderr)
        if options.out is not None and (turn + 1) % len(FAULTS) == 0:
            write_table(options.out, table(counts))
    if options.out is not None:
        write_table(options.out, table(counts))
    for row in table(counts):
        print("  ".join(f"{value!s:>{max(len(key), 14)}}" for key, value in row.items()))
    misses = sum(c.misses for c in counts.values())
    print(f"{done} frames with faults, seed {options.seed}: {misses} with a force over {LIMIT_N} N and no flag")
    return 1 if misses else 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
