"""Aligns the windows around the dots with those of the reference.

Inverse-compositional Lucas-Kanade (Baker and Matthews 2004, doi:10.1023/B:VISI.0000011205.11775.fd) of a translation,
with the window's brightness modelled as gain * T + offset + ramp in x and y. Because these are projected out of the
gradients beforehand, an iteration is three dot products a window, and neither exposure nor a lamp gradient moves the
answer. The local stretch and turn of the skin enters as a fixed 2 x 2 matrix per window, known from the neighbours.

Units: pixels of the working (reduced) picture.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from sensing.tracking.patch_kernels import MARGIN, SATURATED, align_windows

ITERATIONS = 10  # most alignment steps per window
STOP_PX = 0.02  # a step this small ends the alignment, px of the working picture
LEAST_INSIDE = 0.25  # share of a window that must lie inside the frame and be unsaturated
OUTLINE = 0.15  # of a window's half width: how far the outline's slope reaches into a dot
LEAST_SILICONE = 0.7  # of a window's border must be lit for the dot in it to be a whole one
INK_WEIGHT = 0.0  # left to the inside of a dot
SMOOTHED_NOISE = (6 / 16) ** 2  # part of the variance of a picture's noise that the binomial 3 x 3 filter leaves
SHEAR_DAMPING = 0.02  # of the mean curvature: what a window does not show of its stretch stays as it was


@dataclass(frozen=True)
class Patches:
    """Windows of the reference, ready for :func:`align`; M = (2 half + 1) (2 half + 2) pixels, row by row.

    The last column of a window and pixels beyond the frame have weight 0.

    Attributes:
        centre: (N, 2) whole-pixel centres x, y of the windows.
        half: half width.
        texture: (N, M) reference gray minus its weighted mean.
        weight: (N, M), sums to 1 per window.
        rows: (N, 5, M) what an iteration multiplies the picture with: descent x and y (weighted, projected, so that
            descent . I / gain is the misalignment), gain (so that gain . I is the contrast relative to the reference),
            weight, and weight times texture.
        shear: (N, 4, M) weighted, projected, so that shear . I / gain is the misfit of the stretch, row by row of its
            2 x 2 matrix; damped where a round dot does not show it (its own rotation).
        plain: (N, 4, M) x slope, y slope, texture and weight, for windows that are seen in part.
        energy: (N,) weighted variance of the texture.
    """

    centre: NDArray[np.float32]
    half: int
    texture: NDArray[np.float32]
    weight: NDArray[np.float32]
    rows: NDArray[np.float32]
    shear: NDArray[np.float32]
    plain: NDArray[np.float32]
    energy: NDArray[np.float32]

    def only(self, kept: NDArray[np.bool_] | NDArray[np.intp]) -> Patches:
        """Some of the windows, by a mask or their numbers; each was cut for itself."""
        return Patches(half=self.half, **{
            field.name: np.ascontiguousarray(getattr(self, field.name)[kept])
            for field in fields(self) if field.name != "half"
        })  # fmt: skip

    @property
    def uncertainty_px(self) -> NDArray[np.float64]:
        """(N,) standard deviation of the less certain direction of a window's place, per gray level of white noise."""
        descent = self.rows[:, :2].astype(float)
        return np.sqrt(np.linalg.eigvalsh(descent @ descent.transpose(0, 2, 1))[:, 1])

    @property
    def variance_per_loss(self) -> NDArray[np.float64]:
        """(N,) variance of one axis of a window's position, px^2, per loss of correlation (1 - correlation).

        White noise of variance v in each of two pictures, both smoothed, lowers the correlation of a window by
        v / energy and displaces an axis with variance 2 v sum(g^2), where g is the axis's row of the descent. That sum
        holds for independent pixels. Smoothing correlates neighbours, so g is smoothed once more, and the sum is
        divided by the share of a single pixel's variance that smoothing leaves.
        """
        side = 2 * self.half + 1
        descent = self.rows[:, :2].reshape(-1, 2, side, side + 1).astype(float)
        descent = np.pad(descent, ((0, 0), (0, 0), (1, 1), (1, 1)))
        rows = descent[:, :, :-2] + 2 * descent[:, :, 1:-1] + descent[:, :, 2:]
        smooth = (rows[..., :-2] + 2 * rows[..., 1:-1] + rows[..., 2:]) / 16
        squares = (smooth**2).sum(axis=(2, 3)).mean(axis=1) / SMOOTHED_NOISE
        return np.asarray(2 * self.energy * squares)


def cut_patches(image: NDArray[np.float32], position: NDArray[np.float64], half: int) -> Patches:
    """Windows of a picture around positions; one with too little to see gets zero energy.

    Args:
        image: as :func:`sensing.tracking.patch_kernels.smoothed` gives it.
        position: (N, 2) px, x and y.
        half: half width of a window, px.
    """
    image = image[MARGIN:-MARGIN, MARGIN:-MARGIN]
    centre = np.rint(position).astype(int)
    dx, dy = (a.ravel() for a in np.meshgrid(np.arange(-half, half + 2), np.arange(-half, half + 1)))
    window = np.clip(1.25 - np.hypot(dx, dy) / (half + 0.5), 0, 1) ** 0.5 * (dx <= half)
    slopes = np.gradient(np.pad(image.astype(float), half + 2, mode="edge"))[::-1]  # x, y
    patches = _empty(centre, half, len(dx))
    height, width = image.shape
    columns, lines = centre[:, :1] + dx, centre[:, 1:] + dy  # (N, M)
    inside = (columns >= 0) & (columns < width) & (lines >= 0) & (lines < height)
    columns, lines = np.clip(columns, 0, width - 1), np.clip(lines, 0, height - 1)
    value = image[lines, columns].astype(float)
    weight = window * inside * (value < SATURATED)
    weight *= _outside_of_ink(value, half)
    ramps = np.stack([np.ones(len(dx)), dx, dy], axis=1)
    fits = _Fits([], [], [])
    for index, (x, y) in enumerate(centre):
        if weight[index].sum() >= LEAST_INSIDE * window.sum():
            weight[index] /= weight[index].sum()
            value[index] -= weight[index] @ value[index]
            gradient = np.stack([slope[y + dy + half + 2, x + dx + half + 2] for slope in slopes], axis=1)
            _prepare(patches, index, value[index], weight[index], gradient, ramps, fits)
    _invert(patches, weight, fits)
    return patches


def _empty(centre: NDArray[np.intp], half: int, size: int) -> Patches:
    count = len(centre)
    return Patches(
        centre=centre.astype(np.float32),
        half=half,
        texture=np.zeros((count, size), np.float32),
        weight=np.zeros((count, size), np.float32),
        rows=np.zeros((count, 5, size), np.float32),
        shear=np.zeros((count, 4, size), np.float32),
        plain=np.zeros((count, 4, size), np.float32),
        energy=np.zeros(count, np.float32),
    )


def _outside_of_ink(value: NDArray, half: int) -> NDArray:
    """(N, M) weights that leave out the inside of each window's dot: dried ink mirrors the lamp, its outline stays.

    The dot is what a level halfway between ink and silicone cuts off from the window's border; its inside begins
    :data:`OUTLINE` of the window's half width from there. A window in which that finds no whole dot keeps all.
    """
    side = 2 * half + 1
    squares = value.reshape(len(value), side, side + 1)[:, :, :side]
    if not len(value):
        return np.ones_like(value)
    dark, bright = np.percentile(squares.reshape(len(value), -1), (4, 75), axis=1)
    lit = (squares > ((dark + bright) / 2)[:, None, None]).astype(np.uint8)
    weight = np.ones((len(value), side, side + 1))
    for light, part in zip(lit, weight, strict=True):
        count, label = cv2.connectedComponents(light, connectivity=4)
        border = np.concatenate([label[0], label[-1], label[:, 0], label[:, -1]])
        lit_border = np.concatenate([light[0], light[-1], light[:, 0], light[:, -1]])
        if lit_border.mean() > LEAST_SILICONE:
            beyond = np.zeros(count, bool)
            beyond[border[lit_border > 0]] = True
            dot = np.zeros((side + 2, side + 2), np.uint8)
            dot[1:-1, 1:-1] = ~beyond[label]
            depth = cv2.distanceTransform(dot, cv2.DIST_L2, 5)[1:-1, 1:-1]
            part[:, :side] = np.clip(1 + OUTLINE * half - depth, INK_WEIGHT, 1)
    return weight.reshape(value.shape)


class _Fits(NamedTuple):
    """What is left of the slopes of the windows that are used, to be inverted for all at once."""

    numbers: list[int]
    pure: list[NDArray]  # (M, 2) of a shift
    bent: list[NDArray]  # (M, 4) of a stretch


def _prepare(
    patches: Patches, index: int, value: NDArray, weight: NDArray, gradient: NDArray, ramps: NDArray, fits: _Fits
) -> None:
    """Fills the rows of one window from its texture, weights and (M, 2) slopes, but for what :func:`_invert` fills."""
    root = np.sqrt(weight)[:, None]
    basis = np.empty((len(value), 6))
    basis[:, :3], basis[:, 3], basis[:, 4:] = ramps, value, gradient
    fits.numbers.append(index)
    fits.pure.append(_project(gradient, np.ascontiguousarray(basis[:, :4]), root))
    bent = (gradient[:, :, None] * ramps[:, None, 1:]).reshape(-1, 4)
    fits.bent.append(_project(bent, basis, root))
    shade = _project(value[:, None], np.delete(basis, 3, axis=1), root)[:, 0]
    patches.rows[index, 2] = weight * shade / max(weight @ shade**2, 1e-9)
    patches.rows[index, 3], patches.rows[index, 4] = weight, weight * value
    plain = patches.plain[index]
    plain[:2], plain[2], plain[3] = gradient.T, value, weight
    patches.texture[index], patches.weight[index] = value, weight
    patches.energy[index] = weight @ value**2


def _invert(patches: Patches, weights: NDArray, fits: _Fits) -> None:
    """Fills descent and shear of the windows that are used."""
    if not fits.numbers:
        return
    weighed = [weights[index][:, None] for index in fits.numbers]
    curvature = np.stack([pure.T @ (weight * pure) for weight, pure in zip(weighed, fits.pure, strict=True)])
    normal = np.stack([bent.T @ (weight * bent) for weight, bent in zip(weighed, fits.bent, strict=True)])
    damping = SHEAR_DAMPING * np.trace(normal, axis1=1, axis2=2) / 4
    shift = np.linalg.pinv(curvature, rcond=1e-6)
    stretch = np.linalg.pinv(normal + damping[:, None, None] * np.eye(4), rcond=1e-9)
    for k, (index, weight) in enumerate(zip(fits.numbers, weighed, strict=True)):
        patches.rows[index, :2] = shift[k] @ (weight * fits.pure[k]).T
        patches.shear[index] = stretch[k] @ (weight * fits.bent[k]).T


def align(
    image: NDArray[np.float32],
    patches: Patches,
    which: NDArray[np.int64],
    displacement: NDArray[np.float64],
    stretch: NDArray[np.float64],
    iterations: int = ITERATIONS,
    stop_px: float = STOP_PX,
) -> NDArray[np.float64]:
    """Align the windows ``which``; ``displacement`` (N, 2) is the start and is overwritten for these rows.

    Args:
        image: framed float32 picture as :func:`sensing.tracking.patch_kernels.smoothed` gives it.
        patches: reference windows.
        which: rows to treat.
        displacement: (N, 2) pixels.
        stretch: (N, 2, 2) gradient of the displacement at each dot (d displacement_i / d x_j), the start; overwritten
            by what the windows show (windows cut by the frame or a highlight keep the start).
        iterations: at most.
        stop_px: a step this small ends the iteration.

    Returns:
        (N,) correlation with the reference, -1..1; rows not treated are 0.
    """
    quality = np.zeros(len(displacement))
    align_windows(
        image, patches.centre, patches.half, patches.rows, patches.shear, patches.plain, patches.energy, which,
        displacement, stretch, iterations, np.float32(stop_px), quality,
    )  # fmt: skip
    return quality


def _project(columns: NDArray, basis: NDArray, root: NDArray) -> NDArray:
    """Columns minus their least-squares fit by the basis, weighted by the square of the (M, 1) roots."""
    return columns - basis @ np.linalg.lstsq(root * basis, root * columns, rcond=1e-9)[0]
