"""What each knob of the field methods costs and buys: writes bench/fields_knobs.csv and bench/fields_knobs.png.

    python bench/bench_fields_knobs.py            # some minutes
    python bench/bench_fields_knobs.py --patterns 1 --knobs window,iterations

One knob at a time leaves its default, on the scenes of field_scenes.py (one photo when there are photos, and one
rendered frame). Time is CPU time of one thread, JPEG to field, as 20th percentile over the frames: what a quiet machine
takes; all values of a knob see the same frames one after another.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import cv2

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from field_scenes import LEVELS, PHOTOS, Scene, concatenated, measure, pictures, ready, reference_of, sequence, summary

from bench.one_line import in_one_line
from bench.parts import table_of
from bench.table_file import write_table
from sensing.records import Frame
from sensing.tracking.baselines import DisField, FarnebackField, LucasKanadeField
from sensing.tracking.methods import DotField, FieldMethod
from sensing.tracking.tracker import TrackerConfig

PATTERNS = 5  # sequences a picture and level, of the published table
SHAPE = (30, 30)
DOT_KNOBS: dict[str, tuple[float, ...]] = {
    "short_side_px": (100, 200, 480),
    "window": (0.45, 0.55, 0.7, 0.85, 1.0),
    "iterations": (2, 3, 4, 6, 10, 20),
    "stop_px": (0.005, 0.01, 0.02, 0.05, 0.15),
    "length_px": (40, 60, 80, 100, 120, 160),
    "noise": (0.0005, 0.002, 0.005, 0.02, 0.1),
    "least_quality": (0.5, 0.6, 0.7, 0.8),
    "sure_quality": (0.75, 0.85, 0.9, 0.95),
    "restart_share": (0.05, 0.15, 0.3, 0.5),
}
Maker = Callable[[Frame, float], FieldMethod]


def _dots(knob: str) -> Maker:
    kind = int if knob in ("short_side_px", "iterations") else float
    return lambda reference, value: DotField(reference, TrackerConfig(**{knob: kind(value)}))


def _farneback(place: int) -> Maker:
    def make(reference: Frame, value: float) -> FieldMethod:
        flow: list[float] = [0.5, 3, 45, 3, 5, 1.2, 0]
        flow[place] = int(value)
        return FarnebackField(reference, SHAPE, tuple(flow))  # type: ignore[arg-type]

    return make


KNOBS: dict[str, tuple[tuple[float, ...], Maker, float]] = {
    knob: (values, _dots(knob), float(getattr(TrackerConfig(), knob))) for knob, values in DOT_KNOBS.items()
} | {
    "farneback levels": ((1, 2, 3, 4), _farneback(1), 3),
    "farneback window": ((15, 25, 45, 65), _farneback(2), 45),
    "farneback iterations": ((1, 2, 3, 5), _farneback(3), 3),
    "dis preset": ((0, 1, 2), lambda r, v: DisField(r, SHAPE, preset=int(v)), 0),
    "dis short_side_px": ((100, 200, 400), lambda r, v: DisField(r, SHAPE, short_side_px=int(v)), 200),
    "lk window": ((9, 15, 21, 31), lambda r, v: LucasKanadeField(r, SHAPE, window=int(v)), 15),
    "lk levels": ((0, 1, 2, 3), lambda r, v: LucasKanadeField(r, SHAPE, levels=int(v)), 2),
}


def scenes(photos: Path | None, patterns: int) -> list[tuple[Frame, list[Scene]]]:
    """(reference, its six scenes) for every sequence of the first 640 x 480 picture of each set."""
    found = []
    for images in pictures(photos).values():
        name = next(iter(images))
        reference = reference_of(images[name], name)
        for level in LEVELS:
            found += [
                (reference, list(sequence(images[name], p, level, seed=1000 * len(name)))) for p in range(patterns)
            ]
    return found


def run(knob: str, sequences: list[tuple[Frame, list[Scene]]]) -> list[dict[str, object]]:
    """One row per value."""
    values, make, default = KNOBS[knob]
    rows = []
    for value in values:
        bag: dict[str, list] = defaultdict(list)
        for reference, six in sequences:
            worker = ready(make(reference, value), reference)
            for scene in six:
                measure(bag, worker, scene)
        rows.append({"knob": knob, "value": value, "default": value == default} | summary(concatenated(bag)))
        print("  ".join(f"{k}={v}" for k, v in rows[-1].items()), flush=True)
    return rows


def plot(rows: list[dict[str, object]], path: Path) -> None:
    """One panel a knob: error and failed cells to the left, time to the right; the default stands in brackets."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    knobs = list(dict.fromkeys(str(r["knob"]) for r in rows))
    across = 4
    down = -(-len(knobs) // across)
    figure, axes = plt.subplots(down, across, figsize=(3.7 * across, 2.7 * down), squeeze=False)
    for axis in axes.flat[len(knobs) :]:
        axis.axis("off")
    for axis, knob in zip(axes.flat, knobs, strict=False):
        mine = [r for r in rows if r["knob"] == knob]
        x = list(range(len(mine)))
        axis.plot(x, [r["mean_px"] for r in mine], "o-", color="tab:blue")
        axis.plot(x, [float(str(r["failed_percent"])) / 10 for r in mine], "s--", color="tab:red", markersize=4)
        twin = axis.twinx()
        twin.plot(x, [r["ms_p20"] for r in mine], "^-", color="tab:green", markersize=4)
        twin.set_ylim(bottom=0)
        axis.set_ylim(bottom=0)
        axis.set_xticks(x, [f"[{r['value']:g}]" if r["default"] else f"{r['value']:g}" for r in mine], fontsize=7)
        axis.set_title(knob, fontsize=9)
        axis.tick_params(labelsize=7)
        twin.tick_params(labelsize=7)
    figure.suptitle(
        "blue: mean error of a cell, px of the 200 x 200 crop; red: failed cells (0.01 is 0.1 %);"
        " green, right axis: ms a frame; in brackets: the default",
        fontsize=9,
    )
    figure.tight_layout()
    figure.savefig(path, dpi=85)


def main() -> int:
    """Run, print, write CSV and plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=Path, default=PHOTOS, help="folder of undeformed photos")
    parser.add_argument("--patterns", type=int, default=PATTERNS, help="sequences per picture and level (default 5)")
    parser.add_argument("--knobs", default=",".join(KNOBS), help="comma-separated")
    parser.add_argument("--out", type=Path, help="table (bench/fields_knobs.csv of a whole run, else one in build/)")
    options = parser.parse_args()
    for knob in set(options.knobs.split(",")) - set(KNOBS):
        parser.error(f"--knobs {knob!r} is no knob: choose from {', '.join(KNOBS)}")
    whole = (options.patterns, options.knobs) == (PATTERNS, ",".join(KNOBS))
    out = options.out or table_of("fields_knobs.csv", whole)
    cv2.setNumThreads(1)
    sequences = scenes(options.photos, options.patterns)
    rows = [row for knob in options.knobs.split(",") for row in run(knob, sequences)]
    write_table(out, rows)
    plot(rows, out.with_suffix(".png"))
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
