"""Photos in, photos with the fitted pattern drawn on them out (calibration only)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.params import EndcapParams
from cad.whole_file import replace_file
from sensing.calibration.dots import pattern_points
from sensing.camera.model import Array
from sensing.decode import decode_file

if TYPE_CHECKING:
    from sensing.calibration.from_dots import Calibration


def draw_fit(image_bgr: NDArray[np.uint8], calibration: Calibration, params: EndcapParams) -> NDArray[np.uint8]:
    """The photo with the fit: green cross matched (line: 10 x residual), gray cross unseen, red ring unclaimed blob.

    Args:
        image_bgr: (H, W, 3) the photo; left as it is.
        calibration: the fit.
        params: the design.
    """
    picture = image_bgr.copy()
    predicted = calibration.mounted.project(pattern_points(params)[0])
    matched = dict(zip(calibration.pattern_index.tolist(), calibration.residual_px, strict=True))
    claimed = np.array([predicted[i] - r for i, r in matched.items()])
    for blob in calibration.found_px:
        if np.linalg.norm(claimed - blob, axis=1).min() > 1e-6:
            cv2.circle(picture, _pixel(blob), 9, (40, 40, 255), 2, cv2.LINE_AA)
    for index, dot in enumerate(predicted):
        if not np.isfinite(dot).all():
            continue
        color = (60, 255, 60) if index in matched else (150, 150, 150)
        cv2.drawMarker(picture, _pixel(dot), color, cv2.MARKER_CROSS, 7, 1, cv2.LINE_AA)
        if index in matched:
            cv2.line(picture, _pixel(dot), _pixel(dot - 10 * matched[index]), (60, 220, 255), 1, cv2.LINE_AA)
    return picture


def read_image(path: str | Path) -> NDArray[np.uint8]:
    """A photo as (h, w, 3) BGR.

    Raises:
        FileError: missing, not an image, or too large a one.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"{path}: cannot read ({error.strerror})") from error
    return decode_file(path, data)


def require_format(path: str | Path) -> None:
    """Refuse a name under which no picture can be written, before long work begins.

    Raises:
        FileError: a suffix that is no picture's.
    """
    suffix = Path(path).suffix
    if suffix and not cv2.haveImageWriter(f"picture{suffix}"):
        raise FileError(f"{path}: unknown picture format {suffix!r}; end the name in .png or .jpg")


def write_image(path: str | Path, image: NDArray[np.uint8]) -> None:
    """Write an image under a temporary name, then rename.

    Raises:
        FileError: unknown suffix, or the folder cannot be written.
    """
    path = Path(path)
    require_format(path)
    data = cv2.imencode(path.suffix or ".png", image)[1]
    replace_file(path, data.tobytes(), "choose a folder that can be written")


def _pixel(point: Array) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
