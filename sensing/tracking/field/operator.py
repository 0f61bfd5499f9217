"""Displacements of scattered dots to the field on a grid: one matrix, computed once per reference.

Units: displacements keep their unit; positions are full-size pixels. Lengths scale with the short side of the picture
(stated for 480 px).

Notes:
    Gaussian-process regression (Rasmussen and Williams 2006, eq. 2.23) with the kernel
    k(x, x') = a affine(x, x') + matern_5/2(|x - x'| / length) and noise lambda. The affine part has a wide prior
    instead of being exact, so that one formula serves any painted subset: one dot gives a constant, two a line,
    coincident dots average. The condition number of K + lambda I is at most
    (N (1 + a (1 + r^2)) + lambda) / lambda, whatever the dots, r being the largest distance from the dots' centroid
    in lengths.

    With Q = (K + lambda I)^-1, leaving dot i out predicts d_i - (Q d)_i / Q_ii; a lost set L is predicted from the
    rest by d_L = -Q_LL^-1 Q_LV d_V (Rasmussen and Williams, eq. 5.12), and putting these in their place gives the same
    field as removing the lost dots from the regression. So the matrix never has to be built again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from sensing.tracking.field.kernels import add_stretch_residual, cells_of_dots, stretch_at_dots

LENGTH_PX = 80.0  # at 480 px short side; measured in bench/bench_fields.py
NOISE = 0.005  # lambda, relative to the Matern part's variance
AFFINE_VARIANCE = 100.0  # a: ten standard deviations of the local part
STRETCH_NOISE = 0.3  # lambda of the measured derivatives (per length)
LEAST_STRETCH_RESIDUAL = 0.08  # residual of a measured stretch that is never used
MEDIAN_RESIDUALS = 2.5  # the same over the median residual of a frame
REACH_PX = 70.0  # at 480 px: a cell this near to an inlier is valid (dots are 40 to 50 apart)
CELL_SAMPLES = 3  # per side: a cell's value is its mean, not its centre's


@dataclass(frozen=True)
class CellMaps:
    """The part of a :class:`FieldOperator` that the cells of the field need.

    Attributes:
        to_cells: (N, H * W) displacement of the dots to mean displacement of the cells (cells = d @ to_cells).
        near: (H * W, N) 0 or 1, dot within reach of a cell.
        reached: (H, W) cells that any dot reaches.
        mean_kernel: (H * W, N) mean of the kernel between a cell's points and each dot.
    """

    to_cells: NDArray[np.float32]
    near: NDArray[np.float32]
    reached: NDArray[np.bool_]
    mean_kernel: NDArray[np.float64]


@dataclass(frozen=True)
class FieldOperator:
    """Linear maps for one set of dots; build it with :func:`field_operator`.

    Attributes:
        gram: (N, N) K + lambda I.
        precision: (N, N) Q = (K + lambda I)^-1.
        gradient: (2 N, N) displacement of the dots to its x (first N rows) and y derivative at the dots, per pixel.
        make_cells: makes :attr:`cells`.
        make_stretch_gain: makes :attr:`stretch_gain`.
        shape: (H, W).
    """

    gram: NDArray[np.float64]
    precision: NDArray[np.float64]
    gradient: NDArray[np.float64]
    make_cells: Callable[[], CellMaps]
    make_stretch_gain: Callable[[CellMaps], NDArray[np.float32]]
    shape: tuple[int, int]

    @cached_property
    def cells(self) -> CellMaps:
        """Maps to the cells: computed on first use, because a tracker needs none, and they take most of the time."""
        return self.make_cells()

    @property
    def to_cells(self) -> NDArray[np.float32]:
        """:attr:`CellMaps.to_cells`."""
        return self.cells.to_cells

    @property
    def reached(self) -> NDArray[np.bool_]:
        """:attr:`CellMaps.reached`."""
        return self.cells.reached

    @property
    def condition(self) -> float:
        """Condition number of K + lambda I."""
        return float(np.linalg.cond(self.gram))

    @cached_property
    def stretch_gain(self) -> NDArray[np.float32]:
        """(2 N, H * W) from residuals of the derivatives at the dots (x, then y) to displacements of the cells.

        It is computed on first use, because readers of displacements alone do not need it.
        """
        return self.make_stretch_gain(self.cells)

    def left_out(self, displacement: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) leave-one-out residuals: displacement of each dot minus its prediction from all others."""
        return (self.precision @ displacement) / self.precision.diagonal()[:, None]

    def filled(self, displacement: NDArray[np.float64], live: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(N, 2) with the rows of dots that are not live predicted from those that are (zero if none is)."""
        if live.all():
            return displacement
        if not live.any():
            return np.zeros_like(displacement)
        lost = ~live
        result = displacement.copy()
        known = self.precision[np.ix_(lost, live)] @ displacement[live]
        result[lost] = -np.linalg.solve(self.precision[np.ix_(lost, lost)], known)
        return result

    def predicted_stretch(self, displacement: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2, 2) d displacement_i / d x_j at the dots, from the displacements of all dots."""
        return stretch_at_dots(self.gradient, displacement, np.inf)

    def field(
        self, displacement: NDArray[np.float64], stretch: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """(2, H, W) mean displacement of the cells; rows of lost dots must have been filled.

        Args:
            displacement: (N, 2), finite.
            stretch: (N, 2, 2) measured at the dots (NaN where not): corrects the field where it differs from the
                smooth prediction by more than its usual scatter.
        """
        cells = cells_of_dots(self.to_cells, displacement)
        if stretch is not None:
            add_stretch_residual(
                cells,
                self.stretch_gain,
                self.predicted_stretch(displacement),
                stretch,
                LEAST_STRETCH_RESIDUAL,
                MEDIAN_RESIDUALS,
            )
        return cells.reshape(2, *self.shape)

    def valid(self, live: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(H, W) True where at least one live dot is within reach."""
        if live.all():
            return self.reached
        return (self.cells.near @ live.astype(np.float32) > 0.5).reshape(self.shape)


def field_operator(
    reference_px: NDArray[np.float64],
    size: tuple[int, int],
    shape: tuple[int, int] = (30, 30),
    length_px: float = LENGTH_PX,
    noise: float = NOISE,
) -> FieldOperator:
    """Build the maps for one set of dots.

    Args:
        reference_px: (N, 2) dots.
        size: (width, height) of the picture, px.
        shape: (H, W) of the field.
        length_px: length of the kernel at a short side of 480 px.
        noise: relative to the variance of the kernel's local part.

    Raises:
        ParameterError: no dots, positions that are not finite, or a length or noise that is not positive.
    """
    reference_px = _checked(reference_px, length_px, noise)
    scale = min(size) / 480.0
    origin = reference_px.mean(axis=0)  # the affine part is then well determined by few dots
    dots = (reference_px - origin) / (length_px * scale)
    gram = _kernel(dots, dots) + noise * np.eye(len(dots))
    precision = np.linalg.inv(gram)
    precision = (precision + precision.T) / 2
    gradient = _kernel_gradient(dots) @ precision
    centres, samples = _cell_points(size, shape)
    points = (samples - origin) / (length_px * scale)

    def make_cells() -> CellMaps:
        mean_kernel = _kernel(points, dots).reshape(shape[0] * shape[1], -1, len(dots)).mean(axis=1)
        near = np.linalg.norm(centres[:, None] - reference_px[None], axis=2) < REACH_PX * scale
        to_cells = np.ascontiguousarray((mean_kernel @ precision).T, np.float32)
        return CellMaps(to_cells, near.astype(np.float32), near.any(axis=1).reshape(shape), mean_kernel)

    def make_stretch_gain(cells: CellMaps) -> NDArray[np.float32]:
        stretch_gain = _stretch_gain(points, dots, cells.mean_kernel, precision, gradient) * (length_px * scale)
        return np.ascontiguousarray(stretch_gain.T, np.float32)

    return FieldOperator(
        gram=gram,
        precision=precision,
        gradient=gradient.reshape(-1, len(dots)) / (length_px * scale),
        make_cells=make_cells,
        make_stretch_gain=make_stretch_gain,
        shape=shape,
    )


def displacement_to_cells(
    reference_px: NDArray[np.float64],
    size: tuple[int, int],
    shape: tuple[int, int] = (30, 30),
    length_px: float = LENGTH_PX,
    noise: float = NOISE,
) -> NDArray[np.float64]:
    """(N, H * W) as :attr:`FieldOperator.to_cells`, without the rest of the operator.

    Args:
        reference_px, size, shape, length_px, noise: as for :func:`field_operator`.

    Raises:
        ParameterError: no dots, positions that are not finite, or a length or noise that is not positive.
    """
    reference_px = _checked(reference_px, length_px, noise)
    scale, origin = length_px * min(size) / 480.0, reference_px.mean(axis=0)
    dots = (reference_px - origin) / scale
    points = (_cell_points(size, shape)[1] - origin) / scale
    mean_kernel = _kernel(points, dots).reshape(shape[0] * shape[1], -1, len(dots)).mean(axis=1)
    return np.linalg.solve(_kernel(dots, dots) + noise * np.eye(len(dots)), mean_kernel.T)


def _checked(reference_px: NDArray[np.float64], length_px: float, noise: float) -> NDArray[np.float64]:
    reference_px = np.asarray(reference_px, float).reshape(-1, 2)
    if len(reference_px) == 0 or not np.isfinite(reference_px).all():
        raise ParameterError(
            f"reference_px has {len(reference_px)} dots, all finite: {bool(np.isfinite(reference_px).all())}: "
            "at least one finite position needed",
            name="reference_px",
            value=len(reference_px),
        )
    if not (length_px > 0 and noise > 0):
        raise ParameterError(f"length_px={length_px}, noise={noise}: both must be positive", name="noise", value=noise)
    return reference_px


def _kernel(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(len(a), len(b)) affine plus Matern 5/2 at unit length."""
    r = np.sqrt(5) * np.sqrt((a[:, None, 0] - b[None, :, 0]) ** 2 + (a[:, None, 1] - b[None, :, 1]) ** 2)
    return AFFINE_VARIANCE * (1 + a @ b.T) + (1 + r + r**2 / 3) * np.exp(-r)


def _kernel_gradient(dots: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, N, N) derivative of the kernel by its first point's x and y."""
    offset = dots[:, None] - dots[None]
    r = np.sqrt(5) * np.linalg.norm(offset, axis=2)
    slope = -5 / 3 * (1 + r) * np.exp(-r)  # dk/dr / r, times 5
    local = np.moveaxis(offset * slope[:, :, None], 2, 0)
    return local + AFFINE_VARIANCE * dots.T[:, None, :]


def _stretch_gain(
    points: NDArray[np.float64],
    dots: NDArray[np.float64],
    mean_kernel: NDArray[np.float64],
    precision: NDArray[np.float64],
    gradient: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(H * W, 2 N) gain of the derivative observations, given the displacements (block elimination)."""
    count = len(dots)
    offset = dots[:, None] - dots[None]
    r = np.sqrt(5) * np.linalg.norm(offset, axis=2)
    decay = 5 / 3 * np.exp(-r)
    curvature = np.zeros((2, count, 2, count))
    for a in range(2):
        for b in range(2):
            same = float(a == b)
            local = decay * ((1 + r) * same - 5 * offset[:, :, a] * offset[:, :, b])
            curvature[a, :, b] = local + AFFINE_VARIANCE * same
    by_dot = _kernel_gradient(dots).reshape(2 * count, count)
    spread = curvature.reshape(2 * count, 2 * count) - by_dot @ precision @ by_dot.T
    offset = points[:, None] - dots[None]
    r = np.sqrt(5) * np.linalg.norm(offset, axis=2)
    slope = 5 / 3 * (1 + r) * np.exp(-r)
    to_points = np.concatenate([slope * offset[:, :, a] + AFFINE_VARIANCE * points[:, a, None] for a in (0, 1)], axis=1)
    to_cells = to_points.reshape(len(mean_kernel), -1, 2 * count).mean(axis=1)
    cross = to_cells - mean_kernel @ gradient.reshape(2 * count, count).T
    return np.linalg.solve(spread + STRETCH_NOISE * np.eye(2 * count), cross.T).T


def _cell_points(size: tuple[int, int], shape: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(H * W, 2) centres, and (H * W * samples, 2) points inside the cells, of the centre square."""
    side = min(size)
    corner = np.array([(size[0] - side) // 2, (size[1] - side) // 2]) - 0.5

    def points(per_cell: int) -> NDArray[np.float64]:
        across = (np.arange(shape[1] * per_cell) + 0.5) * side / (shape[1] * per_cell)
        down = (np.arange(shape[0] * per_cell) + 0.5) * side / (shape[0] * per_cell)
        y, x = np.meshgrid(down, across, indexing="ij")
        grid = np.stack([x, y], axis=-1).reshape(shape[0], per_cell, shape[1], per_cell, 2)
        return grid.transpose(0, 2, 1, 3, 4).reshape(-1, 2) + corner

    return points(1), points(CELL_SAMPLES)
