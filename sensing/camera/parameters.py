"""A mounted camera as eleven numbers, and back: what calibration estimates and in which its covariance is given.

Pixels of the frame, radians, mm. The rotation from endcap to camera axes is Rodrigues([tilt_x, tilt_y, 0]) Rz(azimuth).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensing.camera.model import Array, monotonic_half_angle_deg
from sensing.camera.mount import MountedCamera, mount, rotation_matrix

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
POSE = slice(5, 11)


def camera_vector(mounted: MountedCamera) -> Array:
    """The numbers (11,) of :data:`NAMES`."""
    camera, R = mounted.camera, mounted.T_camera_endcap[:3, :3]
    axis = R[:, 2]  # Rz leaves z, so the tilt is what brings z here
    tilt = np.cross([0, 0, 1.0], axis)
    length = np.linalg.norm(tilt)
    tilt = tilt / length * np.arctan2(length, axis[2]) if length > 0 else tilt
    turn = rotation_matrix([tilt[0], tilt[1], 0]).T @ R
    azimuth = np.arctan2(turn[1, 0], turn[0, 0])
    lens = [camera.fx_px, camera.cx_px, camera.cy_px, camera.k[0], camera.k[1]]
    return np.array([*lens, tilt[0], tilt[1], azimuth, *mounted.pupil_endcap_mm])


def camera_at(vector: Array, like: MountedCamera) -> MountedCamera:
    """Camera of the numbers (11,); picture size, aspect, higher distortion and view as of another one.

    The view ends sooner where the lens would fold.
    """
    camera = like.camera
    k = (float(vector[3]), float(vector[4]), *camera.k[2:])
    view = min(camera.max_half_angle_deg, 0.99 * monotonic_half_angle_deg(k))
    focal = float(vector[0])
    lens = replace(
        camera, fx_px=focal, fy_px=focal * camera.fy_px / camera.fx_px, cx_px=float(vector[1]), cy_px=float(vector[2]),
        k=k, max_half_angle_deg=view,
    )  # fmt: skip
    return mount(lens, vector[8:11], rotation_of(vector))


def rotation_of(vector: Array) -> Array:
    """Rotations (..., 3, 3) from endcap to camera axes.

    Args:
        vector: (..., 11) numbers of cameras.
    """
    x, y, azimuth = vector[..., 5], vector[..., 6], vector[..., 7]
    angle = np.hypot(x, y)
    sine, cosine = np.sinc(angle / np.pi), 0.5 * np.sinc(0.5 * angle / np.pi) ** 2  # over angle, one less over angle^2
    mixed, c, s = cosine * x * y, np.cos(azimuth), np.sin(azimuth)
    tilt = (1 - cosine * y * y, mixed), (mixed, 1 - cosine * x * x), (-sine * y, sine * x)
    turned = np.empty((*x.shape, 3, 3))
    for row, (first, second) in enumerate(tilt):  # tilt times turn, whose third axis stays
        turned[..., row, 0] = first * c + second * s
        turned[..., row, 1] = second * c - first * s
    turned[..., 0, 2], turned[..., 1, 2] = sine * y, -sine * x
    turned[..., 2, 2] = 1 - cosine * angle * angle
    return turned
