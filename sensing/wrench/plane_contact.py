"""Where a plane touches an endcap, which way it faces, and how much friction is in use; with covariances.

    place = PlaneContactLaw(params, shear_mpa=0.68).of(wrench)           # wrench about the sphere's centre

Notes:
    The forces of a plane can be replaced by one force at the centre of pressure p, on the plane, and a torque about
    its normal n. About the sphere's centre, p x F + t n = T: with the plane's distance H from that centre, p follows
    from F, T and n. The shell yields under the force, so p lies beside H n. In axes away from the tip (x) and across
    (y), at a polar angle a of n, with forces in units of shear modulus times wall^2 and lengths of 8/65 of the radius
    (a shell sinks by about F R / (mu T^2), Reissner 1946),

        x = (k + c2 sin^2 a) Fx + (c4 sin 2a + c8 sin a) N,    y = (k + c3 sin^2 a) Fy,    k = c0 + c1 sqrt(N)

    which n must satisfy. Constants are fitted to the simulator (python bench/bench_contact.py): D=130 T=8, 1 to 40 N,
    tilts to 51 degrees; what they leave counts in the covariance. docs/contact.md has what they leave of other shells.
    Spheres and edges have no such normal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.frames import MM_PER_M
from sensing.records import Wrench
from sensing.wrench.load_scale import load_scale
from sensing.wrench.plane_kernels import plane_solution

Array = NDArray[np.float64]
LEAST_FORCE_N = 1.0  # E: at D=130 T=8: below it neither place nor direction is more than noise
# M (bench/bench_contact.py): c0 c1 of the yield, c2 c3 of its tilt, c4 of sin 2a, three of the depth, c8 of sin a
LAW = np.array([-0.0666, 1.0718, -0.3733, -0.1528, -0.2485, 1.446, -0.344, 0.034, 0.2768])
LEFT = 0.066, 0.0090  # M: standard deviations of x and y that the law leaves, of its unit of length
LEFT_OF_DEPTH = 0.06  # M: that of the depth, of the depth
# E: more of y per T/R over the fitted one, and of the depth per T/R beside it (python bench/bench_contact.py shells)
MORE_Y, MORE_OF_DEPTH = 0.66, 1.4
FITTED_RADIUS_MM, FITTED_LENGTH_MM = 65.0, 8.0  # of the shell that it was fitted to, and its unit of length there
ANY_ANGLE = math.pi**2 / 3  # variance of an angle of which nothing is known
STEPS = np.array([1e-3, 1e-3, 1e-3, 0.05, 0.05, 0.05, 1e-3, 1e-3])  # N, N mm, mm


@dataclass(frozen=True)
class PlaneContact:
    """A plane's contact; NaN where there is none.

    Attributes:
        position_mm: (3,) centre of pressure, endcap frame.
        normal: (3,) unit, out of the endcap.
        position_covariance: (3, 3) mm^2.
        normal_covariance: (3, 3), radians^2.
        friction_use: tangential over normal force: no coefficient of friction is smaller.
        friction_use_sd: standard deviation of ``friction_use``.
    """

    position_mm: Array
    normal: Array
    position_covariance: Array
    normal_covariance: Array
    friction_use: float
    friction_use_sd: float

    @property
    def known(self) -> bool:
        """Whether there is one."""
        return math.isfinite(self.friction_use)

    @property
    def position_sd_mm(self) -> float:
        """Root mean square of the standard deviations along the surface's two directions."""
        depth = float(self.normal @ self.position_covariance @ self.normal)
        return _spread(self.position_covariance, depth)

    @property
    def normal_sd_deg(self) -> float:
        """Root mean square of the normal's standard deviations about its two directions."""
        return math.degrees(_spread(self.normal_covariance, 0.0))

    def pose(self) -> tuple[Array, Array, Array]:
        """(position (3,) in m, quaternion x y z w that turns z to the normal, covariance (6, 6) in m and radians).

        The turn about the normal says nothing: its variance is that of any angle.
        """
        x, y, z = self.normal
        quaternion = np.array([-y, x, 0.0, 1.0 + z])
        length = float(np.linalg.norm(quaternion))
        quaternion = np.array([1.0, 0, 0, 0]) if length < 1e-9 else quaternion / length
        across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # a turn r moves the normal by r x n
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = self.position_covariance / MM_PER_M**2
        covariance[3:, 3:] = across @ self.normal_covariance @ across.T
        covariance[3:, 3:] += ANY_ANGLE * np.outer(self.normal, self.normal)
        return self.position_mm / MM_PER_M, quaternion, covariance


def _spread(covariance: Array, along: float) -> float:
    across = float(np.trace(covariance)) - along
    return math.sqrt(across / 2) if across >= 0 else math.nan


_NAN_3, _NAN_33 = np.full(3, np.nan), np.full((3, 3), np.nan)
NO_CONTACT = PlaneContact(_NAN_3, _NAN_3, _NAN_33, _NAN_33, math.nan, math.nan)


class PlaneContactLaw:
    """The law for one design and silicone.

    Args:
        params: the design.
        shear_mpa: shear modulus of its silicone.
    """

    def __init__(self, params: EndcapParams, shear_mpa: float) -> None:
        self._centre = np.array([0.0, 0.0, params.centre_height_mm])
        length_mm = params.outer_radius_mm * FITTED_LENGTH_MM / FITTED_RADIUS_MM
        self._size = params.outer_radius_mm, length_mm, shear_mpa * params.wall_mm**2
        self._least_n = LEAST_FORCE_N * load_scale(params.wall_mm, shear_mpa)
        thicker = params.wall_mm / params.outer_radius_mm - FITTED_LENGTH_MM / FITTED_RADIUS_MM  # there it is the wall
        self._left = (length_mm * np.array([LEFT[0], LEFT[1] + MORE_Y * max(0.0, thicker)])) ** 2
        self._left_of_depth = LEFT_OF_DEPTH + MORE_OF_DEPTH * abs(thicker)

    def of(self, wrench: Wrench) -> PlaneContact:
        """Contact of a wrench on the endcap about the sphere's centre; NaN without push, or below 1 N at D=130 T=8."""
        if not float(wrench.force_n @ wrench.force_n) >= self._least_n**2:
            return NO_CONTACT
        torque = MM_PER_M * wrench.torque_nm
        value, slopes = plane_solution(np.concatenate([wrench.force_n, torque]), STEPS, self._size, LAW)
        if not np.isfinite(value).all():
            return NO_CONTACT
        unit = np.repeat([1.0, MM_PER_M], 3)
        by_wrench, by_law = slopes[:, :6] * unit, slopes[:, 6:]
        covariance = by_wrench @ wrench.covariance @ by_wrench.T + (by_law * self._left) @ by_law.T
        normal = value[3:6]
        depth_mm = self._size[0] - float(normal @ value[:3])
        covariance[:3, :3] += (self._left_of_depth * depth_mm) ** 2 * np.outer(normal, normal)
        return PlaneContact(
            value[:3] + self._centre, normal, covariance[:3, :3], covariance[3:6, 3:6], float(value[6]),
            math.sqrt(covariance[6, 6]) if covariance[6, 6] >= 0 else math.nan,
        )  # fmt: skip


def pressure_point(force: Array, torque: Array, normal: Array, height_mm: float) -> Array:
    """(3,) centre of pressure on a plane, from the sphere's centre.

    Args:
        force: (3,) N.
        torque: (3,) N mm about the sphere's centre.
        normal: (3,) of the plane, out of the endcap.
        height_mm: of the plane over the sphere's centre.
    """
    push = -float(force @ normal)
    # with p = H n + q, q in the plane: n x (p x F) = p (n F) - F (n p), so q = -(n x T + H F') / push, F' across n
    return np.asarray(height_mm * normal - (np.cross(normal, torque) + height_mm * (force + push * normal)) / push)
