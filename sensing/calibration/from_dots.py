"""Camera calibration from one photo of the sensor's own dots: the lens, and where the camera sits.

The dots alone cannot tell the camera's height from its lens: on the axis of a sphere any height fits with some
radial function r(theta) (moving the pupil 35 mm changes the residual of the released photos by 2 %). So calibration
from dots is a maximum-posterior fit with stated priors (:class:`MountPrior`), and every parameter is reported with
its posterior deviation beside its prior's. A board calibration has no such weakness: use its lens here with ``--lens``.

Endcap and camera frames as in :mod:`sensing.camera.model`; lengths in mm, pixels in px.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cad.params import EndcapParams
from sensing.calibration.dots import NOISE_PX, CalibrationError, assign_dots, pattern_points
from sensing.camera.model import Array, FisheyeCamera, monotonic_half_angle_deg, radial
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.camera.nominal import K, nominal_mount

NAMES = (
    "f_px",
    "cx_px",
    "cy_px",
    "k1",
    "k2",
    "tilt_x_rad",
    "tilt_y_rad",
    "azimuth_rad",
    "pupil_x_mm",
    "pupil_y_mm",
    "pupil_z_mm",
)
STEP = np.array([100, 10, 10, 0.1, 0.05, 0.05, 0.05, 0.1, 1, 1, 3.0])  # typical sizes, for the solver's scaling
LENS = slice(0, 5)
OUTLIER_PX = 1.5  # residuals beyond this (smears, clipped dots) count linearly instead of squared
VIEW_HALF_ANGLE_DEG = 95.0


@dataclass(frozen=True)
class MountPrior:
    """What is believed before seeing a photo; standard deviations of Gaussian priors.

    Attributes:
        centre_px: optical axis against the frame's centre at 480 rows (M: the visible disc lies within 10 px).
        k: distortion k1, k2 about ``k_centre`` (E: lens to lens).
        tilt_deg: optical axis against the endcap's axis (E: four M2 screws in printed holes).
        lateral_mm: pupil off the endcap's axis (E: screw clearance).
        height_mm: pupil above the mating plane (E), about ``height_centre_mm``.
        k_centre: the nominal lens.
        height_centre_mm: ``None`` for ``params.camera_height_mm``.
    """

    centre_px: float = 8.0
    k: tuple[float, float] = (0.03, 0.02)
    tilt_deg: float = 2.0
    lateral_mm: float = 1.0
    height_mm: float = 1.5
    k_centre: tuple[float, float] = (K[0], K[1])
    height_centre_mm: float | None = None


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera and how good it is.

    Attributes:
        mounted: camera and pose.
        residual_px: (n, 2) predicted minus found, for the matched dots.
        pattern_index: (n,) which dot of ``cad.dots.dot_pattern`` each residual belongs to.
        found_px: (m, 2) all blobs.
        values: parameter name -> (value, posterior deviation, prior deviation; ``inf`` where free, 0 where held).
    """

    mounted: MountedCamera
    residual_px: Array
    pattern_index: NDArray[np.intp]
    found_px: Array
    values: dict[str, tuple[float, float, float]]

    @property
    def rms_px(self) -> float:
        """Root mean square distance of predicted and found dots."""
        return float(np.sqrt((self.residual_px**2).sum(1).mean()))

    @property
    def median_px(self) -> float:
        """Median distance of predicted and found dots."""
        return float(np.median(np.linalg.norm(self.residual_px, axis=1)))

    def report(self) -> str:
        """One line a parameter: value, deviation, and whether the photo or the prior decided it."""
        lines = [f"dots matched {len(self.residual_px)} of {len(self.found_px)} found"]
        lines.append(f"residual {self.rms_px:.2f} px rms, {self.median_px:.2f} px median")
        for name, (value, sigma, prior) in self.values.items():
            decided = "held" if prior == 0 else "photo" if sigma < 0.7 * prior else "mostly the prior"
            lines.append(f"{name:>11} {value:10.4f} +- {sigma:.4f}  ({decided})")
        return "\n".join(lines)


def calibrate_from_dots(
    found_px: Array,
    params: EndcapParams,
    size_px: tuple[int, int],
    *,
    prior: MountPrior | None = None,
    lens: FisheyeCamera | None = None,
    azimuth_hint_deg: float = 0.0,
) -> Calibration:
    """Camera and pose from the dots of one undeformed image.

    Args:
        found_px: (m, 2) blob centres, extra and missing ones allowed.
        params: the design (sphere and pattern are taken as exact).
        size_px: image width and height.
        prior: see :class:`MountPrior`.
        lens: intrinsics to hold fixed, for example from a board; only the pose is then fitted.
        azimuth_hint_deg: which half turn, because the pattern repeats after 180 degrees.

    Raises:
        CalibrationError: pattern not recognised or too few dots.
    """
    prior = prior or MountPrior()
    start = nominal_mount(params, *size_px)
    if lens is not None:
        start = MountedCamera(lens, start.T_camera_endcap)
    problem = _Problem.of(start, prior, params, hold_lens=lens is not None)
    pairs, mounted = assign_dots(found_px, params, start, problem.fit, azimuth_hint_deg)
    if len(pairs.blob_index) < 20:
        raise CalibrationError(f"{len(pairs.blob_index)} dots matched, at least 20 needed: sharper photo or dots CSV")
    points, pixels = pattern_points(params)[0][pairs.pattern_index], found_px[pairs.blob_index]
    vector, sigma = problem.solve(problem.vector(mounted), points, pixels)
    mounted = problem.camera(vector)
    values = {n: (float(v), float(s), float(p)) for n, v, s, p in zip(NAMES, vector, sigma, problem.sigma, strict=True)}
    return Calibration(mounted, mounted.project(points) - pixels, pairs.pattern_index, found_px, values)


@dataclass(frozen=True)
class _Problem:
    """The least-squares problem: parameter vector in the order of NAMES, prior mean and deviation."""

    size_px: tuple[int, int]
    tail: tuple[float, float]  # k3, k4
    aspect: float  # fy / fx
    mean: Array
    sigma: Array

    @classmethod
    def of(cls, start: MountedCamera, prior: MountPrior, params: EndcapParams, hold_lens: bool) -> _Problem:
        camera = start.camera
        tilt = np.radians(prior.tilt_deg)
        centre = prior.centre_px * camera.height_px / 480
        height = params.camera_height_mm if prior.height_centre_mm is None else prior.height_centre_mm
        k_centre = camera.k[:2] if hold_lens else prior.k_centre
        mean = [camera.fx_px, camera.cx_px, camera.cy_px, *k_centre, 0, 0, 0, 0, 0, height]
        pose = [tilt, tilt, np.inf, prior.lateral_mm, prior.lateral_mm, prior.height_mm]
        sigma = np.array([np.inf, centre, centre, *prior.k, *pose])
        if hold_lens:
            sigma[LENS] = 0
        size = (camera.width_px, camera.height_px)
        return cls(size, camera.k[2:], camera.fy_px / camera.fx_px, np.array(mean), sigma)

    def camera(self, vector: Array) -> MountedCamera:
        """Camera of a parameter vector; the view is cut where the lens would fold."""
        focal, cx, cy, k1, k2 = vector[LENS]
        k = (k1, k2, *self.tail)
        view = min(VIEW_HALF_ANGLE_DEG, 0.99 * monotonic_half_angle_deg(k))
        lens = FisheyeCamera(*self.size_px, focal, focal * self.aspect, cx, cy, k, view)
        return mount(lens, vector[8:11], _rotation(vector))

    def vector(self, mounted: MountedCamera) -> Array:
        """Parameter vector of a camera."""
        camera, R = mounted.camera, mounted.T_camera_endcap[:3, :3]
        # R = Rx(tilt_x) Ry(tilt_y) Rz(azimuth) up to second order in the tilts: exact inverse for the axis below
        axis = R[:, 2]
        tilt = np.cross([0, 0, 1.0], axis)
        length = np.linalg.norm(tilt)
        tilt = tilt / length * np.arctan2(length, axis[2]) if length > 0 else tilt
        turn = rotation_matrix([tilt[0], tilt[1], 0]).T @ R
        azimuth = np.arctan2(turn[1, 0], turn[0, 0])
        lens = [camera.fx_px, camera.cx_px, camera.cy_px, camera.k[0], camera.k[1]]
        return np.array([*lens, tilt[0], tilt[1], azimuth, *mounted.pupil_endcap_mm])

    def fit(self, mounted: MountedCamera, points: Array, pixels: Array) -> MountedCamera:
        """Refined camera (the callback of the assignment)."""
        return self.camera(self.solve(self.vector(mounted), points, pixels)[0])

    def solve(self, start: Array, points: Array, pixels: Array) -> tuple[Array, Array]:
        """Maximum posterior and its deviations (Laplace, scaled by the dots' own scatter)."""
        free = self.sigma > 0
        known = np.isfinite(self.sigma) & free
        noise = NOISE_PX * self.size_px[1] / 480
        start = np.where(free, start, self.mean)

        def residual(values: Array) -> Array:
            vector = start.copy()
            vector[free] = values
            error = self._project(vector, points) - pixels
            return np.concatenate(
                [error.ravel() / noise, ((vector - self.mean) / np.where(known, self.sigma, 1))[known]]
            )

        found = least_squares(
            residual, start[free], x_scale=STEP[free], loss="soft_l1", f_scale=OUTLIER_PX / NOISE_PX, max_nfev=200
        )
        vector, sigma = start.copy(), np.zeros(len(start))
        vector[free] = found.x
        scatter = max(1.0, 1.4826 * float(np.median(np.abs(residual(found.x)[: 2 * len(points)]))))
        sigma[free] = scatter * np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)))
        return vector, np.minimum(sigma, np.where(known, self.sigma, np.inf))

    def _project(self, vector: Array, points: Array) -> Array:
        """Projection without the checks of FisheyeCamera: the solver may pass through lenses that fold."""
        x, y, z = ((points - vector[8:11]) @ _rotation(vector).T).T
        rho = np.hypot(x, y)
        r = radial(np.arctan2(rho, z), np.array([vector[3], vector[4], *self.tail]))[0]
        scale = vector[0] * r / np.maximum(rho, 1e-12)
        return np.stack([scale * x + vector[1], self.aspect * scale * y + vector[2]], -1)


def _rotation(vector: Array) -> Array:
    return rotation_matrix([vector[5], vector[6], 0]) @ rotation_matrix([0, 0, vector[7]])
