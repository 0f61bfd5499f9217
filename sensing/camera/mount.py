"""A camera and where it sits in the endcap, as one file (mm; frames of :mod:`sensing.camera.model` and cad.params)."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cad.errors import FileError, ParameterError
from cad.identity import Identity, recorded, require_same
from cad.whole_file import replace_file
from sensing.camera.model import Array, FisheyeCamera, points_array, require

FILE_FORMAT, OLD_FORMAT = "endcap-camera-2", "endcap-camera-1"  # the old one has no covariance
PARAMETERS = 11  # numbers of sensing.camera.parameters


@dataclass(frozen=True)
class MountedCamera:
    """A camera and where it sits in the endcap: what calibration finds and what tracking and rendering need.

    Attributes:
        camera: intrinsics.
        T_camera_endcap: 4x4 rigid transform that takes endcap coordinates (mm) to camera coordinates (mm).
        covariance: (11, 11) of the numbers of :mod:`sensing.camera.parameters`, as calibration found it; None where
            the camera is exact (a design, a simulation) or its uncertainty unknown (an old file).

    Raises:
        ParameterError: a matrix that is not a rigid transform (rotation orthonormal to 1e-6, determinant +1), or a
            covariance that is none (another shape, not symmetric, a negative variance).
    """

    camera: FisheyeCamera
    T_camera_endcap: Array
    covariance: Array | None = None

    def __post_init__(self) -> None:
        matrix = np.array(self.T_camera_endcap, dtype=float)
        good = matrix.shape == (4, 4) and np.isfinite(matrix).all() and np.allclose(matrix[3], [0, 0, 0, 1])
        good = good and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-6)
        good = good and np.linalg.det(matrix[:3, :3]) > 0
        require(bool(good), "T_camera_endcap", "matrix", "a 4x4 rigid transform (rotation and translation)")
        matrix.setflags(write=False)
        object.__setattr__(self, "T_camera_endcap", matrix)
        if self.covariance is not None:
            object.__setattr__(self, "covariance", _checked_covariance(self.covariance))

    def to_camera(self, points_endcap_mm: ArrayLike) -> Array:
        """Points (..., 3) from the endcap frame to the camera frame."""
        return points_array(points_endcap_mm, 3) @ self.T_camera_endcap[:3, :3].T + self.T_camera_endcap[:3, 3]

    def project(self, points_endcap_mm: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3) in the endcap frame; ``nan`` beyond the view."""
        return self.camera.project(self.to_camera(points_endcap_mm))

    def sees(self, points_endcap_mm: ArrayLike, margin_px: float = 0.0) -> NDArray[np.bool_]:
        """Which points (..., 3) in the endcap frame lie within the picture, more than a margin from its edge."""
        pixels = self.project(points_endcap_mm)
        size = np.array([self.camera.width_px, self.camera.height_px])
        return np.asarray(((pixels > margin_px) & (pixels < size - 1 - margin_px)).all(axis=-1))

    @property
    def pupil_endcap_mm(self) -> Array:
        """The entrance pupil in the endcap frame, shape (3,)."""
        return -self.T_camera_endcap[:3, :3].T @ self.T_camera_endcap[:3, 3]

    def rays_endcap(self, pixels: ArrayLike) -> Array:
        """Unit rays (..., 3) of pixels (..., 2) in the endcap frame; they start at :attr:`pupil_endcap_mm`."""
        return self.camera.unproject(pixels) @ self.T_camera_endcap[:3, :3]

    def on_sphere(self, pixels: ArrayLike, centre_mm: ArrayLike, radius_mm: float) -> Array:
        """(..., 3) where rays leave a sphere, mm in the endcap frame; NaN where they miss it.

        Args:
            pixels: (..., 2) of the full-size picture, px.
            centre_mm: (3,) of the sphere, endcap frame.
            radius_mm: radius of the sphere.
        """
        rays, start = self.rays_endcap(pixels), self.pupil_endcap_mm - np.asarray(centre_mm, float)
        along = rays @ start
        root = np.sqrt(along**2 - start @ start + radius_mm**2)
        return np.asarray(self.pupil_endcap_mm + (root - along)[..., None] * rays)

    def require_size(self, size_px: tuple[int, int], name: str | Path = "camera") -> None:
        """Refuse pictures of another size than those that it was calibrated with.

        Args:
            size_px: width and height of the pictures.
            name: of the camera, for the message, such as its file.

        Raises:
            ParameterError: they differ.
        """
        own = self.camera.width_px, self.camera.height_px
        if size_px != own:
            raise ParameterError(
                f"{name}: a camera of {own[0]}x{own[1]} px, the pictures have {size_px[0]}x{size_px[1]}: its numbers "
                "hold for its own size alone: calibrate it again with these pictures, or set the camera's mode to "
                f"{own[0]}x{own[1]}",
                name="camera",
                value=own,
            )

    def save(self, path: str | Path, made_for: Identity | None = None) -> None:
        """Write JSON under a temporary name, then rename.

        Args:
            path: the file.
            made_for: the endcap whose dots it was calibrated from; None for a lens alone.

        Raises:
            FileError: the folder cannot be written.
        """
        record: dict[str, Any] = {"format": FILE_FORMAT, "camera": asdict(self.camera)}
        record["T_camera_endcap"] = self.T_camera_endcap.tolist()
        record["covariance"] = None if self.covariance is None else self.covariance.tolist()
        record["identity"] = None if made_for is None else made_for.without("camera", "silicone", "mesh").record()
        replace_file(Path(path), (json.dumps(record, indent=1) + "\n").encode())

    @classmethod
    def load(cls, path: str | Path, wanted: Identity | None = None) -> MountedCamera:
        """Read what :meth:`save` wrote.

        Args:
            path: the file.
            wanted: the endcap at hand; None takes any camera.

        Raises:
            FileError: a file that is missing, is no such JSON, holds numbers that make no camera, or was calibrated
                from the dots of another endcap.
        """
        try:
            if Path(path).exists() and not Path(path).is_file():
                raise ValueError("no regular file")
            record = json.loads(Path(path).read_text(encoding="utf-8"))
            if record["format"] not in (FILE_FORMAT, OLD_FORMAT):
                raise ValueError(f"format={record['format']!r}")
            covariance = record.get("covariance")
            made_for = wanted and recorded(record.get("identity"), wanted.design)
            found = cls(
                FisheyeCamera(**record["camera"]),
                np.array(record["T_camera_endcap"], dtype=float),
                None if covariance is None else np.array(covariance, dtype=float),
            )
        except OSError as error:
            raise FileError(f"{path}: cannot read ({error.strerror}); make one with sensing.calibrate") from error
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            said = " ".join(str(error).split())[:200]
            raise FileError(
                f"{path}: not a camera file of format {FILE_FORMAT} ({said}); make one with sensing.calibrate"
            ) from error
        if wanted is not None and made_for is not None:
            require_same(
                path, "a camera", made_for, wanted, "calibrate this endcap's own with endcap calibrate", ("dots",)
            )
        return found


def _checked_covariance(covariance: Array) -> Array:
    matrix = np.array(covariance, dtype=float)
    good = matrix.shape == (PARAMETERS, PARAMETERS) and bool(np.isfinite(matrix).all())
    if good:
        size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        relative = matrix / size / size[:, None]
        good = bool((np.diag(matrix) >= 0).all() and np.allclose(relative, relative.T, atol=1e-6))
        good = good and float(np.linalg.eigvalsh((relative + relative.T) / 2)[0]) > -1e-6
    require(good, "covariance", "matrix", f"a {PARAMETERS}x{PARAMETERS} covariance (symmetric, no negative variance)")
    matrix.setflags(write=False)
    return matrix


def rotation_matrix(rotation_vector: ArrayLike) -> Array:
    """Rotation (3, 3) about ``rotation_vector`` by its length in radians (Rodrigues)."""
    vector = np.asarray(rotation_vector, dtype=float)
    angle = float(np.linalg.norm(vector))
    if angle < 1e-300:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def mount(camera: FisheyeCamera, pupil_endcap_mm: ArrayLike, rotation: ArrayLike | None = None) -> MountedCamera:
    """A camera at a pupil position in the endcap frame.

    Args:
        camera: its lens and picture size.
        pupil_endcap_mm: (3,) position of the entrance pupil.
        rotation: (3, 3) from endcap to camera axes; without one the camera looks along +z at the tip, image x along the
            endcap's x.
    """
    R = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = -R @ np.asarray(pupil_endcap_mm, dtype=float)
    return MountedCamera(camera, T)
