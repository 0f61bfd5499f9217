"""The records that pass from camera to contact: frame -> dot tracks -> shear field -> wrench (numpy and stdlib only).

A simulated and a real frame are the same record, so nothing downstream knows the difference.

Image frame: x to the right, y down, origin at the centre of the top-left pixel of the full-size image, pixels.
Times are seconds of one monotonic clock (``time.monotonic``), never wall time, so that differences mean something.
Arrays inside a record are set read-only: a record can be shared between threads.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError

Image = NDArray[Any]  # uint8, (H, W) gray or (H, W, 3) BGR; OpenCV's own type hints cannot say so
PIXELS_OF_200 = "px of the 200x200 centre crop"
LEAST_SEEN = 0.5  # share of the dots; with fewer, what the others do is guesswork


@dataclass(frozen=True)
class Frame:
    """One picture, either decoded or still as JPEG bytes (then whoever needs it decodes once, at the size needed).

    Attributes:
        time_s: capture time on the monotonic clock (from the driver where it gives one, else the arrival).
        sequence: counts up by one for every frame the source captured; a gap means dropped frames.
        source: the device, file or simulator that the frame came from.
        image: uint8, (H, W) gray or (H, W, 3) BGR; None while only ``jpeg`` is there.
        jpeg: the compressed bytes; None when the source gives raw pictures.
        size: (width, height) in pixels of the full-size picture; None while unknown (JPEG not yet parsed).
        exposure: exposure as the driver states it; None where it does not.
        gain: gain as the driver states it; None where it does not.
        fault: why there is no picture, one line; whoever decodes the frame raises it. Empty where there is one.
    """

    time_s: float
    sequence: int
    source: str
    image: Image | None = None
    jpeg: bytes | None = None
    size: tuple[int, int] | None = None
    exposure: float | None = None
    gain: float | None = None
    fault: str = ""

    def shows_same(self, other: Frame) -> bool:
        """Whether another frame holds the very picture; pixels are compared on a grid."""
        if self.jpeg is not None and other.jpeg is not None:
            return self.jpeg == other.jpeg
        if self.image is None or other.image is None or self.image.shape != other.image.shape:
            return False
        return bool((self.image[::7, ::7] == other.image[::7, ::7]).all())

    def __post_init__(self) -> None:
        if self.image is None and not self.jpeg:
            raise ParameterError(
                f"Frame from {self.source} holds neither image nor jpeg: give one of them", name="image", value=None
            )
        if self.image is not None and self.size is None:
            object.__setattr__(self, "size", (int(self.image.shape[1]), int(self.image.shape[0])))


@dataclass(frozen=True)
class DotTracks:
    """Where the painted dots are now, with how much each can be trusted.

    Attributes:
        time_s: capture time of the frame.
        ids: (N,) int64, stable for the life of a reference.
        reference_px: (N, 2) x, y in the undeformed image, full-size pixels.
        position_px: (N, 2) x, y now; for a lost dot the place where it is expected.
        quality: (N,) 0..1, correlation of the dot's surroundings with the reference (0 when lost).
        lost: (N,) bool.
        size: (width, height) of the full-size image.
        stretch: (N, 2, 2) d displacement_i / d x_j as each dot's own window shows it, NaN where it does not; None for
            methods that do not measure it.
    """

    time_s: float
    ids: NDArray[np.int64]
    reference_px: NDArray[np.float64]
    position_px: NDArray[np.float64]
    quality: NDArray[np.float64]
    lost: NDArray[np.bool_]
    size: tuple[int, int]
    stretch: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        count = len(self.ids)
        shapes: dict[str, tuple[int, ...]] = {
            "reference_px": (count, 2),
            "position_px": (count, 2),
            "quality": (count,),
            "lost": (count,),
        }
        if self.stretch is not None:
            shapes["stretch"] = (count, 2, 2)
        for name, shape in shapes.items():
            _require_shape(name, getattr(self, name), shape)
        _freeze(self, ("ids", *shapes))

    @property
    def displacement_px(self) -> NDArray[np.float64]:
        """(N, 2) position minus reference, full-size pixels."""
        return self.position_px - self.reference_px

    @property
    def enough(self) -> bool:
        """Whether so many dots are seen that something can be said of all."""
        return bool(np.count_nonzero(~self.lost) >= LEAST_SEEN * len(self.lost))


@dataclass(frozen=True)
class ShearField:
    """A grid of channels over the centre square of the image; cell (0, 0) is the top left.

    Attributes:
        time_s: capture time of the frame.
        channels: (C, H, W) float32.
        names: the C channel names; "u" is along x (right), "v" along y (down).
        unit: unit of u and v.
        valid: (H, W) bool, False where the method has nothing to go by; set False where u or v is not finite.
    """

    time_s: float
    channels: NDArray[np.float32]
    names: tuple[str, ...] = ("u", "v")
    unit: str = PIXELS_OF_200
    valid: NDArray[np.bool_] = field(default_factory=lambda: np.empty((0, 0), bool))

    def __post_init__(self) -> None:
        if self.channels.ndim != 3 or len(self.names) != self.channels.shape[0]:
            raise ParameterError(
                f"channels of shape {self.channels.shape} do not fit names {self.names}: expected (len(names), H, W)",
                name="channels",
                value=self.channels.shape,
            )
        if self.valid.size == 0:
            object.__setattr__(self, "valid", np.ones(self.channels.shape[1:], bool))
        _require_shape("valid", self.valid, self.channels.shape[1:])
        if not np.isfinite(self.channels).all():
            moved = [k for k, name in enumerate(self.names) if name in ("u", "v")]
            object.__setattr__(self, "valid", self.valid & np.isfinite(self.channels[moved]).all(axis=0))
        _freeze(self, ("channels", "valid"))

    def channel(self, name: str) -> NDArray[np.float32]:
        """One (H, W) channel by name.

        Raises:
            ParameterError: no channel of that name.
        """
        if name not in self.names:
            raise ParameterError(f"channel={name!r} not in {', '.join(self.names)}", name="channel", value=name)
        return self.channels[self.names.index(name)]


@dataclass(frozen=True)
class Wrench:
    """Force and torque on the endcap.

    Attributes:
        time_s: capture time of the frame it was computed from.
        force_n: (3,) N.
        torque_nm: (3,) N m, about the origin of ``frame``.
        frame: coordinate frame of both, for example "endcap".
        covariance: (6, 6) of (force, torque); NaN where the model gives none.
        flags: warnings such as "out_of_range", "dots_lost", "lamp_drift"; empty when all is well.
    """

    time_s: float
    force_n: NDArray[np.float64]
    torque_nm: NDArray[np.float64]
    frame: str = "endcap"
    covariance: NDArray[np.float64] = field(default_factory=lambda: np.full((6, 6), np.nan))
    flags: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        _require_shape("force_n", self.force_n, (3,))
        _require_shape("torque_nm", self.torque_nm, (3,))
        _require_shape("covariance", self.covariance, (6, 6))
        _freeze(self, ("force_n", "torque_nm", "covariance"))


def _require_shape(name: str, array: NDArray, shape: tuple[int, ...]) -> None:
    if np.shape(array) != shape:
        raise ParameterError(f"{name} has shape {np.shape(array)}, expected {shape}", name=name, value=array)


def _freeze(record: Any, names: tuple[str, ...]) -> None:
    """Replace the named arrays by read-only views, so that the caller's own array stays writable."""
    for name in names:
        view = np.asarray(getattr(record, name)).view()
        view.setflags(write=False)
        record.__dict__[name] = view
