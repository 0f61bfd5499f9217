"""Wrenches in the frames of endcap, sphere, force sensor and joint; every sign convention of the project.

Frames (right-handed; translations in mm, torques in N m):

==========  =====================================================================================================
endcap      origin at the centre of the mating plane, z toward the tip (:mod:`cad.params`)
sphere      axes of the endcap, origin at the centre of the silicone sphere, where torque and force correlate least
ft          axes and reference point of the force/torque sensor's data sheet; :class:`FtMount` holds its pose
joint, ...  any rigid frame: give its pose ``T_joint_endcap``
==========  =====================================================================================================

``T_a_b`` takes coordinates in b to coordinates in a. Signs:

- A :class:`sensing.records.Wrench` is exerted by the world **on the endcap**; pressing on the tip gives Fz < 0.
- A force sensor under the plane that the endcap presses reads the opposite: ``reads = REACTION``.
- The authors' labels are of that kind, and their nodes publish the negated prediction (M, NET09), which
  is therefore the wrench on the endcap: ``wrench = AUTHORS_LABEL_SIGN * label``. That their label is the force *on the
  plane* is our reading of that minus (E), and that their "endcap sensor centre" is the sphere's centre too (E).
- Image u runs along the endcap's x and v along its y for a camera mounted without rotation.

Notes:
    With R, p of ``T_target_source``: f' = R f, t' = R t + p x R f (Featherstone 2008, eq. 2.25; Murray, Li, Sastry
    1994, eq. 2.66). A twist (v, w) with v of the origin goes v' = R v + p x R w, w' = R w, so that f.v + t.w
    is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.records import Wrench

Array = NDArray[np.float64]
ACTION, REACTION = 1, -1  # a sensor reads the wrench on the endcap, or the wrench of the endcap on the sensor
AUTHORS_LABEL_SIGN = REACTION
MM_PER_M = 1000.0


def pose(rotation: ArrayLike, translation_mm: ArrayLike) -> Array:
    """(4, 4) rigid transform from a rotation (3, 3) and a translation (3,), mm.

    Raises:
        ParameterError: the rotation is not orthonormal with determinant +1.
    """
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation_mm
    return rigid(T, "pose")


def inverse(T: Array) -> Array:
    """Inverse of a rigid transform (4, 4), mm."""
    R, p = T[:3, :3], T[:3, 3]
    return pose(R.T, -R.T @ p)


def T_sphere_endcap(params: EndcapParams) -> Array:
    """(4, 4) endcap to sphere frame, mm: same axes, the origin moves up to the sphere's centre."""
    return pose(np.eye(3), (0.0, 0.0, -params.centre_height_mm))


def wrench_adjoint(T_target_source: Array) -> Array:
    """(6, 6) matrix that takes (force, N; torque, N m) from the source to the target frame (module's Notes)."""
    R = T_target_source[:3, :3]
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = R
    result[3:, :3] = skew(T_target_source[:3, 3] / MM_PER_M) @ R
    return result


def wrench_in(wrench: Wrench, T_target_source: ArrayLike, frame: str) -> Wrench:
    """The same wrench, and its covariance, expressed in another frame.

    Args:
        wrench: in the source frame.
        T_target_source: (4, 4), mm.
        frame: name of the target frame.

    Raises:
        ParameterError: ``T_target_source`` is no rigid transform.
    """
    adjoint = wrench_adjoint(rigid(T_target_source, f"T_{frame}_{wrench.frame}"))
    reported = adjoint @ np.concatenate([wrench.force_n, wrench.torque_nm])
    covariance = adjoint @ wrench.covariance @ adjoint.T
    return replace(wrench, force_n=reported[:3], torque_nm=reported[3:], covariance=covariance, frame=frame)


@dataclass(frozen=True)
class FtMount:
    """Pose, sign and tare of a force/torque sensor relative to the endcap at one instant.

    Attributes:
        T_endcap_ft: (4, 4) sensor to endcap coordinates, mm; changes while the robot moves the endcap over a fixed one.
        reads: :data:`ACTION` for a sensor between robot and endcap that reads the load on the endcap, :data:`REACTION`
            for one under the plane that the endcap presses.
        tare: (6,) its reading without contact, in its own frame, N and N m.

    Raises:
        ParameterError: ``T_endcap_ft`` is no rigid transform, or ``reads`` is neither.
    """

    T_endcap_ft: Array
    reads: int = REACTION
    tare: Array = field(default_factory=lambda: np.zeros(6))

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_endcap_ft", rigid(self.T_endcap_ft, "T_endcap_ft"))
        if self.reads not in (ACTION, REACTION):
            raise ParameterError(
                f"reads={self.reads} is neither 1 (the load on the endcap) nor -1 (what the endcap does to the sensor)",
                name="reads",
                value=self.reads,
            )

    def on_endcap(self, reading: ArrayLike, time_s: float) -> Wrench:
        """Wrench on the endcap in its frame, from one reading (6,) in N and N m."""
        raw = self.reads * (np.asarray(reading, float) - self.tare)
        return wrench_in(Wrench(time_s, raw[:3], raw[3:], frame="ft"), self.T_endcap_ft, "endcap")

    def reading(self, wrench: Wrench) -> Array:
        """(6,) reading of the sensor, N and N m, for a wrench on the endcap: the inverse of :meth:`on_endcap`."""
        reported = wrench_in(wrench, inverse(self.T_endcap_ft), "ft")
        return self.reads * np.concatenate([reported.force_n, reported.torque_nm]) + self.tare


def rigid(T: ArrayLike, name: str) -> Array:
    """A read-only copy of a rigid transform (4, 4), mm, after a check.

    Args:
        T: the matrix.
        name: of the matrix, for the message.

    Raises:
        ParameterError: it is not (4, 4), finite, orthonormal to 1e-6 with determinant +1.
    """
    matrix = np.array(T, float)
    good = matrix.shape == (4, 4) and bool(np.isfinite(matrix).all()) and np.allclose(matrix[3], [0, 0, 0, 1])
    if good:
        R = matrix[:3, :3]
        good = np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0
    if not good:
        raise ParameterError(
            f"{name} of shape {matrix.shape} is no rigid transform: give a 4x4 rotation and translation (mm), "
            "determinant +1, seven digits of each number: lengths and right angles hold to 1e-6",
            name=name,
            value=matrix.shape,
        )
    matrix.setflags(write=False)
    return matrix


def skew(p: ArrayLike) -> Array:
    """(3, 3) cross-product matrix of p (3,): skew(p) q = p x q."""
    x, y, z = np.asarray(p, float)
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
