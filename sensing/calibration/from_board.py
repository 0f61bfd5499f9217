"""Lens calibration from views of a flat board with known points (the corners of a chessboard, a dot grid).

Rays instead of normalised image points make the start valid past 90 degrees from the axis, where a homography of
pixels fails. Lengths in mm, pixels in px; frames as in :mod:`sensing.camera.model`, board points at z = 0.
"""

from __future__ import annotations

import csv
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from cad.errors import FileError, ParameterError
from cad.lens import camera_module
from cad.plain_numbers import stored_number
from sensing.calibration.dots import CalibrationError
from sensing.camera.model import Array, FisheyeCamera, monotonic_half_angle_deg, radial
from sensing.camera.mount import rotation_matrix

GOOD_PX = 1.0  # no other start is tried below this residual
CORNERS = (3, 100)  # inner ones each way: OpenCV looks for no fewer, and prints hold no more
MOST_SQUARE_MM = 1000.0
LARGEST = 1e6  # of a coordinate, mm or px
MIN_VIEWS = 3
MIN_POINTS = 6  # a view: four fix its homography, two more check it
LEAST_ACROSS = 1e-3  # extent of the points of a view across their longest one, over that one
START_FOCAL = 0.5  # f / image height of a 180 degree lens that fills the frame
STARTS = (0.5, 0.7, 1.0, 1.4)  # factors on it that are tried: the best residual wins


@dataclass(frozen=True)
class BoardView:
    """One view: points (n, 2) on the board in mm and where they are seen, (n, 2) in px."""

    board_mm: Array
    pixels: Array


@dataclass(frozen=True)
class BoardCalibration:
    """Lens and board poses.

    Attributes:
        camera: intrinsics.
        T_camera_board: (v, 4, 4) pose of each view's board.
        residual_px: (n, 2) predicted minus seen, all views.
    """

    camera: FisheyeCamera
    T_camera_board: Array
    residual_px: Array

    @property
    def rms_px(self) -> float:
        """Root mean square distance of predicted and seen points."""
        return float(np.sqrt((self.residual_px**2).sum(1).mean()))


def read_views(path: str | Path) -> list[BoardView]:
    """Views from a CSV with the columns view, x_mm, y_mm, u_px, v_px.

    Raises:
        FileError: missing file or columns, or text that is not a number (naming the line).
    """
    rows: dict[str, list[list[float]]] = defaultdict(list)
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as stream:
            table = csv.DictReader(stream)
            for row in table:
                values = [stored_number(row[name]) for name in ("x_mm", "y_mm", "u_px", "v_px")]
                if max(map(abs, values)) > LARGEST:
                    raise ParameterError(f"{max(values, key=abs):g} is no place on a board nor in a picture")
                rows[row["view"]].append(values)
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror})") from error
    except (KeyError, ValueError, csv.Error) as error:
        raise FileError(
            f"{path}: line {table.line_num}: need columns view,x_mm,y_mm,u_px,v_px of numbers ({error})"
        ) from error
    arrays = [np.array(values) for values in rows.values()]
    return [BoardView(values[:, :2], values[:, 2:]) for values in arrays]


def require_board(inner: tuple[int, int], square_mm: float) -> None:
    """Refuse a chessboard that cannot be.

    Raises:
        ParameterError: corners that OpenCV does not look for, or a side that is no length.
    """
    fewest, most = CORNERS
    if not fewest <= min(inner) <= max(inner) <= most:
        raise ParameterError(
            f"corners={inner[0]}x{inner[1]} outside {fewest}x{fewest}..{most}x{most}: count the inner corners, 9x6 for "
            "10 x 7 squares",
            name="corners",
            value=inner,
        )
    if not 0 < square_mm <= MOST_SQUARE_MM:
        raise ParameterError(
            f"square={square_mm:g} outside 0..{MOST_SQUARE_MM:g} mm: measure the side of a square, more than 0",
            name="square",
            value=square_mm,
        )


def find_board(image_bgr: NDArray[np.uint8], inner: tuple[int, int], square_mm: float) -> BoardView | None:
    """Corners of a chessboard in a photo; ``None`` where it is not found (cut off, blurred or bent too strongly).

    Args:
        image_bgr: (h, w, 3) photo.
        inner: inner corners along the board's x and y, for example (9, 6) for 10 x 7 squares.
        square_mm: side of a square.

    Raises:
        ParameterError: corners or a side that no board has.
    """
    require_board(inner, square_mm)
    found, corners = cv2.findChessboardCornersSB(cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY), inner)
    if not found:
        return None
    grid = np.stack(np.meshgrid(np.arange(inner[0]), np.arange(inner[1])), -1).reshape(-1, 2)
    return BoardView(np.asarray(grid * square_mm, dtype=float), np.asarray(corners, dtype=float).reshape(-1, 2))


def calibrate_from_board(views: Sequence[BoardView], size_px: tuple[int, int]) -> BoardCalibration:
    """Focal lengths, centre and k1..k4 from several views of a board.

    Raises:
        CalibrationError: too few views or points, points on one line, or a fit that does not reach 5 px.
    """
    if len(views) < MIN_VIEWS or any(len(view.pixels) < MIN_POINTS for view in views):
        raise CalibrationError(f"{len(views)} views: need {MIN_VIEWS} or more with {MIN_POINTS} or more points each")
    _require_spread(views)
    tries = []
    for factor in STARTS:
        found = _solve(views, size_px, START_FOCAL * factor * size_px[1])
        if found is not None:
            tries.append(found)
            if found.rms_px < GOOD_PX:
                break
    if not tries:
        raise CalibrationError("no start led to a lens: check that board points and pixels belong together")
    best = min(tries, key=lambda result: result.rms_px)
    if best.rms_px > 5:
        raise CalibrationError(f"residual {best.rms_px:.1f} px over 5: check the order of the board's points")
    return best


def _require_spread(views: Sequence[BoardView]) -> None:
    """Refuse points on one line or place: they do not determine the camera across it."""
    for number, view in enumerate(views, 1):
        for values, place in ((view.board_mm, "on the board"), (view.pixels, "in the picture")):
            across = np.linalg.svd(values - values.mean(0), compute_uv=False)
            if not across[1] > LEAST_ACROSS * across[0]:
                raise CalibrationError(
                    f"view {number} of {len(views)}: its points lie on one line or spot {place}: spread them"
                )


def _solve(views: Sequence[BoardView], size_px: tuple[int, int], focal: float) -> BoardCalibration | None:
    """From one starting focal length (equidistant lens); ``None`` where the start is impossible."""
    width, height = size_px
    start = FisheyeCamera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, max_half_angle_deg=179.0)
    poses = []
    for view in views:
        rays = start.unproject(view.pixels)
        if not np.isfinite(rays).all():
            return None
        poses.append(_pose_from_rays(view.board_mm, rays))
    points = [np.column_stack([view.board_mm, np.zeros(len(view.board_mm))]) for view in views]
    owner = np.repeat(np.arange(len(views)), [len(view.pixels) for view in views])
    seen = np.vstack([view.pixels for view in views])

    def residual(vector: Array) -> Array:
        pairs = zip(vector[8:].reshape(-1, 6), points, strict=True)
        moved = np.vstack([board @ rotation_matrix(pose[:3]).T + pose[3:] for pose, board in pairs])
        return (_project(vector[:8], moved) - seen).ravel()

    def jacobian(vector: Array) -> Array:
        return _grouped_jacobian(residual, vector, owner)

    vector = np.concatenate([start.parameters, *poses])
    found = least_squares(residual, vector, jac=jacobian, x_scale="jac", loss="soft_l1", max_nfev=100)
    k1, k2, k3, k4 = found.x[4:8]
    view_deg = min(camera_module().max_half_angle_deg, 0.99 * monotonic_half_angle_deg(found.x[4:8]))
    if not (found.x[:2] > 0).all():
        return None
    fx, fy, cx, cy = found.x[:4]
    camera = FisheyeCamera(width, height, fx, fy, cx, cy, (k1, k2, k3, k4), view_deg)
    T = np.tile(np.eye(4), (len(views), 1, 1))
    for index in range(len(views)):
        pose = found.x[8 + 6 * index : 14 + 6 * index]
        T[index, :3, :3], T[index, :3, 3] = rotation_matrix(pose[:3]), pose[3:]
    return BoardCalibration(camera, T, residual(found.x).reshape(-1, 2))


def _project(lens: Array, points: Array) -> Array:
    """The camera model's equation without its checks (the solver may pass through lenses that fold)."""
    rho = np.hypot(points[:, 0], points[:, 1])
    scale = radial(np.arctan2(rho, points[:, 2]), lens[4:])[0] / np.maximum(rho, 1e-12)
    return lens[:2] * scale[:, None] * points[:, :2] + lens[2:4]


def _pose_from_rays(board_mm: Array, rays: Array) -> Array:
    """Rotation vector and translation (6,) of a flat board: the null vector of ray x (H [x, y, 1]) = 0."""
    size = np.abs(board_mm - board_mm.mean(0)).max()
    plane = np.column_stack([(board_mm - board_mm.mean(0)) / size, np.ones(len(board_mm))])
    x, y, z = rays.T[:, :, None]
    zero = np.zeros_like(plane)
    rows = np.block([[zero, -z * plane, y * plane], [z * plane, zero, -x * plane], [-y * plane, x * plane, zero]])
    H = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    H = H * np.sign(np.sum((plane @ H.T) * rays))
    H = H / np.sqrt(np.linalg.norm(H[:, 0]) * np.linalg.norm(H[:, 1]))
    u, _, vt = np.linalg.svd(np.column_stack([H[:, 0], H[:, 1], np.cross(H[:, 0], H[:, 1])]))
    R = u @ vt  # no mirror: three columns of which the last is the others' product are right-handed
    shift = H[:, 2] * size - R[:, :2] @ board_mm.mean(0)
    return np.concatenate([_rotation_vector(R), shift])


def _rotation_vector(R: Array) -> Array:
    """Inverse of ``rotation_matrix``, through the quaternion (stable at half a turn)."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def _grouped_jacobian(residual: Callable[[Array], Array], vector: Array, owner: NDArray[np.intp]) -> Array:
    """Central differences (2 n, 8 + 6 v); a pose moves only its own view, so all views are stepped at once."""
    views = (len(vector) - 8) // 6
    J = np.zeros((2 * len(owner), len(vector)))
    rows = np.arange(2 * len(owner))
    for number in range(14):
        columns = np.array([number]) if number < 8 else 8 + 6 * np.arange(views) + number - 8
        step = np.zeros(len(vector))
        step[columns] = 1e-6 * max(1.0, float(np.abs(vector[columns]).max()))
        slope = (residual(vector + step) - residual(vector - step)) / (2 * step[columns[0]])
        J[rows, columns[0] if number < 8 else columns[np.repeat(owner, 2)]] = slope
    return J
