"""Speed against error of all field methods, with known truth: writes bench/fields.csv and bench/fields.png.

    python bench/bench_fields.py            # 126 sequences a picture set, some minutes
    python bench/bench_fields.py --patterns 2 --methods dots,gelslim

Pictures: the photos of ``<folder above the repository>/shared/reference/photos`` when present (``--photos DIR`` for
others), and drawn dots always. Each is pressed by smooth bumps near the rim, shifts, turns and mixtures of 2 to 25 px
peak (at 480 px short side), ramped up in six frames or reached in one jump, then degraded: clean, mild, hard.

Truth: the exact mean displacement of each of the 30 x 30 cells. Time: JPEG bytes to field, CPU time of one thread
(so that other work on the machine hardly counts), all methods on the same frames in turn: the ratio to the released
pipeline travels between machines, the milliseconds do not.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from sensing.decode import decode_bgr
from sensing.methods import METHODS, DotField, field_method
from sensing.records import Frame, Image
from sensing.sources.degrade import LEVELS, degrade, random_degradation
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.files import PICTURES, read_picture
from sensing.sources.warp import Bump, Displacement, cell_truth, warp_image

HERE = Path(__file__).resolve().parent
RAMP = (1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0)
JUMP = (0.0, 1.0, 1.0, 0.0, -1.0, 0.0)  # a one-frame jump to the peak, back, and to the other side
SWAP_PX = 20.0  # at 480: a live dot further from its truth than this is another dot


@dataclass(frozen=True)
class Scene:
    """One frame with its truth."""

    frame: Frame
    displacement: Displacement
    first: bool


def random_pattern(kind: int, rng: np.random.Generator, size: tuple[int, int]) -> Displacement:
    """Bump near the rim (kinds 0 and 1), shift (2), turn (3) or a mixture (4); peak 2 to 25 px at 480."""
    scale = min(size) / 480.0
    peak, centre = rng.uniform(2, 25) * scale, (size[0] / 2 - 0.5, size[1] / 2 - 0.5)
    turn = rng.uniform(0, 2 * np.pi)
    along = (float(np.cos(turn)), float(np.sin(turn)))

    def bump(push: float) -> Bump:
        azimuth, radius, aim = rng.uniform(0, 2 * np.pi), rng.uniform(120, 260) * scale, rng.uniform(0, 2 * np.pi)
        place = (centre[0] + radius * np.cos(azimuth), centre[1] + radius * np.sin(azimuth))
        return Bump(place, (push * np.cos(aim), push * np.sin(aim)), rng.uniform(22, 42) * scale)

    spin = peak / (240 * scale) * rng.choice([-1, 1])
    if kind <= 1:
        return Displacement(pivot_px=centre, bumps=(bump(peak),))
    if kind == 2:
        return Displacement((peak * along[0], peak * along[1]), pivot_px=centre)
    if kind == 3:
        return Displacement(turn_rad=spin, pivot_px=centre)
    bumps = (bump(0.4 * peak), bump(0.4 * peak))
    return Displacement((0.3 * peak * along[0], 0.3 * peak * along[1]), 0.3 * spin, centre, bumps)


def sequence(picture: Image, kind: int, level: str, seed: int) -> Iterator[Scene]:
    """Six frames of one picture, pattern and level."""
    rng = np.random.default_rng(seed)
    size = (picture.shape[1], picture.shape[0])
    peak, damage = random_pattern(kind, rng, size), random_degradation(level, rng, size)
    steps = JUMP if seed % 3 == 0 else RAMP
    for index, share in enumerate(steps):
        now = peak.scaled(share)
        jpeg = degrade(warp_image(picture, now), damage, rng)
        yield Scene(Frame(index / 30, index, "bench", jpeg=jpeg, size=size), now, index == 0)


def pictures(photos: Path | None) -> dict[str, dict[str, Image]]:
    """{"photo": {name: picture}, "drawn": {...}}; no photo entry when there is no folder."""
    found: dict[str, dict[str, Image]] = {}
    if photos is not None and photos.is_dir():
        files = sorted(p for p in photos.iterdir() if p.suffix.lower() in PICTURES)
        found["photo"] = {p.stem: decode_bgr(read_picture(p)) for p in files}
    drawings = (Drawing(seed=1), Drawing(seed=2, turn_rad=1.1, centre_px=(315.0, 244.0), painted=0.9, digit="2"))
    found["drawn"] = {f"drawn_{d.seed}": draw_dots(d)[0] for d in drawings}
    return found


def run(methods: list[str], sets: dict[str, dict[str, Image]], patterns: int) -> list[dict[str, object]]:
    """One row per picture set, level and method."""
    collected: dict[tuple[str, str, str], dict[str, list]] = defaultdict(lambda: defaultdict(list))
    total = sum(len(s) for s in sets.values()) * len(LEVELS) * patterns
    done = 0
    for kind, images in sets.items():
        for name, image in images.items():
            reference = Frame(0, 0, name, jpeg=cv2.imencode(".jpg", image, [1, 95])[1].tobytes(),
                              size=(image.shape[1], image.shape[0]))  # fmt: skip
            for level in LEVELS:
                for pattern in range(patterns):
                    workers = {m: field_method(m, reference) for m in methods}
                    for scene in sequence(image, pattern % 5, level, seed=1000 * len(name) + pattern):
                        for method, worker in workers.items():
                            _measure(collected[kind, level, method], worker, scene)
                    done += 1
                    if sys.stderr.isatty():
                        print(f"\r{done}/{total} sequences", end="", file=sys.stderr)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    return _rows(collected)


def _measure(bag: dict[str, list], worker: object, scene: Scene) -> None:
    start = time.thread_time()
    field = worker.update(scene.frame)  # type: ignore[attr-defined]
    bag["ms"].append((time.thread_time() - start) * 1e3)
    size = scene.frame.size or (640, 480)
    error = np.linalg.norm(field.channels - cell_truth(scene.displacement, size), axis=0)
    bag["cells"].append(error.ravel())
    bag["valid"].append(field.valid.ravel())
    if isinstance(worker, DotField) and worker.tracks is not None:
        tracks, scale = worker.tracks, min(size) / 480.0
        truth = np.stack(scene.displacement.at(tracks.reference_px[:, 0], tracks.reference_px[:, 1]), axis=1)
        off = np.linalg.norm(tracks.displacement_px - truth, axis=1)[~tracks.lost] / scale
        bag["dots"].append(off)
        bag["lost"].append(tracks.lost.mean())
        bag["swaps"].append(int((off > SWAP_PX).sum()))


def _rows(collected: dict[tuple[str, str, str], dict[str, list]]) -> list[dict[str, object]]:
    groups = dict(collected)
    for kind in sorted({k for k, _, _ in collected}):  # all levels together
        for method in {m for _, _, m in collected}:
            merged: dict[str, list] = defaultdict(list)
            for level in LEVELS:
                for key, value in collected[kind, level, method].items():
                    merged[key] += value
            groups[kind, "all", method] = merged
    rows: list[dict[str, object]] = []
    for (kind, level, method), bag in sorted(groups.items()):
        cells, valid = np.concatenate(bag["cells"]), np.concatenate(bag["valid"])
        row: dict[str, object] = {
            "pictures": kind, "level": level, "method": method, "frames": len(bag["ms"]),
            "ms_median": round(float(np.median(bag["ms"])), 3), "ms_p95": round(float(np.percentile(bag["ms"], 95)), 3),
            "mean_px": round(float(cells.mean()), 4), "p95_px": round(float(np.percentile(cells, 95)), 4),
            "max_px": round(float(cells.max()), 2), "failed_percent": round(float((cells > 1).mean() * 100), 3),
            "failed_of_valid_percent": round(float((cells[valid] > 1).mean() * 100) if valid.any() else 0.0, 3),
            "valid_percent": round(float(valid.mean() * 100), 2),
        }  # fmt: skip
        if bag["dots"]:
            dots = np.concatenate(bag["dots"])
            row |= {"dot_mean_px": round(float(dots.mean()), 4), "dot_p95_px": round(float(np.percentile(dots, 95)), 4),
                    "dot_median_px": round(float(np.median(dots)), 4), "swaps": sum(bag["swaps"]),
                    "lost_percent": round(float(np.mean(bag["lost"]) * 100), 3)}  # fmt: skip
        rows.append(row)
    speed = {(r["pictures"], r["level"]): r["ms_median"] for r in rows if r["method"] == "gelslim"}
    for row in rows:
        base = speed.get((row["pictures"], row["level"]))
        row["time_over_released"] = round(row["ms_median"] / base, 4) if base else ""  # type: ignore[operator]
    return rows


def plot(rows: list[dict[str, object]], path: Path) -> None:
    """Error against time, one panel a picture set; marker area grows with failed cells."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    kinds = sorted({str(r["pictures"]) for r in rows}, reverse=True)
    figure, axes = plt.subplots(1, len(kinds), figsize=(5.4 * len(kinds), 4.4), squeeze=False, sharey=True)
    colours = dict(zip(METHODS, plt.rcParams["axes.prop_cycle"].by_key()["color"], strict=False))
    for axis, kind in zip(axes[0], kinds, strict=True):
        for row in rows:
            if row["pictures"] != kind:
                continue
            marker = {"clean": "o", "mild": "s", "hard": "^", "all": "*"}[str(row["level"])]
            axis.scatter(row["ms_median"], row["mean_px"], marker=marker, color=colours[str(row["method"])],
                         s=140 if marker == "*" else 35)  # fmt: skip
            if marker == "*":
                text = f"{row['method']} ({row['failed_percent']} % fail)"
                axis.annotate(text, (row["ms_median"], row["mean_px"]), xytext=(6, 6), textcoords="offset points",
                              fontsize=8)  # fmt: skip
        axis.set(xscale="log", yscale="log", xlabel="ms, JPEG to field, one core", title=f"{kind} pictures")
        axis.grid(True, which="both", alpha=0.25)
        axis.margins(0.25)
    axes[0][0].set_ylabel("mean error of a cell, px of the 200 x 200 crop")
    figure.suptitle("circle clean, square mild, triangle hard, star all; lower left is better", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> int:
    """Run, print, write CSV and plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = HERE.parent.parent / "shared" / "reference" / "photos"
    parser.add_argument("--photos", type=Path, default=default, help="folder of undeformed photos")
    parser.add_argument("--patterns", type=int, default=20, help="sequences per picture and level (default 20)")
    parser.add_argument("--methods", default=",".join(METHODS), help="comma-separated")
    parser.add_argument("--out", type=Path, default=HERE / "fields.csv")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows = run(options.methods.split(","), pictures(options.photos), options.patterns)
    columns = list(max(rows, key=len))
    with options.out.open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)
    plot(rows, options.out.with_suffix(".png"))
    for row in rows:
        print("  ".join(f"{key}={value}" for key, value in row.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
