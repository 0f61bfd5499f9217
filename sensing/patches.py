"""Aligns the windows around the dots with those of the reference.

Inverse-compositional Lucas-Kanade (Baker and Matthews 2004, doi:10.1023/B:VISI.0000011205.11775.fd) of a translation,
with the window's brightness modelled as gain * T + offset + ramp in x and y. Because these are projected out of the
gradients beforehand, an iteration is three dot products a window, and neither exposure nor a lamp gradient moves the
answer. The local stretch and turn of the skin enters as a fixed 2 x 2 matrix per window, known from the neighbours.

Units: pixels of the working (reduced) picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.patch_kernels import SATURATED, align_windows
from sensing.records import Image

SHEAR_DAMPING = 0.02  # of the mean curvature: what a window cannot tell about its stretch stays as it was


@dataclass(frozen=True)
class Patches:
    """Windows of the reference, ready for :func:`align`; pixels beyond the frame have weight 0.

    Attributes:
        centre: (N, 2) whole-pixel centres x, y of the windows.
        half: half width; a window is (2 half + 1) square.
        texture: (N, M) reference gray minus its weighted mean.
        weight: (N, M), sums to 1 per window.
        slope: (N, M, 2) x and y derivatives of the reference.
        descent: (N, 2, M) weighted, projected, so that descent . I / gain is the misalignment.
        shear: (N, 4, M) weighted, projected, so that shear . I / gain is the misfit of the stretch, row by row of its
            2 x 2 matrix; damped where a round dot cannot tell (its own rotation).
        gain: (N, M) weighted, projected, so that gain . I is the contrast relative to the reference.
        energy: (N,) weighted variance of the texture.
    """

    centre: NDArray[np.float32]
    half: int
    texture: NDArray[np.float32]
    weight: NDArray[np.float32]
    slope: NDArray[np.float32]
    descent: NDArray[np.float32]
    shear: NDArray[np.float32]
    gain: NDArray[np.float32]
    energy: NDArray[np.float32]


def cut_patches(gray: Image, position: NDArray[np.float64], half: int) -> Patches:
    """Windows of a gray picture around positions (N, 2); a window with too little texture gets zero energy."""
    count, side = len(position), 2 * half + 1
    centre = np.rint(position).astype(int)
    offset = np.arange(-half, half + 1)
    dx, dy = (a.ravel().astype(float) for a in np.meshgrid(offset, offset))
    window = np.clip(1.25 - np.hypot(dx, dy) / (half + 0.5), 0, 1) ** 0.5
    smooth = gray.astype(np.float32)
    slopes = np.gradient(np.pad(smooth, half + 1, mode="edge"))[::-1]  # x, y
    texture, weight, gain = (np.zeros((count, side * side), np.float32) for _ in range(3))
    slope, descent = np.zeros((count, side * side, 2), np.float32), np.zeros((count, 2, side * side), np.float32)
    shear = np.zeros((count, 4, side * side), np.float32)
    energy = np.zeros(count, np.float32)
    for index, (x, y) in enumerate(centre):
        columns, rows = x + dx.astype(int), y + dy.astype(int)
        inside = (columns >= 0) & (columns < gray.shape[1]) & (rows >= 0) & (rows < gray.shape[0])
        value = smooth[np.clip(rows, 0, gray.shape[0] - 1), np.clip(columns, 0, gray.shape[1] - 1)].astype(float)
        w = window * inside * (value < SATURATED)
        if w.sum() < 0.25 * window.sum():
            continue
        w /= w.sum()
        value -= w @ value
        grad = np.stack([s[rows + half + 1, columns + half + 1] for s in slopes], axis=1).astype(float)
        ramps = np.stack([np.ones_like(dx), dx, dy], axis=1)
        energy[index] = w @ value**2
        texture[index], weight[index], slope[index] = value, w, grad
        pure = _project(grad, np.column_stack([ramps, value]), w)
        descent[index] = np.linalg.pinv(pure.T @ (w[:, None] * pure), rcond=1e-6) @ (w[:, None] * pure).T
        bent = _project(
            np.stack([grad[:, 0] * dx, grad[:, 0] * dy, grad[:, 1] * dx, grad[:, 1] * dy], axis=1),
            np.column_stack([ramps, value, grad]),
            w,
        )
        normal = bent.T @ (w[:, None] * bent)
        damped = normal + SHEAR_DAMPING * np.trace(normal) / 4 * np.eye(4)
        shear[index] = np.linalg.pinv(damped, rcond=1e-9) @ (w[:, None] * bent).T
        shade = _project(value[:, None], np.column_stack([ramps, grad]), w)[:, 0]
        gain[index] = w * shade / max(w @ shade**2, 1e-9)
    return Patches(centre.astype(np.float32), half, texture, weight, slope, descent, shear, gain, energy)


def align(
    image: Image,
    patches: Patches,
    which: NDArray[np.int64],
    displacement: NDArray[np.float64],
    stretch: NDArray[np.float64],
    iterations: int = 10,
) -> NDArray[np.float64]:
    """Align the windows ``which``; ``displacement`` (N, 2) is the start and is overwritten for these rows.

    Args:
        image: (H, W) uint8.
        patches: reference windows.
        which: rows to treat.
        displacement: (N, 2) pixels.
        stretch: (N, 2, 2) gradient of the displacement at each dot (d displacement_i / d x_j), the start; overwritten
            by what the windows show (windows cut by the frame or a highlight keep the start).
        iterations: at most.

    Returns:
        (N,) correlation with the reference, -1..1; rows not treated are 0.
    """
    quality = np.zeros(len(displacement))
    if min(image.shape) >= 3:
        align_windows(
            image, patches.centre, patches.half, patches.texture, patches.weight, patches.slope, patches.descent,
            patches.shear, patches.gain, patches.energy, which, displacement, stretch, iterations, quality,
        )  # fmt: skip
    return quality


def _project(columns: NDArray, basis: NDArray, weight: NDArray) -> NDArray:
    """Columns minus their weighted least-squares fit by the basis."""
    root = np.sqrt(weight)[:, None]
    return columns - basis @ np.linalg.lstsq(root * basis, root * columns, rcond=1e-9)[0]
