"""Cameras that mix their pictures, and what must not be taken for one: how many endcaps live flags, and how soon.

python bench/bench_mixed.py [--out bench/mixed.csv] [--seconds 6]

Rendered endcaps of three designs, each in pictures of another size with white noise of 0.5, 1.5 and 4 gray levels: nine
in all. Each is zeroed and then shown untouched at 30 Hz, raw and as JPEG, through the pipeline of live
(:mod:`sensing.live.core.mixed_watch`). What moves moves by first order: picture + shift * slope.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, islice, product
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.mixed_watch import FLAG
from sensing.live.core.model import LiveModel, live_model
from sensing.live.core.pipeline import ZERO_FRAMES, EndcapPipeline
from sensing.records import Frame, ShearField, Wrench
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings
from sensing.tracking.zero import take_zero

RATE_HZ = 30.0
DESIGNS = ((EndcapParams(130, 8), 480), (EndcapParams(107, 7.3), 240), (EndcapParams(200, 12), 720))  # and rows
NOISES, QUALITIES = (0.5, 1.5, 4.0), (0, 95, 85, 60)  # gray levels; of JPEG, 0 for raw pictures
MEANS, MORE = 16, 64  # renderings of which one without noise is the mean; room beside the picture for noise of others
TOUCH_PX, SHIFT_PX = 0.1, 0.05  # at 480 rows
COLUMNS = ("pictures", "quality", "endcaps", "flagged", "longest_s")
Picture = np.ndarray


@dataclass(frozen=True)
class Scene:
    """One endcap as its camera sees it, in gray values.

    Attributes:
        params: its design.
        still: (H, W, 3) without noise.
        touch, shift: (H, W, 3) what a light touch, and a shift along x, change in it.
        noise: (H + MORE, W + MORE, 3) white.
        seed: where in ``noise`` each picture's begins.
    """

    params: EndcapParams
    still: Picture
    touch: Picture
    shift: Picture
    noise: Picture
    seed: int

    def noises(self) -> Iterator[Picture]:
        """Of one picture after another."""
        rng, (rows, columns) = np.random.default_rng(self.seed), self.still.shape[:2]
        while True:
            y, x = rng.integers(0, MORE + 1, 2)
            sign = rng.choice((-1, 1))
            yield sign * self.noise[y : y + rows, x : x + columns]

    @property
    def rows(self) -> Picture:
        """(H, 1, 1) numbers of its rows."""
        return np.arange(len(self.still), dtype=np.float32)[:, None, None]


def scene(params: EndcapParams, rows: int, noise: float, seed: int) -> Scene:
    """Render one."""
    settings = replace(RenderSettings(seed=seed).at_level("draft"), fresh_noise=True)
    renderer = DomeRenderer(params, nominal_mount(params, rows * 4 // 3, rows), settings)
    pictures = [renderer.render(frame=k).image_bgr.astype(np.float32) for k in range(MEANS)]
    still, unit = np.mean(pictures, axis=0), rows / 480
    slope_y, slope_x = np.gradient(cv2.GaussianBlur(still, (0, 0), 0.7), axis=(0, 1))
    y, x = np.mgrid[0:rows, 0 : rows * 4 // 3]
    bump = np.exp(-((x - 0.6 * rows) ** 2 + (y - 0.4 * rows) ** 2) / (2 * (0.15 * rows) ** 2))[:, :, None]
    touch = TOUCH_PX * unit * bump * (slope_x + 0.4 * slope_y)
    white = np.random.default_rng(seed).normal(0, noise, (rows + MORE, rows * 4 // 3 + MORE, 3))
    shift = SHIFT_PX * unit * slope_x
    return Scene(params, *map(np.float32, (still, touch, shift, white)), seed=seed)


def alone(scene: Scene) -> Iterator[Picture]:
    """Each picture stands alone, as of a plain camera."""
    for noise in scene.noises():
        yield scene.still + noise


def held(part: float, whole: bool = True) -> Callable[[Scene], Iterator[Picture]]:
    """Each holds this part of the one before, kept in whole gray values or finer."""

    def pictures(scene: Scene) -> Iterator[Picture]:
        last = scene.still
        for picture in alone(scene):
            last = part * last + (1 - part) * picture
            last = np.rint(last) if whole else last
            yield last

    return pictures


def blended(scene: Scene) -> Iterator[Picture]:
    """Each is the mean of two."""
    last = scene.still
    for picture in alone(scene):
        yield (last + picture) / 2
        last = picture


def twice(scene: Scene) -> Iterator[Picture]:
    """Each is sent twice."""
    for picture in alone(scene):
        yield picture
        yield picture


def over_and_over(scene: Scene) -> Iterator[Picture]:
    """A film of three pictures, with a little noise of its own."""
    film = list(islice(alone(scene), 3))
    for k, noise in enumerate(scene.noises()):
        yield film[k % 3] + np.float32(0.3) * noise


def lamp(scene: Scene, factors: Iterator[Picture | float]) -> Iterator[Picture]:
    """The light changes by these factors."""
    for noise, factor in zip(scene.noises(), factors, strict=False):
        yield scene.still * np.float32(factor) + noise


def warming(scene: Scene) -> Iterator[Picture]:
    """The lamp gains 2 % a second."""
    return lamp(scene, (1 + 0.02 * k / RATE_HZ for k in count()))


def hunting(scene: Scene) -> Iterator[Picture]:
    """The exposure swings by 1 % in 1.3 s."""
    return lamp(scene, (1 + 0.01 * np.sin(2 * np.pi * k / 40) for k in count()))


def banded(scene: Scene) -> Iterator[Picture]:
    """Bands of 3 % run over the picture, as under a lamp that flickers."""
    return lamp(scene, (1 + 0.03 * np.sin(scene.rows * (480 / len(scene.still)) / 60 + 0.4 * k) for k in count()))


def shaking(scene: Scene) -> Iterator[Picture]:
    """The picture shakes by 0.05 px twice a second."""
    for k, picture in enumerate(alone(scene)):
        yield picture + np.float32(np.sin(2 * np.pi * 2 * k / RATE_HZ)) * scene.shift


def creeping(scene: Scene) -> Iterator[Picture]:
    """The picture creeps by 0.03 px a second."""
    for k, picture in enumerate(alone(scene)):
        yield picture + np.float32(0.03 * k / RATE_HZ / SHIFT_PX) * scene.shift


def breathing(scene: Scene) -> Iterator[Picture]:
    """Something touches with less than the contact threshold, every two seconds."""
    for k, picture in enumerate(alone(scene)):
        yield picture + np.float32(np.sin(2 * np.pi * 0.5 * k / RATE_HZ)) * scene.touch


CASES: dict[str, Callable[[Scene], Iterator[Picture]]] = {
    "holds a quarter of the one before": held(0.25),
    "holds half": held(0.5),
    "holds half, kept finer than gray values": held(0.5, False),
    "holds three quarters": held(0.75),
    "blended in pairs": blended,
    "independent": alone,
    "independent, each sent twice": twice,
    "three, over and over": over_and_over,
    "lamp warms by 2 % a second": warming,
    "exposure swings by 1 %": hunting,
    "bands of 3 %": banded,
    "shakes by 0.05 px at 2 Hz": shaking,
    "creeps by 0.03 px a second": creeping,
    "touched by 0.1 px at 0.5 Hz": breathing,
}


class Forceless:
    """A model that reads nothing: the flag does not depend on one."""

    def estimate(self, field: ShearField) -> Wrench:
        """No force."""
        return Wrench(field.time_s, np.zeros(3), np.zeros(3), "sphere", np.diag([1e-2] * 3 + [1e-4] * 3))


def flagged_after_s(scene: Scene, frames: Iterator[Frame], model: LiveModel) -> float | None:
    """Time from the reference to the first flagged reading; None where none is flagged."""
    params = scene.params
    endcap = EndcapConfig("endcap_0", "bench", diameter_mm=params.diameter_mm, wall_mm=params.wall_mm)
    zero = take_zero(list(islice(frames, ZERO_FRAMES)), endcap.name, params)
    pipeline = EndcapPipeline(endcap, model, zero)
    for frame in frames:
        reading = pipeline.update(frame)
        if reading is not None and FLAG in reading.wrench.flags:
            return frame.time_s
    return None


def sent(pictures: Iterator[Picture], quality: int, seconds: float) -> Iterator[Frame]:
    """As a camera sends them, with those of the reference before time 0."""
    for number, picture in enumerate(islice(pictures, ZERO_FRAMES + round(seconds * RATE_HZ))):
        gray_values, time_s = np.clip(np.rint(picture), 0, 255).astype(np.uint8), (number - ZERO_FRAMES) / RATE_HZ
        if quality:
            jpeg = cv2.imencode(".jpg", gray_values, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
            yield Frame(time_s, number, "bench", jpeg=jpeg, size=(gray_values.shape[1], gray_values.shape[0]))
        else:
            yield Frame(time_s, number, "bench", image=gray_values)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, metavar="FILE", help="table to write")
    parser.add_argument("--seconds", type=float, default=6.0, help="shown after the reference (default: 6)")
    options = parser.parse_args(arguments)
    model, rows = live_model("forceless", Forceless()), []
    scenes = [scene(*design, noise, 31 + k) for k, (design, noise) in enumerate(product(DESIGNS, NOISES))]
    for (name, pictures), quality in product(CASES.items(), QUALITIES):
        found = [flagged_after_s(each, sent(pictures(each), quality, options.seconds), model) for each in scenes]
        times_s = [after_s for after_s in found if after_s is not None]
        longest = f"{max(times_s):.1f}" if times_s else ""
        rows.append(dict(zip(COLUMNS, (name, quality, len(found), len(times_s), longest), strict=True)))
        print("  ".join(f"{key} {value}" for key, value in rows[-1].items()), flush=True)
    if options.out is not None:
        write_table(options.out, rows, COLUMNS)
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
