"""What the tests of the live node share: drawn frames of a pressed dome, a linear stand-in model, sources that fail."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np

from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import LiveModel, live_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records import Frame, ShearField, Wrench
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.newest import FrameSource
from sensing.sources.warp import Bump, Displacement, warp_image
from sensing.tracking.tracker import DotTracker
from sensing.wrench.weight_files import SHIPPED

PATIENCE_S = 180.0  # for what must come; no test asks how soon
PUSH = Displacement(bumps=(Bump((330.0, 230.0), (9.0, 4.0), 90.0),))
SHAPE = (16, 16)
WEIGHTS_BYTES = (SHIPPED / "default_D130_T8.safetensors").stat().st_size  # a recording begins with them


class LinearModel:
    """Force proportional to the mean field: enough to see whether the pipeline carries numbers through."""

    def estimate(self, field: ShearField) -> Wrench:
        u, v = field.channel("u").mean(dtype=float), field.channel("v").mean(dtype=float)
        spread = np.hypot(field.channel("u"), field.channel("v")).mean(dtype=float)
        force = np.array([10 * u, 10 * v, -10 * spread])
        return Wrench(field.time_s, force, 0.01 * force, "sphere", np.diag([0.01] * 3 + [1e-4] * 3))


def stand_in(method: str = "dots") -> LiveModel:
    return live_model("stand-in", LinearModel(), SHAPE, method)


def film(pushes: list[float], noise: bool = True) -> list[bytes]:
    """JPEGs of the drawn dome under shares of one push; no two are equal."""
    rest, _ = draw_dots(Drawing())
    warped = {share: rest if share == 0 else warp_image(rest, PUSH.scaled(share)) for share in set(pushes)}
    found = []
    for index, share in enumerate(pushes):
        picture = warped[share].copy()
        if noise:
            picture[-4:, : 1 + index % 600] ^= 8  # a corner without dots
        found.append(cv2.imencode(".jpg", picture)[1].tobytes())
    return found


def dots() -> int:
    """How many dots of the drawn dome are followed: those that the frame's edge does not cut."""
    return len(DotTracker(frames(film([0]))[0]).dots)


def frames(jpegs: list[bytes], start_s: float = 100.0, rate_hz: float = 30.0) -> list[Frame]:
    return [Frame(start_s + k / rate_hz, k, "test", jpeg=jpeg, size=(640, 480)) for k, jpeg in enumerate(jpegs)]


def endless(jpegs: list[bytes], rate_hz: float = 60.0) -> Callable[[], FrameSource]:
    """Opens a camera that shows the pictures over and over."""

    def source() -> Iterator[Frame]:
        count = 0
        while True:
            time.sleep(1 / rate_hz)
            jpeg = bytes(bytearray(jpegs[count % len(jpegs)]))  # memory of its own, as from a camera
            yield Frame(time.monotonic(), count, "test", jpeg=jpeg, size=(640, 480))
            count += 1

    return source


class Shown:
    """Cameras whose picture is chosen while they run.

    Attributes:
        now: ``free``, ``pressed``, ``black``, ``broken`` (a cut JPEG), or ``disturbed`` (it moves all the time).
    """

    def __init__(self, now: str = "free") -> None:
        self.now = now
        pictures = film([0] * 12 + [1.0] * 12)
        dark = np.random.default_rng(0).integers(0, 4, (12, 480, 640, 3), np.uint8)
        self._films = {
            "free": pictures[:12],
            "pressed": pictures[12:],
            "black": [cv2.imencode(".jpg", picture)[1].tobytes() for picture in dark],
            "broken": [jpeg[: len(jpeg) // 2] + b"\xff\xd9" for jpeg in pictures[:12]],
            "disturbed": [jpeg for pair in zip(pictures[:12], pictures[12:], strict=True) for jpeg in pair],
        }

    def camera(self, rate_hz: float = 30.0) -> Callable[[], FrameSource]:
        """Opens one."""

        def source() -> Iterator[Frame]:
            for count in itertools.count():
                time.sleep(1 / rate_hz)
                pictures = self._films[self.now]
                yield Frame(time.monotonic(), count, "test", jpeg=pictures[count % len(pictures)], size=(640, 480))

        return source


def pipeline(name: str = "endcap_0", number: int = 0, zero_frames: int = 1, source: str = "test") -> EndcapPipeline:
    return EndcapPipeline(EndcapConfig(name, source), stand_in(), None, number, zero_frames)


def wait_for(condition: Callable[[], object], every_s: float = 0.01) -> None:
    """Returns as soon as the condition holds; fails after so long that no load of the computer explains it."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(every_s)


def a_reading():
    pipe, found = pipeline(), None
    for frame in frames(film([0, 0, 1.0, 1.0])):
        found = pipe.update(frame, time.monotonic())
    return pipe, found
