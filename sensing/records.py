"""Records between the stages from camera to contact: frame -> dot tracks -> shear field -> wrench.

A simulated and a real frame are the same record, so that no later stage can treat them differently. The module imports
numpy and the standard library only.

Image frame: x to the right, y down, origin at the centre of the top-left pixel of the full-size image, pixels.
Times are seconds of one monotonic clock (``time.monotonic``), never wall time: setting the clock cannot change their
differences. Arrays inside a record are read-only, so that threads can share it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError

Image = NDArray[Any]  # uint8, (H, W) gray or (H, W, 3) BGR; OpenCV's type hints do not express it
PIXELS_OF_200 = "px of the 200x200 centre crop"
TABLE_G_M_S2 = 9.81  # one g of the tables that ship: own_weight.csv, scene.npz and bench/robot_model.csv hold with it
LEAST_SEEN = 0.5  # E: share of the dots that must be followed: the others are predicted from them


@dataclass(frozen=True)
class Frame:
    """One picture, decoded or as JPEG bytes; a reader decodes these once, at the size that it needs.

    Attributes:
        time_s: capture time on the monotonic clock (the driver's time stamp where there is one, else the arrival).
        sequence: number of the frame as the source counts them; a gap means dropped frames.
        source: device, file or simulator of the frame.
        image: uint8, (H, W) gray or (H, W, 3) BGR; None for a frame that holds only ``jpeg``.
        jpeg: the compressed bytes; None when the source gives raw pictures.
        size: (width, height) in pixels of the full-size picture; None while unknown (JPEG not yet parsed).
        exposure: exposure that the driver reports, in its unit; None where it reports none.
        fault: reason why there is no picture, one line, with which decoding raises; empty where there is one.
        coding: of a video that builds pictures from others and so may show dots late
            (:mod:`sensing.sources.coding`); empty of other sources.

    Raises:
        ParameterError: neither image nor jpeg.
    """

    time_s: float
    sequence: int
    source: str
    image: Image | None = None
    jpeg: bytes | None = None
    size: tuple[int, int] | None = None
    exposure: float | None = None
    fault: str = ""
    coding: str = ""

    def shows_same(self, other: Frame) -> bool:
        """Whether another frame holds the same picture; of decoded pictures, every seventh pixel is compared."""
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
    """Positions of the painted dots in one frame, with a quality for each.

    Attributes:
        time_s: capture time of the frame.
        ids: (N,) int64 identity of each dot, constant for one reference.
        reference_px: (N, 2) x, y in the undeformed image, full-size pixels.
        position_px: (N, 2) x, y in this frame, full-size pixels; for a lost dot the predicted position.
        quality: (N,) 0..1, correlation of the window round the dot with the reference (0 when lost).
        lost: (N,) bool.
        size: (width, height) of the full-size image, px.
        stretch: (N, 2, 2) d displacement_i / d x_j measured in the window round each dot, NaN where it cannot be; None
            for methods that do not measure it.

    Raises:
        ParameterError: an array of another shape.
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
        """Whether at least :data:`LEAST_SEEN` of the dots are followed."""
        return bool(np.count_nonzero(~self.lost) >= LEAST_SEEN * len(self.lost))


@dataclass(frozen=True)
class ShearField:
    """A grid of channels over the centre square of the image; cell (0, 0) is the top left.

    Attributes:
        time_s: capture time of the frame.
        channels: (C, H, W) float32.
        names: the C channel names; "u" is along x (right), "v" along y (down).
        unit: unit of u and v.
        valid: (H, W) bool, False where the method has no measurement near; set False where u or v is not finite.

    Raises:
        ParameterError: names or ``valid`` that do not fit the shape of the channels.
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
    """Force and torque that the world exerts on the endcap (signs: :mod:`sensing.frames`).

    Attributes:
        time_s: capture time of the frame from which it was computed.
        force_n: (3,) force, N.
        torque_nm: (3,) torque about the origin of ``frame``, N m.
        frame: coordinate frame of both, for example "endcap".
        covariance: (6, 6) of (force, torque), N^2, N^2 m and N^2 m^2; NaN where the model gives none.
        flags: warnings such as "out_of_range" or "dots_lost"; empty when there is none.

    Raises:
        ParameterError: an array of another shape.
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
