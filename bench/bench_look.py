"""How rendered frames look against photos of the real sensor, in numbers.

    python bench/bench_look.py [PHOTO ...]          # 640x480 photos; default: ../shared/reference/photos, if there
    writes bench/look.csv and bench/look.png (numbers only, no pictures)

Dots found by darkness, in three zones of distance to the picture's centre: their areas, the green value from their
centre outward, and how much centres differ. Ground: the median green value against distance. Noise: what a blur of
1.5 px takes away where nothing is painted, and the spread in a black corner.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from cad.params import EndcapParams
from sensing.calibrate_picture import read_image
from sensing.camera_nominal import nominal_mount
from sensing.simulator.render import DomeRenderer
from sensing.simulator.render_settings import Paint, RenderSettings

HERE = Path(__file__).parent
PHOTOS = HERE.parent.parent / "shared" / "reference" / "photos"
PARAMS = EndcapParams(130, 8)
ZONES_PX = ((60, 150), (150, 240), (240, 320))
REACH = 14  # px round a dot
COLUMNS = ("picture", "zone_px", "dots", "area_px", "area_p10", "area_p90", "centre", "edge", "centre_spread")
COLUMNS += ("noise", "black_spread")


def green_and_ground(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Green channel, and what it is without dots."""
    return image[..., 1].astype(float), cv2.medianBlur(image[..., 1], 51).astype(float)


def dots(image: np.ndarray) -> list[tuple[float, float, np.ndarray]]:
    """(distance to the centre, area, median green value at 0, 1, ... px from the dot's centre) of every dark blob."""
    green, ground = green_and_ground(image)
    dark = ((green < 0.72 * ground) & (ground > 90)).astype(np.uint8)
    count, _, stats, centres = cv2.connectedComponentsWithStats(dark)
    rows, columns = np.mgrid[-REACH : REACH + 1, -REACH : REACH + 1]
    away = np.round(np.hypot(rows, columns)).astype(int)
    found = []
    for index in range(1, count):
        x, y = np.round(centres[index]).astype(int)
        inside = 20 < x < image.shape[1] - 20 and 20 < y < image.shape[0] - 20
        if inside and 60 < stats[index, cv2.CC_STAT_AREA] < 700:
            window = green[y - REACH : y + REACH + 1, x - REACH : x + REACH + 1]
            profile = np.array([np.median(window[away == k]) for k in range(REACH)])
            distance = float(np.hypot(x - image.shape[1] / 2, y - image.shape[0] / 2))
            found.append((distance, float(stats[index, cv2.CC_STAT_AREA]), profile))
    return found


def noise(image: np.ndarray) -> tuple[float, float]:
    """Green standard deviation above a blur of 1.5 px on bare silicone, and in the top left corner."""
    green, ground = green_and_ground(image)
    rest = green - cv2.GaussianBlur(green, (0, 0), 1.5)
    bare = cv2.erode(((green > 0.95 * ground) & (ground > 120)).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    return float(rest[bare].std()), float(green[:12, :12].std())


def ground_profile(image: np.ndarray) -> np.ndarray:
    """(2, n): distance to the centre, px, and the median green value there."""
    green = image[..., 1]
    rows, columns = np.mgrid[: green.shape[0], : green.shape[1]]
    ring = (np.hypot(rows - green.shape[0] / 2, columns - green.shape[1] / 2) / 10).astype(int)
    return np.array([[10 * k + 5, np.median(green[ring == k])] for k in range(35)]).T


def zone_rows(name: str, image: np.ndarray) -> list[tuple]:
    """One row a zone."""
    found, (grain, black) = dots(image), noise(image)
    rows = []
    for low, high in ZONES_PX:
        chosen = [dot for dot in found if low <= dot[0] < high]
        area = np.array([dot[1] for dot in chosen])
        profiles = np.array([dot[2] for dot in chosen])
        middle = profiles[:, :3].mean(axis=1)
        values = (np.median(area), *np.percentile(area, [10, 90]), np.median(middle), np.median(profiles.min(axis=1)))
        rest = (*values, middle.std(), grain, black)
        rows.append((name, f"{low}..{high}", len(chosen), *(round(float(v), 2) for v in rest)))
    return rows


def main() -> None:
    """Measure, print and write table and plot."""
    paths = [Path(p) for p in sys.argv[1:]] or sorted(PHOTOS.glob("*.jpg"))
    if not paths:
        print("no photos: name some", file=sys.stderr)
        return
    pictures = {path.stem: read_image(path) for path in paths}
    for seed in range(3):
        settings = RenderSettings(seed=seed, paint=Paint(digit=str(seed)))
        pictures[f"rendered_{seed}"] = DomeRenderer(PARAMS, nominal_mount(PARAMS), settings).render().image_bgr
    rows = [row for name, image in pictures.items() for row in zone_rows(name, image)]
    for row in rows:
        print(*row)
    with (HERE / "look.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    draw(pictures)


def draw(pictures: dict[str, np.ndarray]) -> None:
    """Ground and dot profiles, photos in grey and rendered in colour."""
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.6), constrained_layout=True)
    for name, image in pictures.items():
        style = {"color": "C1", "zorder": 3} if name.startswith("rendered") else {"color": "0.45"}
        axes[0].plot(*ground_profile(image), **style)
        found = dots(image)
        for axis, (low, high) in zip(axes[1:], ZONES_PX, strict=True):
            axis.plot(np.median([dot[2] for dot in found if low <= dot[0] < high], axis=0), **style)
            axis.set(title=f"dots {low} to {high} px out", xlabel="from the dot's centre, px", ylim=(0, 210))
    axes[0].set(title="ground", xlabel="from the picture's centre, px", ylabel="green value", ylim=(0, 210))
    axes[0].plot([], [], color="0.45", label="photos")
    axes[0].plot([], [], color="C1", label="rendered")
    axes[0].legend()
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.savefig(HERE / "look.png", dpi=80)


if __name__ == "__main__":
    main()
