"""The bound on the wrench error that dots and tracker allow (Cramer-Rao), by tilt and load, for any design.

A plane on the endcap has five parameters: tilt and azimuth of the first touch, normal force, two tangential forces. The
dots' pixels y depend on them with slopes J, the wrench w with slopes W; with independent tracking errors of variance S
no unbiased estimator has a smaller covariance than W (J' S^-1 J)^-1 W' (Cramer 1946; Kay 1993, ch. 3). S is the
measured error that training has, too (:class:`sensing.learning.marker_fields.Scatter`). Slopes come from a quadratic
fit to the library's states round the parameters, the azimuth's from a turn.

Left out: calibration, paint beside its place, friction's path. So it is a lower bound on the noise of one frame, and
does not predict the error of trained weights. N, N m about the sphere's centre; 640 x 480 px.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.learning.marker_fields import BORDER_PX, Scatter
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.similarity.library import load_library
from sensing.simulator.similarity.paths import library_paths, touching_steps
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios, wrench_units
from sensing.simulator.similarity.surface_modes import modes_at
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.wrench.load_scale import RELEASED_RADIUS_MM

Mask = NDArray[np.bool_]
NEAR_TILT_DEG, NEAR_SHARE = 9.0, 0.5  # E: widths of the fit: tilt, degrees, and part of the load
STEP_DEG = 1.0  # turn by which the slope of the azimuth is computed
SIZE_PX = np.array([640, 480])  # size of the pictures


@dataclass(frozen=True)
class Bound:
    """Cramér-Rao bound of a wrench from the dots at one tilt and load.

    Attributes:
        tilt_deg, normal_n: tilt, degrees, and normal force, N.
        wrench: (6,) there, N and N m about the sphere's centre.
        covariance: (6, 6) smallest covariance of any unbiased estimator.
        moved_px: root mean square of the dots' displacement, px.
        dots: number of dots in view.
    """

    tilt_deg: float
    normal_n: float
    wrench: Array
    covariance: Array
    moved_px: float
    dots: int

    @property
    def sigma(self) -> Array:
        """(6,) standard deviations by axis, N and N m."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def force_n(self) -> float:
        """Root mean square of the force's error over the three axes, N."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3]) / 3))

    @property
    def px_per_n(self) -> float:
        """Root mean square displacement of the dots over the load, px/N."""
        return self.moved_px / self.normal_n

    def weakest(self, radius_mm: float) -> Array:
        """(6,) direction of the wrench with the largest error; 0.15 N weigh as much as 0.02 N m at D=130.

        Args:
            radius_mm: outer radius, with which torques grow.
        """
        weight = np.diag(np.repeat([1.0, 7.5 * RELEASED_RADIUS_MM / radius_mm], 3))
        return np.linalg.eigh(weight @ self.covariance @ weight)[1][:, -1]


class DesignBound:
    """Bounds of one design and silicone.

    Args:
        params: design.
        geometry: geometry of its shell.
        shear_mpa: shear modulus of its silicone, MPa.

    Raises:
        ParameterError: a design outside the library.
    """

    def __init__(self, params: EndcapParams, geometry: ShellGeometry, shear_mpa: float) -> None:
        library = load_library()
        weights, known = library.state_weights(library.travel, ShellRatios.of(geometry))
        self.scale = LoadScale.of(geometry, shear_mpa)
        self._camera, self._radius = nominal_mount(params, *SIZE_PX), geometry.outer_radius_mm
        self._coefficients = library.travel.mixed(weights, "coefficients")
        travel = library.travel.mixed(weights, "wrench") * ShellRatios.of(geometry).wall ** 2
        self._wrench = travel * wrench_units(self._radius, shear_mpa) / np.repeat([1.0, 1000.0], 3)
        self._places = _places(self._wrench, self.scale, known)
        directions = np.array([dot.direction for dot in dot_pattern(params)])
        self._rest = np.array(geometry.centre_mm) + geometry.inner_radius_mm * directions
        self._modes = [self._radius * modes_at(library, geometry, directions, a) for a in (0.0, -STEP_DEG, STEP_DEG)]

    def rest_px(self) -> Array:
        """(d, 2) image points of the untouched endcap's dots in view, px."""
        pixels = self._camera.project(self._rest)
        return pixels[_seen(pixels)]

    def at(self, tilt_deg: float, normal_n: float) -> Bound:
        """Bound at a load without tangential force.

        Args:
            tilt_deg: polar angle of first touch, 5 to 52 degrees.
            normal_n: normal force, N.
        """
        reference_n = normal_n / self.scale.force
        tilt, normal, *_ = self._places.T
        near = np.exp(
            -(((tilt - tilt_deg) / NEAR_TILT_DEG) ** 2)
            - ((normal - reference_n) / (NEAR_SHARE * reference_n + 2.0)) ** 2
            - (self._places[:, 2:] ** 2).sum(axis=1) / (NEAR_SHARE * reference_n + 2.0) ** 2
        )
        offset = self._places - np.array([tilt_deg, reference_n, 0.0, 0.0])
        fit = _quadratic(offset, np.sqrt(near), np.concatenate([self._coefficients, self._wrench], axis=1))
        count = self._coefficients.shape[1]
        place, slopes = fit[0], fit[1:5]
        slopes = slopes / np.array([1.0, self.scale.force, self.scale.force, self.scale.force])[:, None]
        here, before, after = (np.tensordot(place[:count], modes, axes=1) for modes in self._modes)
        by_turn = (after - before) / (2 * STEP_DEG)
        moves = [*(np.tensordot(slope[:count], self._modes[0], axes=1) for slope in slopes), by_turn]
        return self._bound(tilt_deg, normal_n, here, moves, place[count:], slopes[:, count:])

    def _bound(
        self, tilt_deg: float, normal_n: float, here: Array, moves: list[Array], wrench: Array, slopes: Array
    ) -> Bound:
        pixels, rest = self._camera.project(self._rest + here), self._camera.project(self._rest)
        seen = _seen(rest) & _seen(pixels)
        step = 1e-3
        jacobian = np.array(
            [(self._camera.project(self._rest + here + step * move) - pixels)[seen] / step for move in moves]
        ).reshape(5, -1)
        far = np.linalg.norm((pixels - rest)[seen], axis=1)
        sigma = Scatter().tracking_px(far)
        turned = np.concatenate([np.cross([0, 0, 1.0], wrench[:3]), np.cross([0, 0, 1.0], wrench[3:])])
        by_place = np.vstack([slopes, turned * np.pi / 180])
        covariance = smallest_covariance(jacobian, np.repeat(sigma, 2) ** 2, by_place)
        moved = float(np.sqrt((far**2).mean()))
        return Bound(tilt_deg, normal_n, wrench, covariance, moved, int(seen.sum()))


def smallest_covariance(by_pixel: Array, noise: Array, by_answer: Array, known: Array | None = None) -> Array:
    """(k, k) smallest covariance of any unbiased estimate of k answers: W' (J N^-1 J' + K)^-1 W.

    Args:
        by_pixel: J (p, m), derivative of m measurements by p parameters.
        noise: N (m,) variances, or (m, m) covariance of the measurements.
        by_answer: W (p, k), derivative of k answers by the parameters.
        known: K (p, p), prior information (the inverse covariance of a prior); None without.
    """
    weighted = by_pixel / noise if noise.ndim == 1 else np.linalg.solve(noise, by_pixel.T).T
    information = weighted @ by_pixel.T + (0.0 if known is None else known)
    size = np.sqrt(np.diag(information))  # parameters have different units
    root = np.linalg.solve(np.linalg.cholesky(information / size / size[:, None]), by_answer / size[:, None])
    return np.asarray(root.T @ root)


def _seen(pixels: Array) -> Mask:
    inside = (pixels > BORDER_PX - 0.5) & (pixels < SIZE_PX - BORDER_PX - 0.5)
    return np.asarray(inside.all(axis=1))


def _places(wrench: Array, scale: LoadScale, known: Mask) -> Array:
    """(S, 4) tilt, normal and two tangential forces of every state, in loads of D=130 T=8; NaN where unknown."""
    rows, row = np.full((len(wrench), 4), np.nan), 0
    for path in library_paths():
        frame = Indenter(path.tilt_deg).frame()
        for _ in touching_steps(path):
            outward, meridian, lateral = wrench[row, :3] @ frame / scale.force
            if known[row]:
                rows[row] = path.tilt_deg, -outward, meridian, lateral
            row += 1
    return rows


def quadratic_terms(x: Array) -> Array:
    """(s, 1 + n + n (n + 1) / 2) columns of a quadratic fit: one, coordinates (s, n) and their products."""
    pairs = [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])]
    return np.column_stack([np.ones(len(x)), x, *pairs])


def _quadratic(offset: Array, weight: Array, values: Array) -> Array:
    """(1 + n, k) value and slopes at offset 0 of a weighted quadratic fit to values (s, k) at offsets (s, n)."""
    use = np.isfinite(offset).all(axis=1) & (weight > 1e-4)
    x = offset[use]
    table = quadratic_terms(x)
    size = np.abs(table).max(axis=0)
    rows = weight[use][:, None]
    solved = np.linalg.lstsq(rows * table / size, rows * values[use], rcond=1e-8)[0]
    return (solved / size[:, None])[: 1 + x.shape[1]]
