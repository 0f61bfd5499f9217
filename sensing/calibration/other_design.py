"""Tests whether another diameter fits the photo as well: all diameters have the same pattern of dots.

Angles alone hardly separate a dome of 150 mm from one of 130 with a longer lens. What does: the released lens fits one
of them better, the dots of 4 mm look smaller on a larger dome, and another number of rings is in view. Each counts by
its own probability. The wall changes the inner radius by a few percent, which no photo determines: it is not looked
for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.calibration.dots import CalibrationError, pattern_points, sees_whole
from sensing.calibration.fit import Problem
from sensing.calibration.from_dots import Calibration, calibrate_from_dots
from sensing.calibration.prior import HYPOTHESES, OTHER_LENS
from sensing.calibration.turns import turned
from sensing.camera.dot_look import disc_radius_px
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import camera_vector

STEP_MM, SPAN = 10.0, 1.3  # other diameters are looked at in such steps, up to this factor smaller and larger
INK_SCALE, INK_SIGMA = 1.12, 0.08  # ink radius over dent radius: M on the photos; E from painter to painter
STRAY_LOG, UNSEEN_LOG = -4.0, -0.5  # E: log odds of a found dot that is not of the pattern, and of a dot not found
MARGIN = 2.0  # log odds under which two designs fit alike
FEW, FAR_SIGMA = 2, 1.6  # strays or unseen dots, and deviations of the dots' size, that speak for no other design
BEYOND = 5.0  # and over which the other one is taken for the right one


class OtherDesignError(CalibrationError):
    """Another diameter fits a photo clearly better than the one given; in words of ``sensing.calibrate``.

    Attributes:
        found: which one, without what to do about it: other programs have other options.
    """

    def __init__(self, found: str) -> None:
        super().__init__(f"{found}: give its --diameter, or --trust-design if the one given is right")
        self.found = found


@dataclass(frozen=True)
class DesignFit:
    """How well a photo fits a design.

    Attributes:
        params: the design.
        calibration: the camera under it.
        ink_scale: dots' radius over the dents', 1.12 on the released photos.
        log_evidence: log probability of dots, their number and size, up to a constant of the photo.
    """

    params: EndcapParams
    calibration: Calibration
    ink_scale: float
    log_evidence: float

    @property
    def is_doubtful(self) -> bool:
        """Whether anything speaks for another diameter: another lens, dots left over or missing, dots of another size.

        Where nothing does, no other one fitted better by more than 5 in the logarithm (M: domes of 110 to 160 mm seen
        as one of 130, painted by hand).
        """
        c = self.calibration
        other_lens = next(iter(c.probabilities), "") == HYPOTHESES[-1].name
        size = abs(self.ink_scale - INK_SCALE) / INK_SIGMA
        return other_lens or c.strays > FEW or _unseen(c, self.params) > FEW or size > FAR_SIGMA

    def line(self) -> str:
        """Its numbers in one line."""
        c = self.calibration
        return (
            f"D={self.params.diameter_mm:g} T={self.params.wall_mm:g}: {len(c.residual_px)} of {len(c.found_px)} dots, "
            f"residual {c.rms_px:.2f} px rms, focal length {c.values['f_px'][0]:.1f} px, "
            f"dots {self.params.dot_mm * self.ink_scale:.1f} mm wide"
        )


def design_fit(calibration: Calibration, radius_px: Array, params: EndcapParams) -> DesignFit:
    """Score of a calibration under its design.

    Args:
        calibration: of the photo.
        radius_px: (m,) of all found dots.
        params: the design.
    """
    radius = radius_px[calibration.blob_index]
    points = pattern_points(params)[0][calibration.pattern_index]
    scale = float(np.median(radius / disc_radius_px(calibration.mounted, points, params)))
    size = -0.5 * ((scale - INK_SCALE) / INK_SIGMA) ** 2
    whiten = Problem.of(calibration.mounted, OTHER_LENS).whitening(calibration.mounted, points) / calibration.scatter
    scatter = float(np.log(np.linalg.det(whiten)).sum())  # a millimetre of paint is fewer pixels on a larger dome
    odds = STRAY_LOG * calibration.strays + UNSEEN_LOG * _unseen(calibration, params)
    return DesignFit(params, calibration, scale, float(calibration.log_evidence + scatter + size + odds))


def rivals(
    given: DesignFit, radius_px: Array, size_px: tuple[int, int], azimuth_hint_deg: float = 0.0
) -> list[DesignFit]:
    """Other diameters that fit as well or better than the given design, best first.

    Args:
        given: how well the photo fits the given design.
        radius_px: (m,) of all found dots.
        size_px: (width, height).
        azimuth_hint_deg: expected turn of the camera about its axis.
    """
    found = []
    for diameter in _diameters(given.params.diameter_mm):
        try:
            params = replace(given.params, diameter_mm=float(diameter))
            near, dots_px = _transferred(given.calibration, params, size_px), given.calibration.found_px
            other = calibrate_from_dots(dots_px, params, size_px, azimuth_hint_deg=azimuth_hint_deg, near=near)
        except (ParameterError, CalibrationError):
            continue
        found.append(design_fit(other, radius_px, params))
    close = [fit for fit in found if fit.log_evidence > given.log_evidence - MARGIN]
    return sorted(close, key=lambda fit: -fit.log_evidence)


def require_design(
    given: DesignFit, radius_px: Array, size_px: tuple[int, int], azimuth_hint_deg: float = 0.0, trusted: bool = False
) -> str:
    """Warning where another diameter fits a photo alike, one line; empty where none does.

    Args:
        given, radius_px, size_px, azimuth_hint_deg: as of :func:`rivals`.
        trusted: warn also where the other one fits clearly better.

    Raises:
        OtherDesignError: another diameter fits clearly better, and the design given is not to be trusted.
    """
    for other in rivals(given, radius_px, size_px, azimuth_hint_deg)[:1]:
        if other.log_evidence > given.log_evidence + BEYOND and not trusted:
            raise OtherDesignError(f"another design fits this photo better: {other.line()}; against {given.line()}")
        return f"another design fits alike: {other.line()}; kept {given.line()}"
    return ""


def _transferred(calibration: Calibration, params: EndcapParams, size_px: tuple[int, int]) -> MountedCamera:
    """The camera that sees the same dots of the same pattern on another diameter where a calibration matched them."""
    start, points = nominal_mount(params, *size_px), pattern_points(params)[0]
    turn_rad = camera_vector(calibration.mounted)[7] - camera_vector(start)[7]
    both = calibration.pattern_index < len(points)  # outer rings end where the wall does
    points, pixels = points[calibration.pattern_index[both]], calibration.matched_px[both]
    return Problem.of(start, OTHER_LENS).refine(turned(start, turn_rad), points, pixels)


def _diameters(given_mm: float) -> Array:
    grid = np.arange(np.ceil(given_mm / SPAN / STEP_MM), np.floor(given_mm * SPAN / STEP_MM) + 1) * STEP_MM
    return grid[np.abs(grid - given_mm) > STEP_MM / 2]


def _unseen(calibration: Calibration, params: EndcapParams) -> int:
    """Dots of the pattern that should be seen whole and were not found."""
    whole = sees_whole(calibration.mounted, pattern_points(params)[0])
    whole[calibration.pattern_index] = False
    return int(whole.sum())
