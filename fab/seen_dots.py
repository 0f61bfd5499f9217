"""How many of a design's dots the camera's picture shows: too few of them calibrate no camera, however well printed.

The sensing side has the camera's model and the limit; fab must not import it, so this is the nominal lens again, on the
axis at the design's pupil height, for the whole sensor's 4:3 picture. A test compares the two for many designs.
"""

from __future__ import annotations

import math

from cad.dots import Dot, dot_pattern, dot_position_mm
from cad.lens import CameraModule, camera_module
from cad.params import EndcapParams
from cad.pattern import rings_text

ROWS, COLUMNS = 480, 640
FEWEST = 7  # centres that a calibration by one photo needs at the least (sensing.calibration.dots.FEWEST_TO_FIT)


def seen_dots(params: EndcapParams) -> int:
    """Number of dots whose centres lie in the picture of the camera module at hand.

    Args:
        params: the design.

    Raises:
        ParameterError, FileError: see :func:`cad.lens.camera_module`.
    """
    module = camera_module()
    return sum(_is_seen(params, dot, module) for dot in dot_pattern(params))


def few_dots_words(params: EndcapParams) -> str | None:
    """What to say of a design whose camera cannot be calibrated; ``None`` where it can.

    Args:
        params: the design.
    """
    seen = seen_dots(params)
    if seen >= FEWEST:
        return None
    return (
        f"dots={rings_text(params.dot_rings)}: the picture shows {seen} dots, and a camera is calibrated by {FEWEST} "
        "or more: take more rings, or more dots in each"
    )


def _is_seen(params: EndcapParams, dot: Dot, module: CameraModule) -> bool:
    """r = f (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9) of the angle a off the axis, seen from the pupil."""
    x, y, z = dot_position_mm(params, dot)
    across = math.hypot(x, y)
    angle = math.atan2(across, z - params.camera_height_mm)
    if math.degrees(angle) > module.max_half_angle_deg:
        return False
    radius = module.focal_per_row * ROWS * (angle + sum(k * angle ** (2 * i + 3) for i, k in enumerate(module.k)))
    u, v = (radius * side / across if across else 0.0 for side in (x, y))
    return abs(u) < (COLUMNS - 1) / 2 and abs(v) < (ROWS - 1) / 2
