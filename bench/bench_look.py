"""How rendered frames look against photos of the real sensor, in numbers: no pixel of a photo is kept.

    python bench/bench_look.py PHOTO ...          # 640x480 photos of undeformed 130 x 8 mm sensors
    writes bench/look.csv and bench/look.png

Dots found by darkness, in three zones of distance to the picture's centre: their areas, the green value from their
centre outward, and how much centres differ. Ground: the median green value against distance, and red and blue over it.
Noise: what a blur of 1.5 px takes away where nothing is painted, and the spread in a black corner. Places: what a
calibration on the frame's own dots (:mod:`sensing.calibration.from_dots`) leaves over.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from cad.errors import EndcapError
from cad.params import EndcapParams
from sensing.calibration.dots import find_dots
from sensing.calibration.from_dots import calibrate_from_dots
from sensing.calibration.picture import read_image
from sensing.camera.nominal import nominal_mount
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import Paint, RenderSettings

HERE = Path(__file__).parent
PARAMS = EndcapParams(130, 8)
ZONES_PX = ((60, 150), (150, 240), (240, 320))
REACH = 14  # px round a dot
COLUMNS = ("picture", "zone_px", "dots", "area_px", "area_p10", "area_p90", "centre", "edge", "centre_spread")
COLUMNS += ("noise", "black_spread", "place_rms_px")
SEEDS = 3  # rendered frames


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
    """(4, n): distance to the centre, px, the median green value there, and red and blue over green."""
    blue, green, red = (image[..., k].astype(float) for k in range(3))
    rows, columns = np.mgrid[: green.shape[0], : green.shape[1]]
    ring = (np.hypot(rows - green.shape[0] / 2, columns - green.shape[1] / 2) / 10).astype(int)
    shares = [value / np.maximum(green, 1) for value in (red, blue)]
    return np.array([[10 * k + 5, *(np.median(v[ring == k]) for v in (green, *shares))] for k in range(35)]).T


def places(image: np.ndarray) -> np.ndarray:
    """(2, n): distance of every matched dot to the picture's centre, and to where the calibration puts it, px."""
    size = image.shape[1], image.shape[0]
    found = calibrate_from_dots(find_dots(image), PARAMS, size)
    away = np.linalg.norm(found.matched_px - np.array(size) / 2, axis=1)
    return np.array([away, np.linalg.norm(found.residual_px, axis=1)])


def zone_rows(name: str, image: np.ndarray) -> list[tuple]:
    """One row a zone."""
    found, (grain, black), (away, wrong) = dots(image), noise(image), places(image)
    rows = []
    for low, high in ZONES_PX:
        chosen = [dot for dot in found if low <= dot[0] < high]
        area = np.array([dot[1] for dot in chosen])
        profiles = np.array([dot[2] for dot in chosen])
        middle = profiles[:, :3].mean(axis=1)
        values = (np.median(area), *np.percentile(area, [10, 90]), np.median(middle), np.median(profiles.min(axis=1)))
        own = wrong[(low <= away) & (away < high)]
        rest = (*values, middle.std(), grain, black, np.sqrt((own**2).mean()))
        rows.append((name, f"{low}..{high}", len(chosen), *(round(float(v), 2) for v in rest)))
    return rows


def main() -> int:
    """Measure, print and write table and plot; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photos", nargs="*", metavar="PHOTO", help="of undeformed sensors, D = 130, T = 8")
    photos = parser.parse_args().photos
    if not photos:
        print("no photos of an undeformed sensor: nothing measured; name some on the command line")
        return 0  # `make bench` runs every script
    try:
        pictures = {Path(path).stem: read_image(path) for path in photos}
        for seed in range(SEEDS):
            settings = RenderSettings(seed=seed, paint=Paint(digit=str(seed)))
            pictures[f"rendered_{seed}"] = DomeRenderer(PARAMS, nominal_mount(PARAMS), settings).render().image_bgr
        rows = [row for name, image in pictures.items() for row in zone_rows(name, image)]
    except EndcapError as error:
        print(error, file=sys.stderr)
        return 2
    for row in rows:
        print(*row)
    with (HERE / "look.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    draw(pictures)
    return 0


def draw(pictures: dict[str, np.ndarray]) -> None:
    """Ground, dots and their places; photos in grey and rendered in colour."""
    figure, axes = plt.subplots(2, 4, figsize=(14, 6.8), constrained_layout=True)
    light, *profiles, tint, area, contrast, place = axes.ravel()
    for name, image in pictures.items():
        style = {"color": "C1", "zorder": 3} if name.startswith("rendered") else {"color": "0.45"}
        radius, green, red, blue = ground_profile(image)
        light.plot(radius, green, **style)
        lit = green > 30  # black has no colour
        tint.plot(radius[lit], red[lit], **style)
        tint.plot(radius[lit], blue[lit], "--", **style)
        found = dots(image)
        for axis, (low, high) in zip(profiles, ZONES_PX, strict=True):
            axis.plot(np.median([dot[2] for dot in found if low <= dot[0] < high], axis=0), **style)
        away = np.array([dot[0] for dot in found])
        values = np.array([(dot[1], 1 - dot[2][:3].mean() / dot[2][-1]) for dot in found])
        for axis, value in zip((area, contrast), values.T, strict=True):
            axis.plot(away, value, ".", markersize=4, **style)
        wrong = np.sort(places(image)[1])
        place.plot(wrong, 100 * np.arange(1, len(wrong) + 1) / len(wrong), **style)
    outward, from_dot = "from the picture's centre, px", "from the dot's centre, px"
    light.set(title="silicone between the dots", xlabel=outward, ylabel="green value", ylim=(0, 210))
    for axis, (low, high) in zip(profiles, ZONES_PX, strict=True):
        axis.set(title=f"dots {low} to {high} px out", xlabel=from_dot, ylabel="green value", ylim=(0, 210))
    tint.set(title="its red (line), blue (dashed)", xlabel=outward, ylabel="over green", ylim=(0, 2))
    area.set(title="size of each dot", xlabel=outward, ylabel="px", ylim=(0, 500))
    contrast.set(title="contrast of each dot", xlabel=outward, ylabel="1 - centre / surroundings", ylim=(0, 1))
    place.set(title="places of the dots", xlabel="off the calibrated pattern, px", ylabel="dots, %", xlim=(0, 6))
    light.plot([], [], color="0.45", label="photos")
    light.plot([], [], color="C1", label="rendered")
    light.legend()
    for axis in axes.ravel():
        axis.grid(alpha=0.3)
    figure.savefig(HERE / "look.png", dpi=80)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
