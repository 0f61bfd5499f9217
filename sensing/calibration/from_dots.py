"""Camera calibration from one photo of the sensor's own dots: the lens, and where the camera sits.

The dots alone cannot separate the camera's height from its lens: on the axis of a sphere any height fits with some
radial function r(theta) (moving the pupil 35 mm changes the residual of the released photos by 2 %). So calibration
from dots is a maximum-posterior fit with stated priors (:mod:`sensing.calibration.prior`), every number is reported
with its posterior and prior standard deviations, and the covariance is stored with the camera. The simpler hypothesis
is kept unless the evidence is against it: a camera exactly as designed, or the released lens. A board calibration
determines the lens: use it here with ``--lens``.

Endcap and camera frames as in :mod:`sensing.camera.model`; lengths in mm, pixels in px.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.calibration.assign import assign_dots
from sensing.calibration.dots import (
    FEWEST_TO_FIT,
    CalibrationError,
    DotPairs,
    fewest_dots,
    more_dots_words,
    pattern_points,
    spacing_px,
)
from sensing.calibration.fit import Fit, Problem
from sensing.calibration.in_place import assign_in_place
from sensing.calibration.prior import HYPOTHESES, OTHER_LENS, MountPrior
from sensing.camera.model import Array, FisheyeCamera
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import NAMES

LEAST_SPACING_PX = 1.0  # between neighbours, the usual distance; a dot itself is wider


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera with its uncertainty and residuals.

    Attributes:
        mounted: camera, pose and their covariance.
        residual_px: (n, 2) predicted minus found, for the matched dots.
        pattern_index: (n,) dot of ``cad.dots.dot_pattern`` of each residual.
        blob_index: (n,) blob of ``found_px`` of each residual.
        found_px: (m, 2) all blobs, px.
        values: parameter name -> (value, posterior standard deviation, prior one; ``inf`` where free, 0 where held).
        scatter: scatter of the dots over that of hand-painted ones.
        probabilities: probability of each hypothesis by name, largest first; empty where a prior or a lens was given.
        log_evidence: logarithm of the evidence, up to a constant that depends on the dots alone.
    """

    mounted: MountedCamera
    residual_px: Array
    pattern_index: NDArray[np.intp]
    blob_index: NDArray[np.intp]
    found_px: Array
    values: dict[str, tuple[float, float, float]]
    scatter: float
    probabilities: dict[str, float]
    log_evidence: float

    @property
    def matched_px(self) -> Array:
        """(n, 2) found pixels of the matched dots."""
        return self.found_px[self.blob_index]

    @property
    def strays(self) -> int:
        """Number of blobs that are not a dot of the pattern."""
        return len(self.found_px) - len(self.blob_index)

    @property
    def rms_px(self) -> float:
        """Root mean square distance of predicted and found dots."""
        return float(np.sqrt((self.residual_px**2).sum(1).mean()))

    @property
    def median_px(self) -> float:
        """Median distance of predicted and found dots."""
        return float(np.median(np.linalg.norm(self.residual_px, axis=1)))

    @property
    def most_px(self) -> float:
        """90th percentile of the distance of predicted and found dots."""
        return float(np.quantile(np.linalg.norm(self.residual_px, axis=1), 0.9))

    @property
    def misplaced_px(self) -> float:
        """:attr:`most_px` as it is in a picture of 480 rows."""
        lens = self.mounted.camera
        return self.most_px * 480.0 / min(lens.width_px, lens.height_px)

    def report(self) -> str:
        """One line a parameter: value, deviation, and whether the photo or the prior decided it."""
        lines = [f"dots matched {len(self.residual_px)} of {len(self.found_px)} found"]
        lines.append(f"residual {self.rms_px:.2f} px rms, {self.median_px:.2f} px median")
        for name, probability in list(self.probabilities.items())[:2]:
            lines.append(f"the camera is {name}: probability {probability:.3f}")
        for name, (value, sigma, prior) in self.values.items():
            decided = "held" if prior == 0 else "photo" if sigma < 0.7 * prior else "mostly the prior"
            lines.append(f"{name:>11} {value:10.4f} +- {sigma:.4f}  ({decided})")
        return "\n".join(lines)


def calibrate_from_dots(
    found_px: Array,
    params: EndcapParams,
    size_px: tuple[int, int],
    *,
    prior: MountPrior | None = None,
    lens: FisheyeCamera | None = None,
    azimuth_hint_deg: float = 0.0,
    near: MountedCamera | None = None,
) -> Calibration:
    """Camera and pose from the dots of one undeformed image.

    Args:
        found_px: (m, 2) blob centres, extra and missing ones allowed.
        params: the design (sphere and pattern are taken as exact).
        size_px: image width and height.
        prior: the only one to use; None to compare the released lens with another one.
        lens: intrinsics to hold fixed, for example from a board; only the pose is then fitted.
        azimuth_hint_deg: expected turn of the camera about its axis, because patterns repeat: the released one after
            180 degrees.
        near: first guess of the camera. Where nearly all dots lie near its predictions there is no search, which takes
            a third less time; a dot between two predictions may then be matched with another one.

    Raises:
        CalibrationError: pattern not recognised, too few dots, or most of them twice.
    """
    _require_apart(found_px)
    start = nominal_mount(params, *size_px)
    if lens is not None:
        start = MountedCamera(lens, start.T_camera_endcap)
    wide = Problem.of(start, prior or OTHER_LENS, lens is not None)
    placed = None if near is None else assign_in_place(found_px, params, near, wide.refine)
    pairs, mounted = placed or assign_dots(found_px, params, start, wide.refine, azimuth_hint_deg)
    pattern = pattern_points(params)[0]
    if len(pairs.blob_index) < (fewest := fewest_dots(start, pattern)):
        remedy = more_dots_words(start, params, "sharper photo or dots CSV")
        raise CalibrationError(f"{len(pairs.blob_index)} dots matched, at least {fewest} needed: {remedy}")
    points, pixels = pattern[pairs.pattern_index], found_px[pairs.blob_index]
    fit = wide.solve(mounted, points, pixels)
    probabilities: dict[str, float] = {}
    if prior is None and lens is None:
        fit, probabilities = most_probable(fit, start, points, pixels)
    return _calibration(fit, points, pairs, found_px, probabilities)


def _require_apart(found_px: Array) -> None:
    """Refuse a list in which most dots stand twice: distances between neighbours measure the search."""
    if len(found_px) >= FEWEST_TO_FIT and spacing_px(found_px) < LEAST_SPACING_PX:
        raise CalibrationError(
            f"{len(found_px)} dots, half of them within {LEAST_SPACING_PX:g} px of another: give each dot once"
        )


def _calibration(
    fit: Fit, points: Array, pairs: DotPairs, found_px: Array, probabilities: dict[str, float]
) -> Calibration:
    """A fit with its residuals, and each number beside its deviations."""
    camera = replace(fit.mounted, covariance=fit.covariance)
    deviation = np.sqrt(np.diag(fit.covariance))
    rows = zip(NAMES, fit.vector, deviation, fit.prior_deviation, strict=True)
    return Calibration(
        mounted=camera,
        residual_px=camera.project(points) - found_px[pairs.blob_index],
        pattern_index=pairs.pattern_index,
        blob_index=pairs.blob_index,
        found_px=found_px,
        values={name: (float(v), float(s), float(p)) for name, v, s, p in rows},
        scatter=fit.scatter,
        probabilities=probabilities,
        log_evidence=fit.log_evidence,
    )


def most_probable(widest: Fit, start: MountedCamera, points: Array, pixels: Array) -> tuple[Fit, dict[str, float]]:
    """The fit of the most probable hypothesis, and all probabilities, largest first.

    What separates it from the others goes into its covariance as far as the choice is open; a camera as designed gets
    the covariance of one that is merely mounted otherwise, because the photo cannot rule out less than that.

    Args:
        widest: fit of the last hypothesis, which sets the scatter.
        start: the nominal camera.
        points: (n, 3) endcap frame.
        pixels: (n, 2) where they are seen.
    """
    fits = [
        replace(Problem.of(start, h.prior), sigma=np.zeros(len(NAMES))) if h.exact else Problem.of(start, h.prior)
        for h in HYPOTHESES
    ]
    solved = [problem.solve(widest.mounted, points, pixels, widest.scatter) for problem in fits]
    log_weight = np.array([f.log_evidence + np.log(h.odds) for f, h in zip(solved, HYPOTHESES, strict=True)])
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    order = np.argsort(-weight, kind="stable")
    best = solved[order[0]]
    if HYPOTHESES[order[0]].exact:
        best = replace(best, covariance=solved[1].covariance, prior_deviation=solved[1].prior_deviation)
    covariance = best.covariance.copy()
    for other in order[1:]:
        apart = solved[other].vector - best.vector
        covariance += weight[other] * np.outer(apart, apart)
    probabilities = {HYPOTHESES[k].name: float(weight[k]) for k in order}
    evidence = float(log_weight.max() + np.log(np.exp(log_weight - log_weight.max()).sum()))
    return replace(best, covariance=covariance, log_evidence=evidence), probabilities
