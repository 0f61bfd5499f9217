"""The shear field exactly as the released sensor computes it, so that its network and its data keep working.

The steps are NET01 to NET07 of docs/provenance.md: centre square, 200 x 200 area average cut to 8 bits,
gray with the RGB weights applied to a BGR frame, Farneback flow against the undeformed image, mean over 25 x 25
blocks, bilinear to H x W. Unit of u and v: pixels of the 200 x 200 crop; x to the right, y down. Derived channels
follow the public definition of the GelSlim 4.0 shear field (Sipos et al. 2024): derivatives per cell by central
differences, solenoidal and irrotational parts by the natural Helmholtz-Hodge decomposition (Bhatia, Pascucci,
Bremer 2014, doi:10.1109/TVCG.2014.2312012).

One flow per frame. The channels du, dv, dudt, dvdt (change since the previous frame) need a second one, which is
computed only if one of them is asked for.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.decode import decode_bgr
from sensing.records import Frame, Image, ShearField

CROP_PX = 200  # P, NET02: the square that the flow sees
BLOCK_PX = 25  # M, NET05: pooling block, 8 x 8 blocks
MOST_CELLS = 100  # each way: two pixels a cell; its operator for the dots takes 0.5 GB
FARNEBACK = (0.5, 3, 45, 3, 5, 1.2, 0)  # M, NET04: pyramid, levels, window, iterations, poly_n, poly_sigma, flags
FLOW_CHANNELS = ("u", "v", "div", "curl", "sol_u", "sol_v", "irr_u", "irr_v")
CHANGE_CHANNELS = ("du", "dv", "dudt", "dvdt")
CHANNELS = FLOW_CHANNELS + CHANGE_CHANNELS


@dataclass(frozen=True)
class GelslimConfig:
    """What to compute.

    Attributes:
        shape: (H, W) of the field; the released network takes (30, 30), the one-camera node shows (18, 18).
        channels: any of :data:`CHANNELS`, in the order wanted.

    Raises:
        ParameterError: unknown channel, or a shape under 2 x 2 (derivatives need two cells) or over 100 x 100.
    """

    shape: tuple[int, int] = (30, 30)
    channels: tuple[str, ...] = ("u", "v")

    def __post_init__(self) -> None:
        unknown = [name for name in self.channels if name not in CHANNELS]
        if unknown or not self.channels:
            raise ParameterError(
                f"channels={','.join(unknown) or 'none'}: choose from {', '.join(CHANNELS)}",
                name="channels",
                value=self.channels,
            )
        if not 2 <= min(self.shape) <= max(self.shape) <= MOST_CELLS:
            raise ParameterError(
                f"shape={self.shape[0]}x{self.shape[1]} outside 2x2..{MOST_CELLS}x{MOST_CELLS}: derivatives need two "
                f"cells each way, and the crop of {CROP_PX} px shows nothing finer",
                name="shape",
                value=self.shape,
            )

    @property
    def needs_change(self) -> bool:
        """Whether a second flow, from the previous frame, is needed."""
        return any(name in CHANGE_CHANNELS for name in self.channels)


class GelslimField:
    """Frames in, shear fields out, against one undeformed reference.

    Args:
        reference: the undeformed picture (bare silicone, nothing touches it).
        config: shape and channels.
    """

    def __init__(self, reference: Frame, config: GelslimConfig | None = None) -> None:
        self.config = config or GelslimConfig()
        self._reference = released_gray(decode_bgr(reference))
        self._previous: tuple[Image, float] | None = None

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame; the first frame's change channels are those of a frame against itself.

        dudt and dvdt are NaN while no time has passed since the previous frame (the released code divides by zero).
        """
        gray = released_gray(decode_bgr(frame))
        u, v = pooled_flow(self._reference, gray, self.config.shape)
        known = {"u": u, "v": v}
        if self.config.needs_change:
            before, before_s = self._previous or (gray, frame.time_s)
            known |= _change(before, gray, frame.time_s - before_s, self.config.shape)
            self._previous = (gray, frame.time_s)
        known |= derived_channels(u, v, self.config.channels)
        stack = np.stack([known[name] for name in self.config.channels]).astype(np.float32)
        return ShearField(frame.time_s, stack, self.config.channels)


def released_gray(image: Image) -> Image:
    """The (200, 200) gray picture that the released flow sees, from an (H, W, 3) BGR one.

    Notes:
        Output row i averages the input rows floor(i S / 200) to ceil((i + 1) S / 200) - 1 of the square of side S
        (adaptive average pooling; windows overlap), likewise for columns. Cutting that float mean to 8 bits equals
        whole-number division of the window's sum, which is exact.
    """
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    height, width = image.shape[:2]
    side = min(height, width)
    top, left = (height - side) // 2, (width - side) // 2
    square = np.ascontiguousarray(image[top : top + side, left : left + side])
    low, high = _pooling_window(side)
    total = cv2.integral(square)
    rows = total[high] - total[low]
    sums = rows[:, high] - rows[:, low]
    count = np.outer(high - low, high - low)[:, :, None]
    pooled = (sums // count).astype(np.uint8)
    return cv2.cvtColor(pooled, cv2.COLOR_RGB2GRAY)  # the released code hands BGR to it: kept


def pooled_flow(
    reference: Image, gray: Image, shape: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(u, v), each (H, W), from two pictures.

    Args:
        reference, gray: (200, 200) gray pictures, before and after.
        shape: (H, W) of the field.
    """
    flow = cv2.calcOpticalFlowFarneback(reference, gray, None, *FARNEBACK)  # type: ignore[call-overload]
    blocks = CROP_PX // BLOCK_PX
    mean = flow.reshape(blocks, BLOCK_PX, blocks, BLOCK_PX, 2).mean(axis=(1, 3))
    field = cv2.resize(mean, (shape[1], shape[0]), interpolation=cv2.INTER_LINEAR)
    return field[:, :, 0], field[:, :, 1]


def derived_channels(
    u: NDArray[np.floating], v: NDArray[np.floating], names: tuple[str, ...]
) -> dict[str, NDArray[np.floating]]:
    """The channels of div, curl and the Helmholtz parts that ``names`` lists, per cell.

    Args:
        u, v: (H, W) each.
        names: channels wanted.
    """
    found: dict[str, NDArray[np.floating]] = {}
    if "div" in names:
        found["div"] = divergence(u, v)
    if "curl" in names:
        found["curl"] = curl(u, v)
    if any(name[:4] in ("sol_", "irr_") for name in names):
        (found["sol_u"], found["sol_v"]), (found["irr_u"], found["irr_v"]) = helmholtz_parts(u, v)
    return found


def divergence(u: NDArray[np.floating], v: NDArray[np.floating]) -> NDArray[np.floating]:
    """du/dx + dv/dy per cell, central differences inside and one-sided at the border."""
    return np.gradient(u, axis=1) + np.gradient(v, axis=0)


def curl(u: NDArray[np.floating], v: NDArray[np.floating]) -> NDArray[np.floating]:
    """dv/dx - du/dy per cell, central differences inside and one-sided at the border."""
    return np.gradient(v, axis=1) - np.gradient(u, axis=0)


def helmholtz_parts(
    u: NDArray[np.floating], v: NDArray[np.floating]
) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
    """(solenoidal u, v), (irrotational u, v); the harmonic rest is u, v minus both.

    Notes:
        Natural decomposition: potentials D = G * div and R = G * curl with the free-space Green's function
        G = log(r) / (2 pi), its value at r = 0 taken at half a cell; irrotational = grad D, solenoidal =
        (-dR/dy, dR/dx). Where div or curl is NaN it counts as zero, so that one bad cell does not spoil all.
    """
    u, v = np.asarray(u, float), np.asarray(v, float)
    potential = _free_space_potential(np.nan_to_num(divergence(u, v)))
    stream = _free_space_potential(np.nan_to_num(curl(u, v)))
    solenoidal = (-np.gradient(stream, axis=0), np.gradient(stream, axis=1))
    irrotational = (np.gradient(potential, axis=1), np.gradient(potential, axis=0))
    return solenoidal, irrotational


def _change(before: Image, gray: Image, step_s: float, shape: tuple[int, int]) -> dict[str, NDArray[np.floating]]:
    du, dv = pooled_flow(before, gray, shape)
    rate = 1.0 / step_s if step_s > 0 else np.nan
    return {"du": du, "dv": dv, "dudt": du * rate, "dvdt": dv * rate}


@functools.lru_cache(maxsize=8)
def _pooling_window(side: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    index = np.arange(CROP_PX)
    return index * side // CROP_PX, -(-(index + 1) * side // CROP_PX)


@functools.lru_cache(maxsize=8)
def _green_spectrum(shape: tuple[int, int]) -> NDArray[np.complex128]:
    """Spectrum of log(r) / (2 pi), wrapped and padded to twice the grid so that the convolution is not circular."""
    offset_y = np.fft.fftfreq(2 * shape[0], 1 / (2 * shape[0]))[:, None]
    offset_x = np.fft.fftfreq(2 * shape[1], 1 / (2 * shape[1]))[None, :]
    radius = np.hypot(offset_y, offset_x)
    radius[0, 0] = 0.5
    return np.fft.rfft2(np.log(radius) / (2 * np.pi))


def _free_space_potential(source: NDArray[np.floating]) -> NDArray[np.float64]:
    height, width = source.shape
    padded = (2 * height, 2 * width)
    return np.fft.irfft2(np.fft.rfft2(source, padded) * _green_spectrum((height, width)), padded)[:height, :width]
