"""Speed against error of all field methods, with known truth: writes bench/fields.csv and bench/fields.png.

    python bench/bench_fields.py            # 360 sequences of six frames with the photos; 10 minutes on a quiet core
    python bench/bench_fields.py --patterns 2 --methods dots,gelslim    # a part: its table goes to build/fields.csv
    python bench/bench_fields.py --parts build/fields     # keeps each picture's result there and resumes

Scenes: see field_scenes.py. Photos: ``<folder above the repository>/shared/reference/photos`` when present (``--photos
DIR`` for others). Time: JPEG bytes to field, CPU time of one thread (so that other work on the machine counts little),
all methods on the same frames in turn: the ratio to the released pipeline travels between machines, the milliseconds do
not; on a shared machine the 20th percentile is nearest to what a quiet one takes.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from field_scenes import LEVELS, PHOTOS, concatenated, measure, pictures, ready, reference_of, sequence, summary

from bench.one_line import in_one_line
from bench.parts import table_of
from bench.table_file import write_table
from sensing.records import Image
from sensing.tracking.methods import METHODS, field_method

PATTERNS = 20  # sequences a picture and level, of the published table
Bags = dict[tuple[str, str], dict[str, np.ndarray]]  # (level, method) -> arrays
MARKERS = {"clean": "o", "mild": "s", "hard": "^", "all": "*"}


def run_picture(image: Image, name: str, level: str, methods: list[str], patterns: int) -> Bags:
    """All patterns and methods on one picture at one level."""
    reference = reference_of(image, name)
    bags: dict[tuple[str, str], dict[str, list]] = defaultdict(lambda: defaultdict(list))
    for pattern in range(patterns):
        workers = {m: ready(field_method(m, reference), reference) for m in methods}
        for scene in sequence(image, pattern, level, seed=1000 * len(name)):
            for method, worker in workers.items():
                measure(bags[level, method], worker, scene)
        if sys.stderr.isatty():
            print(f"\r{name} {level} {pattern + 1}/{patterns}   ", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    return {key: concatenated(bag) for key, bag in bags.items()}


def run(sets: dict[str, dict[str, Image]], methods: list[str], patterns: int, parts: Path | None) -> dict[str, Bags]:
    """Results by picture set, all pictures of a set together."""
    collected: dict[str, dict[tuple[str, str], list[dict[str, np.ndarray]]]] = {}
    for kind, images in sets.items():
        collected[kind] = defaultdict(list)
        for (name, image), level in itertools.product(images.items(), LEVELS):
            file = parts / f"{name}_{level}_{patterns}_{'-'.join(methods)}.npz" if parts else None
            if file is not None and file.is_file():
                bags = _load(file)
            else:
                bags = run_picture(image, name, level, methods, patterns)
                if file is not None:
                    file.parent.mkdir(parents=True, exist_ok=True)
                    flat = {"/".join((*key, field)): v for key, bag in bags.items() for field, v in bag.items()}
                    part = file.with_suffix(".part.npz")
                    np.savez_compressed(part, **flat)
                    part.replace(file)  # what was interrupted is run again
            for key, bag in bags.items():
                collected[kind][key].append(bag)
    return {kind: {key: _together(bags) for key, bags in by_key.items()} for kind, by_key in collected.items()}


def _load(file: Path) -> Bags:
    bags: dict[tuple[str, str], dict[str, np.ndarray]] = defaultdict(dict)
    with np.load(file, allow_pickle=False) as data:
        for key in data.files:
            level, method, field = key.split("/")
            bags[level, method][field] = data[key]
    return dict(bags)


def _together(bags: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {field: np.concatenate([bag[field] for bag in bags]) for field in bags[0]}


def rows_of(results: dict[str, Bags]) -> list[dict[str, object]]:
    """One row per picture set, level ("all" too) and method, with the time over that of the released pipeline."""
    rows = []
    for kind, bags in results.items():
        methods = sorted({method for _, method in bags})
        every = {("all", m): _together([bags[level, m] for level in LEVELS]) for m in methods}
        for (level, method), bag in sorted((bags | every).items()):
            rows.append({"pictures": kind, "level": level, "method": method} | summary(bag))
    speed = {(r["pictures"], r["level"]): r["ms_median"] for r in rows if r["method"] == "gelslim"}
    for row in rows:
        base = speed.get((row["pictures"], row["level"]))
        row["time_over_released"] = round(row["ms_median"] / base, 4) if base else ""  # type: ignore[operator]
    return rows


def plot(rows: list[dict[str, object]], path: Path) -> None:
    """Error against time, one panel a picture set; the star is all levels together."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    kinds = list(dict.fromkeys(str(r["pictures"]) for r in rows))
    figure, axes = plt.subplots(1, len(kinds), figsize=(5.6 * len(kinds), 4.6), squeeze=False, sharey=True)
    colours = dict(zip(METHODS, plt.rcParams["axes.prop_cycle"].by_key()["color"], strict=False))
    for axis, kind in zip(axes[0], kinds, strict=True):
        for row in (r for r in rows if r["pictures"] == kind):
            whole, colour = row["level"] == "all", colours[str(row["method"])]
            text = f"{row['method']}: {row['ms_p20']:.1f} ms, {row['mean_px']:.3f} px, {row['failed_percent']:.2f} %"
            axis.scatter(row["ms_p20"], row["mean_px"], marker=MARKERS[str(row["level"])], color=colour,
                         s=190 if whole else 26, alpha=1 if whole else 0.5, label=text if whole else None)  # fmt: skip
        axis.set(xscale="log", yscale="log", xlabel="ms, JPEG to field, one thread (20th percentile)")
        axis.set_title(f"{kind} pictures")
        axis.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
        axis.minorticks_off()
        axis.grid(True, alpha=0.3)
        axis.legend(fontsize=7.5, title="time, mean error, cells off by over 1 px", title_fontsize=7.5)
    axes[0][0].set_ylabel("mean error of a cell, px of the 200 x 200 crop")
    figure.suptitle("star: all frames; circle clean, square mild, triangle hard; lower left is better", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=100)


def main() -> int:
    """Run, print, write CSV and plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--photos", type=Path, default=PHOTOS, help="folder of undeformed photos")
    parser.add_argument("--patterns", type=int, default=PATTERNS, help="sequences per picture and level (default 20)")
    parser.add_argument("--methods", default=",".join(METHODS), help="comma-separated")
    parser.add_argument("--only", default="", help="comma-separated names of pictures; nothing else is run")
    parser.add_argument("--parts", type=Path, help="folder for the results of each picture; those found are not run")
    parser.add_argument("--out", type=Path, help="table (bench/fields.csv of a whole run, else build/fields.csv)")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    sets = pictures(options.photos)
    if options.only:
        names = options.only.split(",")
        sets = {kind: {n: i for n, i in images.items() if n in names} for kind, images in sets.items()}
        sets = {kind: images for kind, images in sets.items() if images}
        if not sets:
            known = ", ".join(name for images in pictures(options.photos).values() for name in images)
            parser.error(f"--only {options.only!r} is no picture: choose from {known}")
    whole = not options.only and (options.patterns, options.methods) == (PATTERNS, ",".join(METHODS))
    out = options.out or table_of("fields.csv", whole)
    rows = rows_of(run(sets, options.methods.split(","), options.patterns, options.parts))
    write_table(out, rows)
    plot(rows, out.with_suffix(".png"))
    for row in rows:
        print("  ".join(f"{key}={value}" for key, value in row.items()))
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
