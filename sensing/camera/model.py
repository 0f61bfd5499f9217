"""Fisheye camera: where a point is seen, which ray a pixel looks along, and the derivatives of both.

The angle from the optical axis is taken with ``atan2``, so points beside and behind the camera (half angle over 90
degrees) are imaged like any other; the common implementations divide by depth and fail there.

Camera frame: origin at the entrance pupil, x right, y down, z along the optical axis (OpenCV's convention). Lengths in
mm, angles in radians unless the name says otherwise. Pixel (0, 0) is the *centre* of the top-left pixel.

Model (Kannala and Brandt 2006, doi:10.1109/TPAMI.2006.153, with the even symmetry of their first part):

    theta = atan2(sqrt(x^2 + y^2), z)
    r(theta) = theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9
    u = fx r x / sqrt(x^2 + y^2) + cx,    v = fy r y / sqrt(x^2 + y^2) + cy

NumPy only.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cad.errors import ParameterError

Array = NDArray[np.float64]
PARAMETER_NAMES = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "k3", "k4")
_POWERS = np.array([3, 5, 7, 9])


@dataclass(frozen=True)
class FisheyeCamera:
    """Intrinsics of a fisheye camera.

    Attributes:
        width_px: image width.
        height_px: image height.
        fx_px: focal length along x: pixels per radian on the axis.
        fy_px: focal length along y.
        cx_px: column of the optical axis.
        cy_px: row of the optical axis.
        k: distortion coefficients k1..k4 of the module's equation.
        max_half_angle_deg: largest angle from the axis that is imaged; points beyond it project to ``nan``.

    Raises:
        ParameterError: a number that is not finite or positive, or a radius that does not grow with the angle
            everywhere up to ``max_half_angle_deg`` (then a pixel would belong to two rays).
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    k: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    max_half_angle_deg: float = 95.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "k", tuple(float(c) for c in self.k))
        for name in ("width_px", "height_px", "fx_px", "fy_px"):
            require(math.isfinite(getattr(self, name)) and getattr(self, name) > 0, name, getattr(self, name), "> 0")
        for name in ("cx_px", "cy_px"):
            require(math.isfinite(getattr(self, name)), name, getattr(self, name), "finite")
        require(len(self.k) == 4 and all(map(math.isfinite, self.k)), "k", self.k, "four finite numbers")
        angle = self.max_half_angle_deg
        require(0 < angle < 180, "max_half_angle_deg", angle, "between 0 and 180")
        limit = monotonic_half_angle_deg(self.k)
        if angle > limit:
            raise ParameterError(
                f"max_half_angle_deg={angle:g} over {limit:.4g}: with k={self.k} the radius stops growing there and "
                f"a pixel would belong to two rays; lower max_half_angle_deg or calibrate again",
                name="max_half_angle_deg",
                value=angle,
            )

    @property
    def parameters(self) -> Array:
        """The eight numbers of :data:`PARAMETER_NAMES`, shape (8,)."""
        return np.array([self.fx_px, self.fy_px, self.cx_px, self.cy_px, *self.k])

    @property
    def max_half_angle(self) -> float:
        """Largest imaged angle from the axis, radians."""
        return math.radians(self.max_half_angle_deg)

    def radius(self, theta: ArrayLike) -> Array:
        """Image radius in units of the focal length at angles ``theta`` (radians, any shape)."""
        return radial(np.asarray(theta, dtype=float), np.array(self.k))[0]

    def project(self, points_camera_mm: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera frame; ``nan`` beyond the view and at the pupil itself."""
        points = points_array(points_camera_mm, 3)
        rho = np.hypot(points[..., 0], points[..., 1])
        theta = np.arctan2(rho, points[..., 2])
        scale = np.divide(self.radius(theta), rho, out=np.zeros_like(rho), where=rho > 0)
        pixels = np.stack(
            [self.fx_px * scale * points[..., 0] + self.cx_px, self.fy_px * scale * points[..., 1] + self.cy_px], -1
        )
        seen = (theta <= self.max_half_angle) & ((rho > 0) | (points[..., 2] > 0))
        return np.where(seen[..., None], pixels, np.nan)

    def jacobians(self, points_camera_mm: ArrayLike) -> tuple[Array, Array]:
        """Derivatives of :meth:`project`.

        Args:
            points_camera_mm: points (..., 3) in the camera frame, off the pupil.

        Returns:
            (..., 2, 3) by the point (px/mm) and (..., 2, 8) by :data:`PARAMETER_NAMES`.
        """
        points = points_array(points_camera_mm, 3)
        x, y, z = np.moveaxis(points, -1, 0)
        rho = np.hypot(x, y)
        theta = np.arctan2(rho, z)
        r, slope = radial(theta, np.array(self.k))
        square = rho**2 + z**2
        on_axis = rho < 1e-9 * np.abs(z)
        rho_safe = np.where(on_axis, 1.0, rho)
        unit = np.stack([x, y], -1) / rho_safe[..., None]
        unit = np.where(on_axis[..., None], 0.0, unit)
        tangential = np.where(on_axis, 1.0 / np.where(z == 0, 1.0, z), r / rho_safe)
        radial_rate = slope * z / square
        focal = np.array([self.fx_px, self.fy_px])

        by_point = np.empty((*rho.shape, 2, 3))
        outer = unit[..., :, None] * unit[..., None, :]
        by_point[..., :2] = (
            tangential[..., None, None] * np.eye(2) + (radial_rate - tangential)[..., None, None] * outer
        )
        by_point[..., 2] = -unit * (slope * rho / square)[..., None]
        by_point *= focal[:, None]

        by_parameter = np.zeros((*rho.shape, 2, 8))
        by_parameter[..., 0, 0] = r * unit[..., 0]
        by_parameter[..., 1, 1] = r * unit[..., 1]
        by_parameter[..., 0, 2] = by_parameter[..., 1, 3] = 1.0
        powers = theta[..., None] ** _POWERS
        by_parameter[..., 4:] = (focal * unit)[..., :, None] * powers[..., None, :]
        return by_point, by_parameter

    def unproject(self, pixels: ArrayLike) -> Array:
        """Unit rays (..., 3) in the camera frame of pixels (..., 2); ``nan`` outside the image circle.

        The radius is inverted by a table, then Newton steps held inside the table's interval (round trip 1e-12; 1e-6
        where a lens folds just at the end of its view).
        """
        pixels = points_array(pixels, 2)
        x = (pixels[..., 0] - self.cx_px) / self.fx_px
        y = (pixels[..., 1] - self.cy_px) / self.fy_px
        r = np.hypot(x, y)
        theta = self._angle(r)
        sine_over_r = np.divide(np.sin(theta), r, out=np.ones_like(r), where=r > 0)
        return np.stack([x * sine_over_r, y * sine_over_r, np.cos(theta)], -1)

    def _angle(self, r: Array) -> Array:
        """Angle from the axis at image radius ``r`` (units of f); ``nan`` beyond the view."""
        k = np.array(self.k)
        nodes = np.linspace(0.0, self.max_half_angle, 257)
        table = radial(nodes, k)[0]
        inside = r <= table[-1] * (1 + 1e-12)
        cell = np.clip(np.searchsorted(table, np.where(inside, r, 0.0)) - 1, 0, len(nodes) - 2)
        theta = np.interp(np.where(inside, r, 0.0), table, nodes)
        for _ in range(6):
            value, slope = radial(theta, k)
            change = np.divide(value - r, slope, out=np.zeros_like(r), where=slope > 0)  # flat where the lens folds
            theta = np.clip(theta - change, nodes[cell], nodes[cell + 1])
        return np.where(inside, theta, np.nan)

    def resized(self, width_px: int, height_px: int) -> FisheyeCamera:
        """The camera of the image resampled to a new size (pixel edges stay edges, as in area averaging)."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return self._replace(
            width_px,
            height_px,
            fx_px=self.fx_px * sx,
            fy_px=self.fy_px * sy,
            cx_px=(self.cx_px + 0.5) * sx - 0.5,
            cy_px=(self.cy_px + 0.5) * sy - 0.5,
        )

    def _replace(self, width_px: int, height_px: int, **changes: float) -> FisheyeCamera:
        return FisheyeCamera(**{**asdict(self), "width_px": width_px, "height_px": height_px, **changes})


def radial(theta: Array, k: Array | tuple[Array | float, ...]) -> tuple[Array, Array]:
    """The module's r(theta) and its derivative, both in the shape of ``theta``; k: k1 to k4."""
    square = theta * theta
    k1, k2, k3, k4 = k
    r = theta * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    slope = 1 + square * (3 * k1 + square * (5 * k2 + square * (7 * k3 + square * 9 * k4)))
    return r, slope


def monotonic_half_angle_deg(k: ArrayLike) -> float:
    """Largest angle (degrees, at most 180) up to which r(theta) grows: the first root of r'(theta)."""
    slope = np.array([1.0, 3.0, 5.0, 7.0, 9.0]) * np.concatenate([[1.0], np.asarray(k, dtype=float)])
    slope[np.abs(slope) * np.pi ** (2.0 * np.arange(5)) < 1e-14] = 0.0  # too small to matter, and would overflow
    roots = np.roots(slope[::-1])
    real = roots[np.isreal(roots)].real
    squares = real[real > 0]
    return min(180.0, math.degrees(math.sqrt(squares.min()))) if len(squares) else 180.0


def points_array(values: ArrayLike, size: int) -> Array:
    """Points (..., size) as an array.

    Raises:
        ParameterError: another last axis.
    """
    points = np.asarray(values, dtype=float)
    if points.ndim == 0 or points.shape[-1] != size:
        raise ParameterError(f"points of shape {points.shape}: the last axis must have {size} numbers")
    return points


def require(condition: bool, name: str, value: object, accepted: str) -> None:
    """Refuse a parameter with what would be accepted.

    Args:
        condition: whether it is valid.
        name, value: the parameter.
        accepted: what would be, in words ("must be ...").
    """
    if not condition:
        raise ParameterError(f"{name}={value} is not valid: must be {accepted}", name=name, value=value)
