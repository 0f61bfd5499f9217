"""Does the camera that is assumed fit the dots of the rest picture? A test with a known false-alarm rate.

    misfit = camera_misfit(tracker.reference_px, tracker.size, params)         # the nominal camera is assumed
    misfit.fits, misfit.reason                                                  # False, "camera turned by 1.6 degrees"

Notes:
    Whitened differences e (2n,) of found and predicted dots are projected on what a camera can change: with J (2n, 11)
    their derivatives by the camera's numbers and U an orthonormal basis of J's columns, r = U'e has, if the camera is
    as assumed within tolerance, the covariance s^2 I + U'J S J'U, where S is the tolerance and s the dots' scatter as
    their own robust residuals have it. T = r' cov^-1 r / p then follows F(p, 2n - p) (Seber and Lee, Linear Regression
    Analysis, 2003, theorem 4.1); beyond its 1 - :data:`FALSE_ALARM` quantile the camera does not fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cad.params import EndcapParams
from sensing.calibration.dots import CalibrationError, pattern_points
from sensing.calibration.fit import OUTLIER, STEP, Problem, numeric_jacobian
from sensing.calibration.from_dots import Calibration, calibrate_from_dots
from sensing.calibration.in_place import pairs_in_place
from sensing.calibration.prior import HYPOTHESES, OTHER_LENS
from sensing.calibration.turns import best_turn
from sensing.camera.model import Array
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import NAMES, camera_vector

FALSE_ALARM = 1e-3  # of a camera within tolerance
# E: what may be off before forces suffer by 0.1 N: focal length 0.2 %, centre 0.5 px (at 480 rows), distortion as much
# as moves a dot by 0.4 px, 0.1 degrees, 0.1 mm
TOLERANCE_FOCAL, TOLERANCE_CENTRE_PX, TOLERANCE_K = 0.002, 0.5, (0.0015, 0.0005)
TOLERANCE_DEG, TOLERANCE_MM = 0.1, 0.1
NEAR = 0.3  # of the dots' spacing
VIEW_ANGLE_DEG = 60.0  # from the axis, at which another lens law is reported


@dataclass(frozen=True)
class Misfit:
    """Outcome of the test.

    Attributes:
        statistic: T, about 1 for a camera that fits.
        p_value: probability of at least that much.
        fits: whether the camera fits.
        reason: what is off by how much, one line; empty where the camera fits.
        found: the camera that fits instead; None where the camera fits, or none was found.
    """

    statistic: float
    p_value: float
    fits: bool
    reason: str = ""
    found: Calibration | None = None


def camera_misfit(
    dots_px: Array, size_px: tuple[int, int], params: EndcapParams, camera: MountedCamera | None = None
) -> Misfit:
    """Test the assumed camera against the dots of an undeformed picture.

    Args:
        dots_px: (n, 2) found dots, extra and missing ones allowed.
        size_px: width and height of the picture.
        params: the endcap.
        camera: the one assumed, its covariance adding to the tolerance; None for the nominal one.
    """
    assumed = nominal_mount(params, *size_px) if camera is None else camera
    statistic, p_value = np.inf, 0.0
    pairs = pairs_in_place(dots_px, params, assumed, NEAR)  # with fewer on their places a full search decides
    if pairs is not None and len(pairs.blob_index) > len(NAMES):
        points = pattern_points(params)[0][pairs.pattern_index]
        statistic, p_value = _statistic(assumed, points, dots_px[pairs.blob_index])
        if p_value >= FALSE_ALARM:
            return Misfit(statistic, p_value, True)
    azimuth = np.degrees(camera_vector(assumed)[7])
    try:
        found = calibrate_from_dots(dots_px, params, size_px, azimuth_hint_deg=azimuth)
    except CalibrationError as error:
        return Misfit(statistic, p_value, False, f"the dots are not where this camera sees them ({error})")
    if camera is None and HYPOTHESES[0].name == next(iter(found.probabilities)):
        return Misfit(statistic, p_value, True)  # the dots call for no other camera
    return Misfit(statistic, p_value, False, differences(assumed, found, params), found)


def differences(assumed: MountedCamera, found: Calibration, params: EndcapParams) -> str:
    """One line with the parameters in which two cameras differ significantly, largest difference first.

    Args:
        assumed: the camera.
        found: the one that fits instead.
        params: the endcap, whose dots may look alike turned.
    """
    before, now = camera_vector(assumed), camera_vector(found.mounted)
    sigma = np.array([found.values[name][1] for name in NAMES])
    change = now - before
    rows = assumed.camera.height_px / 480
    allowed = np.sqrt(np.maximum(sigma, 0) ** 2 + np.diag(_tolerance(assumed)))
    lens = _radial_change(assumed, found.mounted)
    turned, shifted = np.degrees(change[5:8]), change[8:11]
    turn = best_turn(found.mounted, found.found_px, *pattern_points(params), float(np.degrees(before[7])))
    alike = f" or, as the dots look alike then, by {turn.repeats_deg:.3g} more or less" if turn.is_doubtful else ""
    rivals = [
        (np.abs(change[5:8] / allowed[5:8]).max(), f"camera turned by {_turn_deg(assumed, found.mounted):.1f} degrees"
         f"{alike} (x {turned[0]:+.1f}, y {turned[1]:+.1f}, about its axis {turned[2]:+.1f})"),
        (np.abs(change[8:10] / allowed[8:10]).max(), f"pupil off the axis by {np.hypot(*shifted[:2]):.1f} mm"),
        (abs(change[0] / allowed[0]), f"focal length {100 * change[0] / before[0]:+.1f} %"),
        (np.abs(change[1:3] / allowed[1:3]).max(), f"optical axis off by {np.hypot(*change[1:3]):.1f} px"),
        (abs(lens) / rows if np.abs(change[3:5]).max() > 1e-9 else 0.0,
         f"another lens: {VIEW_ANGLE_DEG:g} degrees from its axis it images {lens:+.1f} px away"),
    ]  # fmt: skip
    clear = sorted((r for r in rivals if r[0] > 2.5), reverse=True) or [max(rivals)]
    return "; ".join(text for _, text in clear[:3])


def _statistic(camera: MountedCamera, points: Array, pixels: Array) -> tuple[float, float]:
    """(T, its p-value) of dots matched to the pattern."""
    problem = Problem.of(camera, OTHER_LENS)
    whiten, at = problem.whitening(camera, points), camera_vector(camera)

    def whitened(vector: Array) -> Array:
        away = np.einsum("nab,...nb->...na", whiten, pixels - problem.project(vector, points))
        return away.reshape(*vector.shape[:-1], -1)

    error, J = whitened(at), -numeric_jacobian(whitened, at, STEP)
    basis = np.linalg.svd(J, full_matrices=False)[0]
    weight = np.ones(len(error))
    for _ in range(8):  # Huber: smears count linearly
        share = np.linalg.lstsq(weight[:, None] * basis, weight * error, rcond=None)[0]
        left = error - basis @ share
        scatter = 1.4826 * float(np.median(np.abs(left))) * np.sqrt(len(error) / (len(error) - len(NAMES)))
        weight = np.sqrt(1 / np.sqrt(1 + (left / (OUTLIER * max(scatter, 1e-9))) ** 2))
    freedom = len(error) - len(NAMES)
    pulled, slope = weight**2 * left, float(np.mean(weight**6))  # psi and the mean of its derivative
    noise = float(pulled @ pulled) / freedom / slope**2 * np.eye(len(NAMES))  # Huber 1981, eq. 7.6.2
    spread = noise + basis.T @ J @ _tolerance(camera) @ J.T @ basis
    statistic = float(share @ np.linalg.solve(spread, share)) / len(NAMES)
    return statistic, f_beyond(statistic, len(NAMES), freedom)


def f_beyond(statistic: float, upper: int, lower: int) -> float:
    """Probability that a variable of the F distribution is larger.

    Args:
        statistic: the value to exceed.
        upper, lower: degrees of freedom of numerator and denominator.

    Notes:
        Regularised incomplete beta function (Abramowitz, Stegun 1964, eq. 26.6.2) by the trapezoidal rule; relative
        error under 1e-3 up to 500 degrees of freedom.
    """
    a, b = lower / 2, upper / 2
    end = lower / (lower + upper * max(statistic, 1e-300))
    t = end * np.linspace(0, 1, 20001)[1:]
    log_density = (a - 1) * np.log(t) + (b - 1) * np.log1p(-np.minimum(t, 1 - 1e-15))
    log_total = math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
    return min(1.0, float(np.trapezoid(np.exp(log_density - log_total), t)))


def _tolerance(camera: MountedCamera) -> Array:
    """(11, 11) covariance of accepted differences: the tolerance and the uncertainty of a calibration."""
    lens, rows = camera.camera, camera.camera.height_px / 480
    centre, turn = TOLERANCE_CENTRE_PX * rows, np.radians(TOLERANCE_DEG)
    sigma = [TOLERANCE_FOCAL * lens.fx_px, centre, centre, *TOLERANCE_K, turn, turn, turn, *[TOLERANCE_MM] * 3]
    allowed = np.diag(np.array(sigma) ** 2)
    return allowed if camera.covariance is None else allowed + camera.covariance


def _radial_change(assumed: MountedCamera, found: MountedCamera) -> float:
    """px by which the found lens images a ray farther out, VIEW_ANGLE_DEG from its axis."""
    angle = np.radians(VIEW_ANGLE_DEG)
    return float(found.camera.fx_px * found.camera.radius(angle) - assumed.camera.fx_px * assumed.camera.radius(angle))


def _turn_deg(assumed: MountedCamera, found: MountedCamera) -> float:
    R = found.T_camera_endcap[:3, :3] @ assumed.T_camera_endcap[:3, :3].T
    return float(np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1))))
