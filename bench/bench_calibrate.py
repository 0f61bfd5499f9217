"""What photos of the undeformed sensor say about lens, pupil height and dot pattern.

    python bench/bench_calibrate.py [PHOTO ...]     # 130 x 8 mm endcaps; default: ../shared/reference/photos, if there
    writes bench/calibrate_height.csv, bench/calibrate_rings.csv and bench/calibrate_height.png (numbers only)

Height: the pupil is held at heights from 0 to 35 mm and the rest fitted, once with the lens's k1, k2 free and once
held at the equisolid lens (-1/24, 1/1920). Rings: with the calibrated camera every matched dot is cast back on the
sphere; the table gives each ring's mean polar angle, and which number of equal steps its azimuths fit best.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from cad.dots import ring_count
from cad.errors import EndcapError
from cad.params import EndcapParams
from cad.pattern import step_deg
from sensing.calibration.dots import find_dots, pattern_points
from sensing.calibration.from_dots import Calibration, MountPrior, calibrate_from_dots
from sensing.calibration.picture import read_image
from sensing.camera.mount import MountedCamera

HERE = Path(__file__).parent
PHOTOS = HERE.parent.parent / "shared" / "reference" / "photos"
PARAMS = EndcapParams(130, 8)
STEP_DEG = step_deg(PARAMS.dot_rings)
HEIGHTS_MM = (0, 5, 10, 14, 17, 20, 25, 30, 35)
LENSES = {"k1, k2 free": ((1.0, 1.0), (-0.033, -0.007)), "equisolid": ((1e-6, 1e-6), (-1 / 24, 1 / 1920))}
HUBER_PX = 1.5


@dataclass(frozen=True)
class LensPrior(MountPrior):
    """About another lens than the module's.

    Attributes:
        k_centre: its distortion k1, k2.
    """

    k_centre: tuple[float, float] = (0.0, 0.0)

    def mean(self, start: MountedCamera, hold_lens: bool) -> np.ndarray:
        """As of any prior, with this lens.

        Args:
            start: the start camera. hold_lens: whether its lens is held.
        """
        vector = super().mean(start, hold_lens)
        vector[3:5] = self.k_centre
        return vector


def robust_cost(result: Calibration) -> float:
    """Sum of soft-L1 residuals in units of 1 px^2: a change of 1 is one standard deviation."""
    ratio = (result.residual_px / HUBER_PX) ** 2
    return float((2 * HUBER_PX**2 * (np.sqrt(1 + ratio) - 1)).sum())


def height_rows(name: str, found: np.ndarray, size: tuple[int, int]) -> list[tuple]:
    """One row a lens and height."""
    rows: list[tuple] = []
    for lens, (sigma, centre) in LENSES.items():
        for height in HEIGHTS_MM:
            prior = LensPrior(k=sigma, k_centre=centre, height_mm=1e-3, height_centre_mm=float(height))
            result = calibrate_from_dots(found, PARAMS, size, prior=prior)
            focal = result.values["f_px"][0] * 480 / size[1]
            quality = round(result.rms_px, 3), round(result.median_px, 3), round(robust_cost(result), 2)
            rows.append((name, lens, height, len(result.residual_px), *quality, round(focal, 1)))
    return rows


def ring_rows(name: str, found: np.ndarray, size: tuple[int, int]) -> list[tuple]:
    """One row a ring."""
    result = calibrate_from_dots(found, PARAMS, size)
    rings = pattern_points(PARAMS)[1][result.pattern_index]
    centre = np.array([0.0, 0.0, PARAMS.centre_height_mm])
    points = result.mounted.on_sphere(result.matched_px, centre, PARAMS.inner_radius_mm) - centre
    polar = np.degrees(np.arccos(points[:, 2] / PARAMS.inner_radius_mm))
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    rows: list[tuple] = []
    for ring in range(1, int(rings.max()) + 1):
        own = rings == ring
        if own.sum() < 3:
            continue
        fits = {count: abs(np.exp(1j * count * azimuth[own]).mean()) for count in range(4, 25)}
        best = min((c for c in fits if fits[c] > max(fits.values()) - 0.03), default=0)
        mean, error = float(polar[own].mean()), float(polar[own].std() / np.sqrt(own.sum()))
        pattern = (
            ring_count(PARAMS, ring),
            best,
            round(float(fits[ring_count(PARAMS, ring)]), 3),
            round(ring * STEP_DEG, 2),
        )
        rows.append((name, ring, int(own.sum()), *pattern, round(mean, 2), round(error, 2)))
    return rows


def write(name: str, columns: tuple[str, ...], rows: list[tuple]) -> None:
    """Table under bench/."""
    with (HERE / name).open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(columns)
        writer.writerows(rows)
    for row in rows:
        print(*row)


def main() -> int:
    """Run on the photos of the command line, else on those beside the repository; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", nargs="*", metavar="PHOTO", help="of undeformed sensors, D = 130, T = 8")
    here = [str(path) for path in sorted(PHOTOS.glob("*")) if path.suffix in (".jpg", ".jpeg", ".png")]
    photos = parser.parse_args().photos or here
    if not photos:
        print("no photos of an undeformed sensor: nothing measured; name some on the command line")
        return 0
    heights: list[tuple] = []
    rings: list[tuple] = []
    try:
        for path in photos:
            image = read_image(path)
            case = Path(path).stem, find_dots(image), (image.shape[1], image.shape[0])
            heights += height_rows(*case)
            rings += ring_rows(*case)
    except EndcapError as error:
        print(error, file=sys.stderr)
        return 2
    columns = ("photo", "lens", "height_mm", "dots", "rms_px", "median_px", "cost", "f_px_at_480_rows")
    write("calibrate_height.csv", columns, heights)
    columns = ("photo", "ring", "dots", "count", "best_count", "coherence", "polar_deg", "seen_polar_deg", "sem_deg")
    write("calibrate_rings.csv", columns, rings)
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for axis, lens in zip(axes, LENSES, strict=True):
        for photo in dict.fromkeys(row[0] for row in heights):
            chosen = [row for row in heights if row[0] == photo and row[1] == lens]
            axis.plot([row[2] for row in chosen], [row[4] for row in chosen], "o-", label=photo)
        axis.set(title=lens, xlabel="pupil height held, mm", ylabel="residual, px rms", ylim=(0, 6))
        axis.grid(alpha=0.3)
    axes[0].legend()
    figure.savefig(HERE / "calibrate_height.png", dpi=90)
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
