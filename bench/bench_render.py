"""Renderer quality against time and image error.

    python bench/bench_render.py          # writes bench/render.csv and bench/render.png

One pressed and bulged dome, without noise, tone curve and JPEG, at every level and along each knob alone; error is
the rms difference of light to the reference level (percent of the silicone's light at the tip), and the rms shift of
the rendered dots against it (px). The last rows give the whole frame (noise, sharpening, JPEG) per part of the chain.
"""

from __future__ import annotations

import argparse
import csv
import platform
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from cad.params import EndcapParams
from sensing.camera.mount import mount, rotation_matrix
from sensing.camera.nominal import nominal_lens
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import LEVELS, Paint, RenderSettings

HERE = Path(__file__).parent
PARAMS = EndcapParams(130, 8)
MOUNTED = mount(nominal_lens(), (0.4, -0.3, PARAMS.camera_height_mm), rotation_matrix([0.03, -0.02, 0.3]))
PAINT = Paint(clouds=0, specks=0)
COLUMNS = ("study", "name", "mesh", "texels", "supersample", "cell", "frame_ms", "light_error_pct", "dot_shift_px")


def field(points_mm: np.ndarray) -> np.ndarray:
    """A smooth bulge of 8 mm with a tangential part."""
    top = np.array([25.0, 15.0, 38.37 + 48.0])
    share = np.exp(-((np.linalg.norm(points_mm - top, axis=1) / 16) ** 2))
    return share[:, None] * 8.0 * np.array([-0.3, -0.5, -0.8])


def light_and_time(settings: RenderSettings, repeats: int) -> tuple[np.ndarray, float, DomeRenderer]:
    """Noise-free light, and the shortest CPU time of a frame in ms (other jobs only add)."""
    renderer = DomeRenderer(PARAMS, MOUNTED, settings)
    moved = field(renderer.surface_mm)
    light = renderer.radiance(moved)
    renderer.render(moved)
    times = []
    for number in range(repeats):
        start = time.process_time()
        renderer.render(moved, frame=number)
        times.append(1000 * (time.process_time() - start))
    return light, float(np.min(times)), renderer


def dot_centres(light: np.ndarray, near_px: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Centroids of darkness in windows about the true dots."""
    centres = np.full((len(near_px), 2), np.nan)
    for index in np.nonzero(visible)[0]:
        x, y = np.round(near_px[index]).astype(int)
        if not (12 <= x < light.shape[1] - 12 and 12 <= y < light.shape[0] - 12):
            continue
        window = light[y - 11 : y + 12, x - 11 : x + 12, 1]
        dark = np.maximum(np.median(window) * 0.8 - window, 0)
        rows, columns = np.mgrid[y - 11 : y + 12, x - 11 : x + 12]
        centres[index] = (dark * columns).sum() / dark.sum(), (dark * rows).sum() / dark.sum()
    return centres


def cases(base: RenderSettings) -> list[tuple[str, str, RenderSettings]]:
    """Every level, and each knob alone with the others far better."""
    rich = {"mesh": 128, "texels": 2048, "supersample": 2, "cell": 1}
    knobs = {
        "mesh": (16, 24, 32, 48, 64, 96, 128),
        "texels": (320, 480, 640, 960, 1280, 2048),
        "supersample": (1, 2, 3, 4),
    }
    found = [("level", name, base.at_level(name)) for name in LEVELS]  # type: ignore[arg-type]
    found += [(knob, str(n), replace(base, **{**rich, knob: n})) for knob, values in knobs.items() for n in values]
    return found + [("cell", str(n), replace(base, cell=n)) for n in (1, 2, 4, 8)]


def main() -> None:
    """Run the studies and write table and picture."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    cv2.setNumThreads(1)
    base = RenderSettings(seed=5, paint=PAINT)
    reference, _, renderer = light_and_time(base.at_level("reference"), 1)
    truth = renderer.render(field(renderer.surface_mm))
    centres = dot_centres(reference, truth.dots_px, truth.dots_visible)
    tip = float(np.median(reference[200:280, 280:360, 1]))
    rows = []
    for study, name, settings in cases(base):
        light, milliseconds, _ = light_and_time(settings, 3 if name == "reference" else 15)
        shift = np.linalg.norm(dot_centres(light, truth.dots_px, truth.dots_visible) - centres, axis=1)
        error = 100 * float(np.sqrt(np.mean((light - reference) ** 2))) / tip
        knobs = (settings.mesh, settings.texels, settings.supersample, settings.cell)
        measured = round(milliseconds, 2), round(error, 3), round(float(np.sqrt(np.nanmean(shift**2))), 4)
        rows.append((study, name, *knobs, *measured))
        print(*rows[-1])
    with (HERE / "render.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    draw(rows)
    print(f"one core of {platform.processor() or platform.machine()}, 640x480, CPU time")


def draw(rows: list[tuple]) -> None:
    """Time against error, one line a study."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for study in dict.fromkeys(row[0] for row in rows):
        chosen = [row for row in rows if row[0] == study and not (study == "level" and row[1] == "reference")]
        for axis, column in zip(axes, (7, 8), strict=True):
            axis.loglog([row[6] for row in chosen], [row[column] for row in chosen], "o-", label=study)
            if study == "level":
                for row in chosen:
                    axis.annotate(row[1], (row[6], row[column]), textcoords="offset points", xytext=(4, 4))
    for axis, label in zip(axes, ("light error, % of the tip's light (rms)", "dot shift, px (rms)"), strict=True):
        axis.set(xlabel="time a frame, ms (one core)", ylabel=label)
        axis.grid(True, which="both", alpha=0.3)
    axes[0].legend()
    figure.savefig(HERE / "render.png", dpi=90)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
