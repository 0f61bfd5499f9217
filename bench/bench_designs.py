"""Is an endcap of any size, with any dots, seen as the released one is? Dots found, camera calibrated, dots followed.

    python bench/bench_designs.py                   24 sizes with the released dots, 24 with dots of their own (5 min)
    python bench/bench_designs.py --count 6         fewer of each
    python bench/bench_designs.py --plot            the picture again from the table

Sizes are drawn over the whole valid region from a seed of their own. Each endcap is rendered with a camera mounted by
hand (a degree, half a millimetre, ten degrees about its axis), its rest picture goes through the command
``python -m sensing.calibrate``, and a dent that grows to 7 % of the radius is followed by the tracker that live uses.

Writes designs.csv (a row a design: dots in view, shares of them that calibration and tracker find, dots found that are
none, error of the azimuth and of the calibrated camera at the dots, the tracker's error) and designs.png beside this
file.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.parts import table_of
from bench.sizes import option_sizes, random_sizes
from cad.design_arguments import design_words
from cad.params import EndcapParams
from cad.pattern import rings_text
from sensing.calibrate import main as calibrate
from sensing.calibration.dots import find_blobs, pattern_points
from sensing.camera.dot_look import dot_look
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import camera_at, camera_vector
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.tracking.tracker import DotTracker

HERE = Path(__file__).parent
TABLE = HERE / "designs.csv"
COUNT = 24  # sizes of each kind
SEED = 2026
COLUMNS = ("D_mm", "T_mm", "dots", "dot_mm", "dot_px", "in_view", "calibration_found", "tracker_found", "strays",
           "status", "azimuth_error_deg", "camera_error_px", "tracker_error_px")  # fmt: skip
RELEASED_DOT_PX = 18.0  # M: of 480, on the released photos
NEAR_PX = 5.0  # of a dot's place, and a sixth of its diameter more: hand-painted dots lie beside it
DEPTHS = (0.01, 0.03, 0.05, 0.07)  # of a dent, over the inner radius
WIDTH = 0.3  # of it


@dataclass(frozen=True)
class Scene:
    """One rendered endcap, its camera, and its dots (n, 3) in the endcap frame, mm."""

    params: EndcapParams
    mounted: MountedCamera
    renderer: DomeRenderer
    points: np.ndarray

    @staticmethod
    def of(params: EndcapParams, seed: int) -> Scene:
        """An endcap whose camera was mounted by hand."""
        rng = np.random.default_rng(seed)
        start = nominal_mount(params)
        turn = [*rng.normal(size=2), rng.uniform(-10, 10)]
        off = [*rng.normal(0, (2, 3, 3)), 0, 0, *np.radians(turn), *rng.normal(0, 0.4, 3)]
        mounted = camera_at(camera_vector(start) + np.array(off), start)
        settings = RenderSettings(seed=seed).at_level("data")
        return Scene(params, mounted, DomeRenderer(params, mounted, settings), pattern_points(params)[0])

    def dent(self, points: np.ndarray, depth: float) -> np.ndarray:
        """Displacements (n, 3) of a smooth dent 20 degrees from the tip that also drags the skin aside."""
        radius, axis = self.params.inner_radius_mm, np.array([np.sin(0.35), 0.0, np.cos(0.35)])
        top = radius * axis + [0, 0, self.params.centre_height_mm]
        share = np.exp(-((np.linalg.norm(points - top, axis=1) / (WIDTH * radius)) ** 2))
        return depth * radius * share[:, None] * (np.array([0.0, 0.5, 0.0]) - axis)


def main() -> int:
    """Measure, write the table, draw it; returns 1 where a calibration failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=COUNT, help=f"sizes of each kind ({COUNT})")
    parser.add_argument("--plot", action="store_true", help="draw the table that is there")
    options = parser.parse_args()
    path = table_of(TABLE.name, options.plot or options.count == COUNT)
    if not options.plot:
        sizes = [*random_sizes(SEED, options.count), *option_sizes(SEED + 1, options.count)]
        rows = []
        for number, size in enumerate(sizes):
            rows.append(measured(Scene.of(size.params, SEED + number)))
            print(dict(zip(COLUMNS, rows[-1], strict=True)), flush=True)
        with path.open("w", newline="") as stream:
            csv.writer(stream).writerows([COLUMNS, *rows])
    with path.open(newline="") as stream:
        table = list(csv.DictReader(stream))
    draw(table, path.with_suffix(".png"))
    failed = [row for row in table if row["status"] != "0"]
    print(f"{len(table)} designs, {len(failed)} not calibrated")
    return int(bool(failed))


def measured(scene: Scene) -> tuple:
    """One row of the table."""
    params, look = scene.params, dot_look(scene.params)
    rest = scene.renderer.render(None, frame=1).image_bgr
    seen = scene.mounted.project(scene.points[scene.mounted.sees(scene.points)])
    dot_px = RELEASED_DOT_PX * look.scale
    margin = dot_px / 2
    inside = seen[((seen > margin) & (seen < np.array([639, 479]) - margin)).all(axis=1)]
    centres = find_blobs(rest, params)[0]
    tracker = DotTracker(Frame(0.0, 0, "rest", image=rest), params=params)
    near = NEAR_PX + dot_px / 6
    shares = [float((_nearest(inside, dots) < near).mean()) for dots in (centres, tracker.reference_px)]
    strays = int((_nearest(tracker.reference_px, seen) > near).sum())
    status, azimuth, camera = _calibrated(scene, rest)
    return (
        params.diameter_mm, params.wall_mm, rings_text(params.dot_rings), params.dot_mm, round(dot_px, 1), len(inside),
        *(round(share, 3) for share in shares), strays, status, *_shown(azimuth, camera, followed(scene, tracker)),
    )  # fmt: skip


def followed(scene: Scene, tracker: DotTracker) -> float:
    """Median error of the motion of dots in a growing dent, px."""
    places, errors = scene.mounted.project(scene.points), []
    known = np.nan_to_num(places, nan=1e6)
    dots = np.linalg.norm(tracker.reference_px[:, None] - known[None], axis=-1).argmin(axis=1)
    for number, depth in enumerate(DEPTHS):
        pressed = scene.renderer.render(scene.dent(scene.renderer.surface_mm, depth), frame=2 + number).image_bgr
        tracks = tracker.update(Frame(0.0, number, "pressed", image=pressed))
        moved = scene.mounted.project(scene.points[dots] + scene.dent(scene.points[dots], depth)) - places[dots]
        errors.append(np.linalg.norm(tracks.displacement_px - moved, axis=1)[~tracks.lost])
    return float(np.nanmedian(np.concatenate(errors)))


def _calibrated(scene: Scene, image: np.ndarray) -> tuple[int, float, float]:
    """(status of the command, error of the azimuth in degrees, median error of the camera at the dots in px)."""
    with tempfile.TemporaryDirectory() as name:
        photo, out = Path(name) / "rest.png", Path(name) / "camera.json"
        cv2.imwrite(str(photo), image)
        status = calibrate(["--photo", str(photo), "--out", str(out), *design_words(scene.params)])
        if status:
            return status, float("nan"), float("nan")
        found = MountedCamera.load(out)
    azimuth = np.degrees(camera_vector(found)[7] - camera_vector(scene.mounted)[7])
    points = scene.points[scene.mounted.sees(scene.points)]
    away = np.linalg.norm(found.project(points) - scene.mounted.project(points), axis=1)
    return 0, float(azimuth), float(np.median(away))


def _nearest(places: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.linalg.norm(places[:, None] - others[None], axis=-1).min(axis=1)


def _shown(*values: float) -> list[str]:
    return [f"{value:.4g}" for value in values]


def draw(table: list[dict[str, str]], path: Path) -> None:
    """Shares found, error of the camera and of the tracker over the size of a dot in the picture."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), constrained_layout=True)
    released = np.array([row["dots"] == "1-6-10-12-16-18-20" and float(row["dot_mm"]) == 4 for row in table])
    size = np.array([float(row["dot_px"]) for row in table])
    shown = (
        (0, "calibration_found", "dots found by calibration"),
        (1, "camera_error_px", "calibrated camera off, px at 480 rows"),
        (2, "tracker_error_px", "tracker off, px at 480 rows"),
    )
    for number, column, label in shown:
        value = np.array([float(row[column]) for row in table])
        for mask, words in ((released, "released dots"), (~released, "dots of their own")):
            axes[number].plot(size[mask], value[mask], "o", label=words, alpha=0.7)
        axes[number].set(xlabel="a dot's diameter in the picture, px", ylabel=label, ylim=(0, None))
    axes[0].legend()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
