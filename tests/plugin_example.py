"""One plug-in of each kind, as a package of somebody else would have them (docs/extending.md)."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np

from sensing.live.core.reading import EndcapReading
from sensing.records import Frame, ShearField, Wrench
from sensing.sources.camera import CameraConfig
from sensing.sources.files import read_picture

ENTRY_POINTS = """\
[endcap.cameras]
still = plugin_example:Still

[endcap.field_methods]
nothing = plugin_example:Nothing

[endcap.indenters]
ball = plugin_example:Ball

[endcap.wrench_models]
constant = plugin_example:Constant

[endcap.outputs]
file = plugin_example:Lines
"""


class Still:
    """A camera that sees one picture again and again; the address is its file."""

    def __init__(self, address: str, camera: CameraConfig) -> None:
        self._frame, self._step_s = read_picture(Path(address)), 1 / camera.rate_hz

    def __iter__(self):
        for number in range(1_000_000):
            yield Frame(time.monotonic(), number, "still", image=self._frame.image, jpeg=self._frame.jpeg)
            time.sleep(self._step_s)


class Nothing:
    """A field method that sees no motion."""

    def __init__(self, reference: Frame, shape: tuple[int, int]) -> None:
        self._shape = shape

    def update(self, frame: Frame) -> ShearField:
        """Zeros."""
        return ShearField(frame.time_s, np.zeros((2, *self._shape), np.float32))


class Ball:
    """A sphere, to be compared with the one that is there."""

    keeps_mirror = True

    @staticmethod
    def distance(body, y, gradient, hessian):
        """Signed distance; fills gradient and Hessian."""
        length = 0.0
        for i in range(3):
            gradient[i] = y[i] - body.point_mm[i]
            length += gradient[i] ** 2
        length = math.sqrt(length)
        for i in range(3):
            gradient[i] /= length
        for i in range(3):
            for j in range(3):
                hessian[i, j] = ((1.0 if i == j else 0.0) - gradient[i] * gradient[j]) / length
        return length - body.radius_mm


class Constant:
    """A model that reports 2 N toward the base, whatever it sees."""

    shape, method = (16, 16), "nothing"

    def __init__(self, params, weights) -> None:
        self.params, self.weights = params, weights

    def estimate(self, field: ShearField) -> Wrench:
        """The same wrench for every field."""
        return Wrench(field.time_s, np.array([0.0, 0.0, -2.0]), np.zeros(3), "sphere", 0.01 * np.eye(6))


class Lines:
    """An output that appends a line a reading to a file."""

    def __init__(self, words: str, names: tuple[str, ...]) -> None:
        self._stream = Path(words).open("a", encoding="utf-8")  # noqa: SIM115

    def put(self, reading: EndcapReading) -> None:
        """One line."""
        self._stream.write(f"{reading.endcap} {reading.wrench.force_n[2]:.3f}\n")

    def close(self) -> None:
        """The file is whole."""
        self._stream.close()
