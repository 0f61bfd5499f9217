"""Whether the picture of an untouched endcap shows what weights were trained on: dots, light and rows enough.

    doubts = picture_doubts(image_bgr, dots_px, params, camera)    # {"dots_missing": "61 of the 87 dots that ..."}

A part of the skin that nobody sees, a picture that is white, or one of few rows gives wrenches that are off by far more
than their covariance says, and nothing else looks unusual. Limits are estimates (E) set on drawn pictures with planted
faults; the released photos of 640 x 480 pass, the one of 1280 x 720 shows 67 of 87 dots.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.calibration.dots import mutual_nearest, neighbour_ratio, pattern_points, sees_whole, spacing_px
from sensing.camera.light import DARK_GRAY, MOST_WHITE, Light, light_of
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.records import Image

DOTS_MISSING, DARK = "dots_missing", "dark"  # flags
MOST_MISSING = 0.12  # E: of the dots that the design's camera shows
LEAST_ROWS = 240  # M: of the short side; at 240 forces are off by 0.09 N rms, at 180 by 0.2 N, 1.3 deviations
NEAR = 0.3  # of the dots' spacing: a found dot this near to its place is that dot


def picture_doubts(
    image_bgr: Image, dots_px: Array, params: EndcapParams, camera: MountedCamera | None
) -> dict[str, str]:
    """What makes wrenches against this reference doubtful, a flag and a line each; empty where nothing does.

    Args:
        image_bgr: (h, w, 3) the picture.
        dots_px: (n, 2) dots found in it.
        params: the design.
        camera: that sees it; None where that is not known: then every dot found counts.
    """
    size = image_bgr.shape[1], image_bgr.shape[0]
    doubts = light_doubts(light_of(image_bgr))
    if min(size) < LEAST_ROWS:
        doubts["low_resolution"] = (
            f"pictures of {size[0]}x{size[1]} px are too small (at least {LEAST_ROWS} rows): choose a larger mode"
        )
    seen, wanted = seen_dots(dots_px, params, camera)
    if seen < (1 - MOST_MISSING) * wanted:
        doubts[DOTS_MISSING] = (
            f"{seen} of the {wanted} dots that the design's camera shows are in the rest picture (at least "
            f"{np.ceil((1 - MOST_MISSING) * wanted):.0f}): free and wipe lens and dome, use the camera's full picture, "
            "then take it again"
        )
    return doubts


def light_doubts(light: Light) -> dict[str, str]:
    """The same of the light alone, which needs no design."""
    doubts = {}
    if light.too_bright:
        doubts["overexposed"] = (
            f"{100 * light.white_share:.0f} % of the rest picture is white (at most {100 * MOST_WHITE:.0f} %): "
            "less light or a shorter exposure, then take it again"
        )
    if light.too_dark:
        doubts[DARK] = (
            f"the silicone of the rest picture has gray value {light.median_gray:.0f} of 255 "
            f"(at least {DARK_GRAY:.0f}): more light or a longer exposure, then take it again"
        )
    return doubts


def seen_dots(dots_px: Array, params: EndcapParams, camera: MountedCamera | None) -> tuple[int, int]:
    """How many dots of the pattern were found, and how many the nominal camera shows whole.

    Args:
        dots_px: (n, 2) found.
        params: the design.
        camera: None where it is not known: then every dot counts.
    """
    points = pattern_points(params)[0]
    wanted = int(np.count_nonzero(sees_whole(nominal_mount(params), points)))
    if camera is None or len(dots_px) < 2:
        return len(dots_px), wanted
    return len(pattern_dots(dots_px, params, camera)), wanted


def pattern_dots(dots_px: Array, params: EndcapParams, camera: MountedCamera) -> NDArray[np.intp]:
    """Ascending numbers of the found dots that lie on places of the design's; specks and blots do not.

    Args:
        dots_px: (n, 2) found, two at least.
        params: the design.
        camera: that sees them.
    """
    points = pattern_points(params)[0]
    reach = NEAR * spacing_px(dots_px) * neighbour_ratio(camera, points)
    return np.sort(mutual_nearest(dots_px, camera, points, np.ones(len(points), bool), reach).blob_index)
