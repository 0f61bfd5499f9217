"""Findings in the picture of an untouched endcap: its size, light, focus, size of the dots, missing dots, and diameter.

Limits are estimates (E) set on rendered pictures of the released sensor with planted faults
(tests/sensing/doctor/test_doctor.py has them); the four released photos pass. Pixels at 480 rows, gray values 0 to 255.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.dots import dot_pattern
from cad.params import EndcapParams
from sensing.calibration.dots import (
    REFERENCE_HEIGHT_PX,
    CalibrationError,
    fewest_dots,
    find_blobs,
    more_dots_words,
    pattern_points,
    sees_whole,
)
from sensing.calibration.from_dots import Calibration, calibrate_from_dots
from sensing.calibration.other_design import OtherDesignError, design_fit, require_design
from sensing.calibration.rest_camera import most_misplaced_px
from sensing.calibration.rest_picture import LEAST_ROWS, seen_dots
from sensing.camera.dot_look import dot_look
from sensing.camera.light import DARK_GRAY, Light, light_of
from sensing.camera.nominal import nominal_mount
from sensing.doctor.finding import Finding, Verdict, above, below, finding
from sensing.records import Image

Array = NDArray[np.float64]
DIM_GRAY, BRIGHT_GRAY, SOME_WHITE = 80.0, 225.0, 0.005  # worth a look
SECTORS = 12  # of a ring of silicone, REACH of the way from the middle to the picture's edge
REACH = (0.55, 0.95)
EVEN = (0.9, 0.82)  # darkest sector over the brightest: 0.91 to 0.93 on the photos, 0.88 with three of nine LEDs off
EDGE_PX = (5.4, 6.6)  # from dark to light at a dot's rim: 3.9 to 5.0 on the photos
SMALL_RIM = 0.4  # M: power of the dots' size with which the measured width of sharp rims falls (0.34 to 1 times)
PAINT = 1.12  # M: radius of the ink over that of the dent
SIZE = (0.9, 1.2), (0.75, 1.4)  # dot radius over the painted design's: good, worth a look
MISSING = (0.04, 0.12)  # of the dots that there should be
NAMED = 8  # missing dots that are listed


def picture_findings(image_bgr: Image, params: EndcapParams) -> list[Finding]:
    """Findings on one picture.

    Args:
        image_bgr: (h, w, 3) of the untouched endcap.
        params: its design.
    """
    gray = image_bgr[..., :2].astype(np.float64).mean(-1)  # blue and green, as the dots are found
    exposure, size = _exposure(light_of(gray)), _size(gray.shape)
    light = [size, exposure] if exposure.verdict is Verdict.BAD else [size, exposure, _evenness(gray)]
    centres, radii = find_blobs(image_bgr, params)
    if len(centres) < fewest_dots(nominal_mount(params), pattern_points(params)[0]):
        return [*light, _no_dots(len(centres), params)]
    dots = [_dot_size(radii, centres, params, gray.shape), *_pattern(centres, radii, params, gray.shape)]
    if size.verdict is not Verdict.BAD:  # else rims are as wide as its pixels, and a lens that is sharp would be turned
        dots.insert(0, _focus(gray, centres, radii, dot_look(params).scale))
    return [*light, *dots]


def _size(shape: tuple[int, ...]) -> Finding:
    """Rows of the short side: live flags every reading of a picture that has too few."""
    rows = min(shape[:2])
    return finding(
        "size", Verdict.GOOD if rows >= LEAST_ROWS else Verdict.BAD,
        f"{shape[1]} x {shape[0]} px, at least {LEAST_ROWS} rows are needed",
        "choose a larger mode of the camera: of so few rows forces are wrong", {"rows": float(rows)},
    )  # fmt: skip


def _exposure(light: Light) -> Finding:
    level, white = light.median_gray, light.white_share
    values: dict[str, float | list[str]] = {"median_gray": level, "white_fraction": white}
    text = f"the silicone has gray value {level:.0f} of 255, {100 * white:.1f} % are white"
    if white > SOME_WHITE or level > BRIGHT_GRAY:
        fix = "shorter exposure (--exposure) or less light: white dots and silicone carry no pattern"
        return finding("exposure", Verdict.BAD if light.too_bright else Verdict.LOOK, text, fix, values)
    fix = "plug the lamp in, free the lens, or expose longer (--exposure)"
    return finding("exposure", above(level, DIM_GRAY, DARK_GRAY), text, fix, values)


def _evenness(gray: Array) -> Finding:
    """Median brightness of sectors around the middle, darkest over brightest of those opposite one another."""
    rows, columns = np.indices(gray.shape)
    x, y = columns - (gray.shape[1] - 1) / 2, rows - (gray.shape[0] - 1) / 2
    away = np.hypot(x, y) / (gray.shape[0] / 2)
    ring = (away > REACH[0]) & (away < REACH[1])
    sector = ((np.arctan2(y, x)[ring] / (2 * np.pi) + 1) * SECTORS).astype(int) % SECTORS
    level = np.array([np.median(gray[ring][sector == k]) for k in range(SECTORS)])
    ratio = float(level.min() / max(level.max(), 1.0))
    clock = round(((int(level.argmin()) + 0.5) * 360 / SECTORS + 90) % 360 / 30) or 12
    values: dict[str, float | list[str]] = {"darkest_over_brightest": ratio, "darkest_clock": float(clock)}
    return finding(
        "light", above(ratio, *EVEN),
        f"darkest side {100 * ratio:.0f} % of the brightest, at {clock} o'clock",
        f"look for an LED that is off or covered at {clock} o'clock, and whether the camera sits on the axis", values,
    )  # fmt: skip


def _no_dots(count: int, params: EndcapParams) -> Finding:
    look = "light and focus first; is this the inside of a painted endcap?"
    fix = more_dots_words(nominal_mount(params), params, look)
    return finding("dots", Verdict.BAD, f"{count} dots found", fix, {"found": float(count)})


def _focus(gray: Array, centres: Array, radii: Array, dot_scale: float) -> Finding:
    """Width of the dots' rims: contrast over the steepest slope, median over the dots.

    The steepest slope is a quantile over a window of 1.8 radii, a tenth from the top at the released size; a rim of the
    same width fills the less of its window the larger the dot is (``dot_scale`` times the released). Of smaller dots
    the window is nearly all rim, and the width comes out smaller, as the limits are then.
    """
    steepest = 100.0 - 10.0 / max(1.0, dot_scale)
    good, worst = (limit * min(1.0, dot_scale) ** SMALL_RIM for limit in EDGE_PX)
    scale = gray.shape[0] / REFERENCE_HEIGHT_PX
    smooth = cv2.GaussianBlur(gray, (0, 0), 0.7 * scale)
    slope = np.hypot(cv2.Sobel(smooth, cv2.CV_64F, 1, 0), cv2.Sobel(smooth, cv2.CV_64F, 0, 1)) / 8
    widths = []
    for (u, v), radius in zip(centres, radii, strict=True):
        reach = int(np.ceil(1.8 * radius))
        top, left = max(0, round(v) - reach), max(0, round(u) - reach)
        window = np.s_[top : round(v) + reach + 1, left : round(u) + reach + 1]
        depth = float(np.percentile(smooth[window], 90) - np.percentile(smooth[window], 5))
        widths.append(depth / max(float(np.percentile(slope[window], steepest)), 1e-6))
    width = float(np.median(widths)) / scale
    return finding(
        "focus", below(width, good, worst), f"the dots' rims are {width:.1f} px wide",
        f"turn the lens until the rims are under {good:.2g} px; wipe it", {"rim_px": width},
    )  # fmt: skip


def _dot_size(radii: Array, centres: Array, params: EndcapParams, shape: tuple[int, ...]) -> Finding:
    """Radius of the dots in the middle over that of the design's, seen by the released camera."""
    middle = np.array([shape[1] - 1, shape[0] - 1]) / 2
    near = np.argsort(np.linalg.norm(centres - middle, axis=1))[: len(centres) // 2]
    expected = PAINT * _expected_px(params, shape, middle, float(np.linalg.norm(centres[near] - middle, axis=1).max()))
    ratio = float(np.median(radii[near])) / expected
    (low, high), (lowest, highest) = SIZE
    verdict = Verdict.GOOD if low <= ratio <= high else Verdict.LOOK if lowest <= ratio <= highest else Verdict.BAD
    return finding(
        "dot size", verdict, f"{2 * float(np.median(radii[near])):.1f} px across, {ratio:.2f} of what the design gives",
        "give the design (--diameter, --wall); check the lens and the camera's height; paint within the dents",
        {"diameter_px": 2 * float(np.median(radii[near])), "of_design": ratio},
    )  # fmt: skip


def _expected_px(params: EndcapParams, shape: tuple[int, ...], middle: Array, reach_px: float) -> float:
    """Radius of the design's dots within so many px of the middle, as the released camera sees them."""
    camera, inner = nominal_mount(params, shape[1], shape[0]), params.inner_radius_mm
    centre = np.array([0.0, 0.0, params.centre_height_mm])
    normals = np.array([dot.direction for dot in dot_pattern(params)])
    aside = np.cross(normals, [1.0, 0.0, 0.0])
    aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-9)
    pixels, dot = camera.project(centre + inner * normals), params.dot_radius_mm
    across = np.mean([np.linalg.norm(camera.project(centre + inner * normals + sign * dot * each) - pixels,
                                     axis=1) for sign in (1, -1) for each in (aside, np.cross(normals, aside))],
                     axis=0)  # fmt: skip
    near = np.linalg.norm(pixels - middle, axis=1) <= reach_px
    return float(np.median(across[near]))


def _pattern(centres: Array, radii: Array, params: EndcapParams, shape: tuple[int, ...]) -> list[Finding]:
    """Which dots are not seen, whether the others lie where those of an untouched dome do, and of which diameter."""
    try:
        found = calibrate_from_dots(centres, params, (shape[1], shape[0]))
    except CalibrationError as error:
        fix = "give the design (--diameter, --wall); light and focus first"
        return [finding("dots", Verdict.BAD, f"{len(centres)} found: {error}", fix, {"found": float(len(centres))})]
    return [_missing(found, params), _shape(found, params), _design(found, radii, params, (shape[1], shape[0]))]


def _design(found: Calibration, radii: Array, params: EndcapParams, size_px: tuple[int, int]) -> Finding:
    """Whether another diameter fits the dots clearly better, by which live flags every reading."""
    fit = design_fit(found, radii, params)
    try:
        if fit.is_doubtful:  # else a second is saved
            require_design(fit, radii, size_px)
    except OtherDesignError as error:
        fix = "give the design (--diameter, --wall); if the one given is right, see sensing.calibrate --help"
        return finding("design", Verdict.BAD, error.found, fix)
    return finding("design", Verdict.GOOD, f"no other diameter fits clearly better than {params.label}", "")


def _shape(found: Calibration, params: EndcapParams) -> Finding:
    """Distance of nine dots of ten from the design's, seen by the camera that fits best."""
    away_px, most_px = found.misplaced_px, most_misplaced_px(params)
    return finding(
        "shape", Verdict.GOOD if away_px <= most_px else Verdict.BAD,
        f"the dots lie up to {away_px:.1f} px from the design's, at most {most_px:.1f} of an untouched dome",
        "let the dome go: is it pressed? give the design (--diameter, --wall)", {"away_px": away_px},
    )  # fmt: skip


def _missing(found: Calibration, params: EndcapParams) -> Finding:
    """Dots of the pattern that should be seen and are not."""
    missing = _absent(found, params)
    expected = len(missing) + len(found.pattern_index)
    seen, wanted = seen_dots(found.found_px, params, found.mounted)  # what is covered may look like the lens's dark rim
    fraction = max(len(missing) / max(1, expected), 1 - seen / wanted)
    named = [f"ring {dot.ring} number {dot.index} at {dot.u_px:.0f}, {dot.v_px:.0f} px" for dot in missing]
    text = f"{len(found.pattern_index)} of {expected} of the pattern are seen ({wanted} by the design's camera)"
    if named:
        text += "; missing: " + "; ".join(named[:NAMED]) + (f"; {len(named) - NAMED} more" * (len(named) > NAMED))
    return finding(
        "dots", below(fraction, *MISSING), text,
        "wipe the lens and the dome there, free what covers it, use the camera's full picture, or repaint",
        {"seen": float(len(found.pattern_index)), "missing": float(len(missing)), "missing_dots": list(named)},
    )  # fmt: skip


@dataclass(frozen=True)
class Absent:
    """A dot of the pattern and where it should be, px."""

    ring: int
    index: int
    u_px: float
    v_px: float


def _absent(found: Calibration, params: EndcapParams) -> list[Absent]:
    """Dots that lie whole in the picture and in the circle that the lens lights, and have no partner."""
    pattern = dot_pattern(params)
    centre = np.array([0.0, 0.0, params.centre_height_mm])
    points = centre + params.inner_radius_mm * np.array([dot.direction for dot in pattern])
    pixels = found.mounted.project(points)
    seen = pixels[found.pattern_index]
    middle = np.median(seen, axis=0)
    reach = float(np.linalg.norm(seen - middle, axis=1).max())
    whole = sees_whole(found.mounted, points)
    whole &= np.linalg.norm(pixels - middle, axis=1) <= reach
    whole[found.pattern_index] = False
    return [Absent(pattern[k].ring, pattern[k].index, *map(float, pixels[k])) for k in np.flatnonzero(whole)]
