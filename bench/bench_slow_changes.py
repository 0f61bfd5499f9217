"""Changes of a working day: lamp, focus, haze, dust, a drop, a warm lens; what live reads, states and flags.

python bench/bench_slow_changes.py [--out bench/slow_changes.csv]

Each of the six endcaps of the simulated robot is zeroed. Then one change grows from step to step: at each the endcap is
left untouched for 3.5 s and, the three that stand, carries its heaviest load (45 to 52 N) for 1 s, with the change in
every picture. An error is the difference from the reading of the same state without the change. ``sds`` is the error
over the stated standard deviation of its axis, ``sds_alone`` the same without what the untouched endcap reads
(:mod:`sensing.live.core.rest_offset`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.frames import T_sphere_endcap, inverse, wrench_adjoint
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import LiveModel, load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.demo.scene import scene_film
from sensing.records import Frame
from sensing.tracking.zero import take_zero

ENDCAPS, RATE_HZ, NOISE = 6, 6.0, 1.5  # the filter and the means need no more frames a second; noise in gray levels
REST_FRAMES, LOAD_FRAMES, ZERO_FRAMES, VARIANTS = 21, 6, 10, 3
ENDCAP = EndcapConfig("endcap_0", "scene:0")
TO_ENDCAP = wrench_adjoint(inverse(T_sphere_endcap(ENDCAP.params)))
Y, X = np.mgrid[0:480, 0:640].astype(np.float32)
Picture = np.ndarray
Change = Callable[[Picture, float, np.random.Generator], Picture]


def one_side_dims(picture: Picture, part: float, _: np.random.Generator) -> Picture:
    """The lamp of one side loses this part of its light."""
    near = np.exp(-((X - 560) ** 2 + (Y - 240) ** 2) / (2 * 140**2))
    return picture * (1 - part * near)[:, :, None]


def lamp_gradient(picture: Picture, part: float, _: np.random.Generator) -> Picture:
    """The light changes by this part from the middle to a corner."""
    return picture * (1 + part * (X - 320) / 400)[:, :, None]


def all_dim(picture: Picture, part: float, _: np.random.Generator) -> Picture:
    """All LEDs lose this part of their light; the exposure is fixed."""
    return picture * (1 - part)


def haze(picture: Picture, part: float, _: np.random.Generator) -> Picture:
    """This part of the picture's light is a veil."""
    return picture * (1 - part) + part * 140


def haze_one_side(picture: Picture, part: float, _: np.random.Generator) -> Picture:
    """A veil that grows from one side of the picture to the other."""
    veil = part * np.clip((X - 100) / 440, 0, 1)[:, :, None]
    return picture * (1 - veil) + veil * 140


def dust(picture: Picture, part: float, rng: np.random.Generator) -> Picture:
    """Forty blurred spots that take this part of the light."""
    light = np.ones_like(X)
    for _ in range(40):
        x, y, size = rng.uniform(60, 580), rng.uniform(0, 480), rng.uniform(6, 18)
        light *= 1 - part * np.exp(-((X - x) ** 2 + (Y - y) ** 2) / (2 * size**2))
    return picture * light[:, :, None]


def defocus(picture: Picture, radius_px: float, _: np.random.Generator) -> Picture:
    """Blur by a disc."""
    reach = int(np.ceil(radius_px))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.clip(radius_px + 0.5 - np.hypot(x, y), 0, 1)
    return cv2.filter2D(picture, -1, (disc / disc.sum()).astype(np.float32), borderType=cv2.BORDER_REFLECT)


def drop(picture: Picture, shift_px: float, rng: np.random.Generator) -> Picture:
    """A drop on the lens shifts what lies behind it, within 70 px, by so much at most."""
    x, y = rng.uniform(150, 490), rng.uniform(80, 400)
    shift = shift_px * np.exp(-((X - x) ** 2 + (Y - y) ** 2) / (2 * 70.0**2))
    return cv2.remap(picture, (X + shift).astype(np.float32), Y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def zoom(picture: Picture, part: float, _: np.random.Generator) -> Picture:
    """The picture grows by this part, as of a lens that warms."""
    move = np.array([[1 + part, 0, -part * 320], [0, 1 + part, -part * 240]])
    return cv2.warpAffine(picture, move, (640, 480), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


STEPS: dict[Change, tuple[str, tuple[float, ...]]] = {  # unit and levels
    one_side_dims: ("part", (0.2, 0.4, 0.6, 0.8)),
    lamp_gradient: ("part", (0.1, 0.2, 0.4, 0.6)),
    all_dim: ("part", (0.2, 0.4, 0.6, 0.8)),
    haze: ("part", (0.2, 0.4, 0.6, 0.8)),
    haze_one_side: ("part", (0.2, 0.4, 0.6, 0.8)),
    dust: ("part", (0.05, 0.1, 0.2, 0.3)),
    defocus: ("px", (1.0, 2.0, 3.0, 4.0)),
    drop: ("px", (0.1, 0.2, 0.4, 0.8)),
    zoom: ("part", (0.0001, 0.0002, 0.0004, 0.0008)),
}


@dataclass(frozen=True)
class Read:
    """What live reads of one endcap in one state.

    Attributes:
        force_n: (3,) filtered.
        sd_n, sd_alone_n: (3,) standard deviations, as stated and without the offset at rest.
        flagged: whether it has a flag, or no number at all.
    """

    force_n: np.ndarray
    sd_n: np.ndarray
    sd_alone_n: np.ndarray
    flagged: bool


class Worn:
    """One endcap under one change that grows.

    Args:
        endcap: number in the scene.
        model: estimates the wrench.
        change: what changes.

    Attributes:
        carries: whether it ever carries a load.
    """

    def __init__(self, endcap: int, model: LiveModel, change: Change) -> None:
        film = scene_film()
        self._endcap, self._change, self._rng, self._count = endcap, change, np.random.default_rng(endcap), 0
        loads_n = [float(np.linalg.norm(film.truth(endcap, tick)[:3])) for tick in range(film.ticks)]
        heaviest = int(np.argmax(loads_n))
        self.carries = loads_n[heaviest] > 1.0
        self._rest, self._load = (
            [_decoded(film.jpeg(endcap, (first + k) % film.ticks)) for k in range(VARIANTS)] for first in (0, heaviest)
        )
        frames = [self._frame(self._rest[k % VARIANTS]) for k in range(ZERO_FRAMES)]
        self._pipeline = EndcapPipeline(ENDCAP, model, take_zero(frames, "endcap_0", ENDCAP.params), endcap)

    def at(self, level: float) -> tuple[Read, Read]:
        """(at rest, under load) with so much of the change; 0 for none."""
        return self._shown(self._rest, level, REST_FRAMES), self._shown(self._load, level, LOAD_FRAMES)

    def _shown(self, pictures: Sequence[Picture], level: float, frames: int) -> Read:
        seed = 100 + self._endcap  # dust and drop stay where they are
        shown = [self._change(p, level, np.random.default_rng(seed)) if level else p for p in pictures]
        readings = [self._pipeline.update(self._frame(shown[k % len(shown)])) for k in range(frames)]
        reading, behind = readings[-2:]
        assert reading is not None and behind is not None
        return _read(reading, behind.before.offset)

    def _frame(self, picture: Picture) -> Frame:
        self._count += 1
        noisy = np.clip(np.rint(picture + self._rng.normal(0, NOISE, picture.shape)), 0, 255).astype(np.uint8)
        jpeg = cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
        return Frame(self._count / RATE_HZ, self._count, "bench", jpeg=jpeg, size=(640, 480))


def _decoded(jpeg: bytes) -> Picture:
    return np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.float32)


def _read(reading: EndcapReading, at_rest: tuple[float, ...]) -> Read:
    variance = np.diagonal(reading.wrench.covariance)[:3]
    offset = TO_ENDCAP @ np.array(at_rest or (0.0,) * 6)
    alone = np.maximum(variance - offset[:3] ** 2, 1e-12)
    flagged = bool(reading.wrench.flags) or not reading.valid
    return Read(np.array(reading.wrench.force_n), np.sqrt(variance), np.sqrt(alone), flagged)


def rows_of(change: Change, model: LiveModel) -> list[dict[str, object]]:
    """The table of one change."""
    unit, levels = STEPS[change]
    worn = [Worn(endcap, model, change) for endcap in range(ENDCAPS)]
    clear = [each.at(0.0) for each in worn]
    rows: list[dict[str, object]] = []
    for level in levels:
        now = [each.at(level) for each in worn]
        for place, state in enumerate(("rest", "load")):
            pairs = [
                (read[place], before[place])
                for read, before, each in zip(now, clear, worn, strict=True)
                if state == "rest" or each.carries
            ]
            off = [np.abs(read.force_n - before.force_n) for read, before in pairs]
            sds = [(o / read.sd_n).max() for o, (read, _) in zip(off, pairs, strict=True)]
            alone = [(o / read.sd_alone_n).max() for o, (read, _) in zip(off, pairs, strict=True)]
            rows.append({
                "change": change.__name__.replace("_", " "), "level": level, "unit": unit, "state": state,
                "error_n": f"{_largest(map(np.linalg.norm, off)):.3f}", "sds_alone": f"{_largest(alone):.1f}",
                "sds": f"{_largest(sds):.1f}", "flagged": sum(read.flagged for read, _ in pairs), "endcaps": len(pairs),
            })  # fmt: skip
    return rows


def _largest(values: Iterable[float]) -> float:
    """Of those with a number; NaN where none has one."""
    return max((float(value) for value in values if np.isfinite(value)), default=float("nan"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, metavar="FILE", help="table to write")
    options = parser.parse_args(arguments)
    model, rows = load_model("default", ENDCAP.params), []
    for change in STEPS:
        rows += (found := rows_of(change, model))
        for row in found:
            print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    if options.out is not None:
        write_table(options.out, rows)
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
