"""The least-squares problem behind calibration from dots: prior, dots and their scatter in; camera and covariance out.

Dots scatter on the dome, by the hand that painted them, and in the picture, by the finder; both are modelled, so a dot
near the rim, where a millimetre is many pixels along its ring and few across, counts as it deserves. The common factor
of both is estimated from the residuals. Lengths in mm, pixels in px; parameters as in :mod:`sensing.camera.parameters`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.calibration.prior import MountPrior
from sensing.camera.model import Array, radial
from sensing.camera.mount import MountedCamera
from sensing.camera.parameters import POSE, camera_at, camera_vector, rotation_of

STEP = np.array([100, 10, 10, 0.1, 0.05, 0.05, 0.05, 0.1, 1, 1, 3.0])  # typical sizes, for the solver's scaling
PAINT_MM = 0.2  # scatter of the ink's centre on the dome (M: with the finder's 0.3 mm, 1 px on the photos)
FINDER_PX = 0.45  # of a found centre at 480 rows (M: rendered frames, 0.3 at the tip to 0.6 at the rim)
OUTLIER = 1.5  # residuals beyond so many deviations (smears, clipped dots) count linearly instead of squared
MOST_STEPS = 50  # iterations of the solver
LEAST_GAIN, NEAR_ENOUGH = 1e-10, 1e-3  # of the cost, by a last step: of a result, of a camera that only sorts dots
LEAST_SCATTER = 0.05  # dots of a drawing scatter less than painted ones, but rounding is no evidence


@dataclass(frozen=True)
class Fit:
    """A fitted camera.

    Attributes:
        mounted: the camera.
        vector: its numbers (11,).
        covariance: (11, 11) of them (Laplace's approximation).
        prior_deviation: (11,), ``inf`` where free, 0 where held.
        scatter: of the dots against the assumed one, a factor.
        log_evidence: log probability of the dots under the prior, up to a constant of the dots alone.
    """

    mounted: MountedCamera
    vector: Array
    covariance: Array
    prior_deviation: Array
    scatter: float
    log_evidence: float


@dataclass(frozen=True)
class Problem:
    """Prior and picture; make it with :meth:`of`.

    Attributes:
        start: gives picture size, aspect and higher distortion.
        mean, sigma: (11,) of the prior.
    """

    start: MountedCamera
    mean: Array
    sigma: Array

    @classmethod
    def of(cls, start: MountedCamera, prior: MountPrior, hold_lens: bool = False) -> Problem:
        """The problem of a prior about a start camera.

        Args:
            start: the start camera.
            prior: standard deviations about it.
            hold_lens: whether its lens is held.
        """
        return cls(start, prior.mean(start, hold_lens), prior.deviations(start, hold_lens))

    def refine(self, mounted: MountedCamera, points: Array, pixels: Array) -> MountedCamera:
        """Refined camera (the callback of the assignment): near enough to know each dot from its neighbours.

        Args:
            mounted: where the fit starts.
            points: (n, 3) dots of the pattern, endcap frame, mm.
            pixels: (n, 2) of the same dots.
        """
        if not (self.sigma > 0).any():
            return self.start
        whiten = self.whitening(mounted, points)
        vector, *_ = self._solve(self._start(mounted), points, pixels, whiten, NEAR_ENOUGH)
        return camera_at(vector, self.start)

    def solve(self, near: MountedCamera, points: Array, pixels: Array, scatter: float | None = None) -> Fit:
        """Maximum of the posterior.

        Args:
            near: where to start.
            points: (n, 3) endcap frame.
            pixels: (n, 2) where they are seen.
            scatter: of the dots against the assumed one; None to estimate it.
        """
        start = self._start(near)
        whiten = self.whitening(near, points)
        factor, fit = scatter or 1.0, None
        if not (self.sigma > 0).any():
            return self._exact(points, pixels, whiten / factor, factor)
        for _ in range(1 if scatter else 3):
            fit = self._solve(start, points, pixels, whiten / factor)
            residual = np.einsum("nab,nb->na", whiten, self.project(fit[0], points) - pixels)
            lost = min(0.5, np.count_nonzero(self.sigma > 0) / residual.size)
            if scatter is None:
                spread = 1.4826 * float(np.median(np.abs(residual))) / np.sqrt(1 - lost)
                factor = max(LEAST_SCATTER, spread)
            start = fit[0]
        assert fit is not None
        vector, covariance, evidence = fit
        return Fit(camera_at(vector, self.start), vector, covariance, self.sigma, factor, evidence)

    def _start(self, near: MountedCamera) -> Array:
        return np.where(self.sigma > 0, camera_vector(near), self.mean)

    def _solve(
        self, start: Array, points: Array, pixels: Array, whiten: Array, least_gain: float = LEAST_GAIN
    ) -> tuple[Array, Array, float]:
        """(vector, covariance, log evidence) with known scatter."""
        free = self.sigma > 0
        known = np.isfinite(self.sigma) & free
        width = np.where(known, self.sigma, 1.0)

        def residual(values: Array) -> Array:
            vector = np.empty((*values.shape[:-1], len(start)))
            vector[...], vector[..., free] = start, values
            error = (whiten @ (self.project(vector, points) - pixels)[..., None])[..., 0]
            far = ((vector - self.mean) / width)[..., known]
            return np.concatenate([error.reshape(*values.shape[:-1], -1), far], axis=-1)

        squared = np.arange(2 * len(points) + np.count_nonzero(known)) >= 2 * len(points)  # the prior: no outliers
        values, cost, information = minimise(residual, start[free], STEP[free], squared, least_gain)
        vector, covariance = start.copy(), np.zeros((len(start), len(start)))
        vector[free] = values
        covariance[np.ix_(free, free)] = np.linalg.inv(information)
        flat = np.count_nonzero(np.isinf(self.sigma[POSE])) * np.log(
            np.sqrt(2 * np.pi) / np.pi
        )  # azimuth, +-90 degrees
        log_prior = flat - np.log(self.sigma[known]).sum()
        return vector, covariance, float(log_prior - cost - 0.5 * np.linalg.slogdet(information)[1])

    def _exact(self, points: Array, pixels: Array, whiten: Array, scatter: float) -> Fit:
        """The start camera itself."""
        residual = np.einsum("nab,nb->na", whiten, self.project(self.mean, points) - pixels)
        cost = _cost(residual.ravel(), np.zeros(residual.size, bool))
        none = np.zeros((len(self.mean), len(self.mean)))
        return Fit(self.start, self.mean, none, self.sigma, scatter, float(-cost))

    def whitening(self, mounted: MountedCamera, points: Array) -> Array:
        """(n, 2, 2) inverse roots of the dots' assumed covariances in the picture."""
        camera_points = mounted.to_camera(points)
        by_point = mounted.camera.jacobians(camera_points)[0] @ mounted.T_camera_endcap[:3, :3]
        outward = points - self._centre(points)
        outward = outward / np.linalg.norm(outward, axis=1)[:, None]
        along = by_point - np.einsum("nab,nb,nc->nac", by_point, outward, outward)  # motions on the dome alone
        finder = FINDER_PX * self.start.camera.height_px / 480
        covariance = PAINT_MM**2 * along @ along.transpose(0, 2, 1) + finder**2 * np.eye(2)
        return np.linalg.inv(np.linalg.cholesky(covariance))

    def _centre(self, points: Array) -> Array:
        """Centre (3,) of the sphere on which the points lie: exact for a dome's dots, four suffice."""
        system = np.column_stack([2 * points, np.ones(len(points))])
        return np.linalg.lstsq(system, (points**2).sum(1), rcond=None)[0][:3]

    def project(self, vector: Array, points: Array) -> Array:
        """Projection without the checks of FisheyeCamera: the solver may pass through lenses that fold.

        Args:
            vector: (..., 11) cameras.
            points: (n, 3) endcap frame, mm.

        Returns:
            (..., n, 2) px.
        """
        camera = self.start.camera
        there = (points - vector[..., None, 8:11]) @ np.swapaxes(rotation_of(vector), -1, -2)
        x, y, z = there[..., 0], there[..., 1], there[..., 2]
        rho = np.hypot(x, y)
        k = vector[..., 3:4], vector[..., 4:5], camera.k[2], camera.k[3]
        scale = vector[..., :1] * radial(np.arctan2(rho, z), k)[0] / np.maximum(rho, 1e-12)
        seen = np.empty((*rho.shape, 2))
        seen[..., 0] = scale * x + vector[..., 1:2]
        seen[..., 1] = camera.fy_px / camera.fx_px * scale * y + vector[..., 2:3]
        return seen


def minimise(
    residual: Callable[[Array], Array],
    start: Array,
    scale: Array,
    squared: NDArray[np.bool_],
    least_gain: float = LEAST_GAIN,
) -> tuple[Array, float, Array]:
    """Least squares that count outliers linearly (Levenberg and Marquardt's steps, reweighted).

    Args:
        residual: (..., n) numbers to (..., m) residuals in deviations.
        start: (n,).
        scale: (n,) typical sizes.
        squared: (m,) residuals that count squared however large.
        least_gain: ends the steps: a step lowers the cost by less than this share.

    Returns:
        (numbers, cost, information (n, n)): the information is that of plain least squares at the minimum.
    """
    at, error, damping = start, residual(start), 1e-3
    cost = _cost(error, squared)
    for _ in range(MOST_STEPS):
        J = numeric_jacobian(residual, at, scale) * scale
        weight = np.where(squared, 1.0, 1 / np.sqrt(1 + (error / OUTLIER) ** 2))
        normal, slope = (J.T * weight) @ J, (J.T * weight) @ error
        while damping < 1e9:
            step = -scale * np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), slope)
            new = residual(at + step)
            lower = _cost(new, squared)
            if lower <= cost:
                break
            damping *= 10
        else:
            break
        gained, at, error, cost, damping = cost - lower, at + step, new, lower, max(damping / 10, 1e-9)
        if gained <= least_gain * (1 + cost):
            break
    J = numeric_jacobian(residual, at, scale)
    return at, cost, J.T @ J


def _cost(residual: Array, squared: NDArray[np.bool_]) -> float:
    """Half the sum of squares, of dots in Huber's smooth form: linear beyond :data:`OUTLIER`."""
    smooth = OUTLIER**2 * (np.sqrt(1 + (residual / OUTLIER) ** 2) - 1)
    return float(np.where(squared, residual**2 / 2, smooth).sum())


def numeric_jacobian(function: Callable[[Array], Array], at: Array, scale: Array) -> Array:
    """(m, n) derivatives by central differences.

    Args:
        function: (..., n) to (..., m): all steps go through it at once.
        at: (n,) where.
        scale: (n,) typical sizes of the numbers; a step is 1e-4 of them.
    """
    step = 1e-4 * scale
    more, less = np.split(function(at + np.concatenate([np.diag(step), -np.diag(step)])), 2)
    return np.asarray(((more - less) / (2 * step[:, None])).T)
