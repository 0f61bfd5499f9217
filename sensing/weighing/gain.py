"""Fits one gain to known loads by generalised least squares, and refuses inconsistent ones.

    found = fit_gain([Pose("500 g", load_n, load_sd_n, force_n, covariance), ...])
    found.gain, found.sd, found.chi_square

Forces in N on the endcap, endcap frame.

Notes:
    In pose k the known force L_k = -W_k d_k presses (W_k its weight, d_k the vertical in the endcap frame), and the
    model with gain one estimates f_k. With r_k = g f_k - L_k and

        V_k = g^2 (C_k + m^2 f_k f_k') + s_k^2 d_k d_k' + (W_k a)^2 (I - d_k d_k'),

    C_k the model's covariance, m :data:`MODEL_SD`, s_k the weight's standard deviation and a :data:`ATTITUDE_RAD`, the
    gain is g = sum f' V^-1 L / sum f' V^-1 f (V from the gain before, until it converges). Errors of the model repeat
    from pose to pose, so their parts of the gain's standard deviation are added; those of the weights add as squares.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from sensing.tensegrity.description import GRAVITY_M_S2
from sensing.weighing.words import GRAMS, MOST_TILT_DEG
from sensing.wrench.quantiles import chi_square_quantile

Array = NDArray[np.float64]
MODEL_SD = 0.01  # E: of a load, error of the model beside its covariance: wall, contact, mesh
ATTITUDE_RAD = math.radians(1.0)  # E: error with which a table is level and a tilt is set
CONTRADICTION = 1e-3  # probability with which consistent weights are refused, by each of the two tests
ALIKE_DEG = 3.0  # E: verticals that differ by less are those of one table
SAME_DEG = 1e-6  # verticals that were given as equal differ by rounding
LEAST_POSES = 2  # with one pose a wrong weight could not be found
LEAST_RATIO = 1.2  # of the largest load over the smallest: equal loads cannot contradict one another
SOFTEST, STIFFEST = 0.04, 5.0  # E: range of gains of the silicones in cad/materials.csv and of harder ones
UNITS_G = {"N": 1000 / GRAVITY_M_S2, "oz": GRAMS["oz"]}  # typed by mistake for g (kg and lb give too small numbers)
ROUNDS = 50  # iterations of the fit


class WeighingError(EndcapError):
    """A weighing that cannot be used: too few poses, a missing load, weights that contradict one another."""


class ContradictionError(WeighingError):
    """Weights that contradict one another.

    Attributes:
        worst: number of the pose without which the others agree; None where no one of them is such.
    """

    def __init__(self, text: str, worst: int | None) -> None:
        super().__init__(text)
        self.worst = worst


@dataclass(frozen=True)
class Pose:
    """One known load.

    Attributes:
        name: name that the user gave.
        load_n: (3,) force on the endcap, N.
        load_sd_n: standard deviation of its norm, N.
        force_n: (3,) estimate of the model with gain one, N.
        covariance: (3, 3) covariance of the estimate, N2.
    """

    name: str
    load_n: Array
    load_sd_n: float
    force_n: Array
    covariance: Array

    @property
    def weight_n(self) -> float:
        """Norm of the load, N."""
        return float(np.linalg.norm(self.load_n))

    @property
    def reading_n(self) -> float:
        """Component of the estimate along the load, N."""
        return float(self.force_n @ self.load_n) / self.weight_n


@dataclass(frozen=True)
class Gain:
    """Result of the fit.

    Attributes:
        gain, sd: gain and its standard deviation, dimensionless.
        chi_square: chi-square of the residuals.
        freedom: its degrees of freedom.
        residual_n: (n, 3) residual of each pose, N.
        along: chi-square of the part of the residuals along the loads, which a wrong weight changes.
    """

    gain: float
    sd: float
    chi_square: float
    freedom: int
    residual_n: Array
    along: float

    @property
    def limit(self) -> float:
        """Chi-square above which the poses contradict one another."""
        return chi_square_quantile(1 - CONTRADICTION, self.freedom)

    @property
    def limit_along(self) -> float:
        """The same of :attr:`along`: forces across the loads that agree must not hide a weight that does not."""
        return chi_square_quantile(1 - CONTRADICTION, (self.freedom + 1) // 3 - 1)


def fit_gain(poses: Sequence[Pose]) -> Gain:
    """The gain that all poses agree on.

    Raises:
        WeighingError: fewer than two poses, all of one load, a wrong unit, or poses that contradict one another.
    """
    require_poses(poses)
    for pose in poses:
        require_unit(pose)
    return agreed_gain(poses)


def agreed_gain(poses: Sequence[Pose]) -> Gain:
    """The same of two poses or more whose loads and units nobody checks: equal loads can agree, too.

    Raises:
        ContradictionError: a weight contradicts the others.
        WeighingError: the forces lean.
    """
    found = _fitted(poses)
    if found.chi_square > found.limit:
        beyond = f"(chi-square {found.chi_square:.0f}, at most {found.limit:.0f})"
        turned = _fitted([replace(p, load_n=p.weight_n * p.force_n / np.linalg.norm(p.force_n)) for p in poses])
        if turned.chi_square < found.chi_square / 2:  # most of it lies across the loads
            raise WeighingError(_leaning(poses, turned.gain, beyond))
        raise _contradiction(poses, beyond)
    if found.along > found.limit_along:
        beyond = f"(chi-square along the loads {found.along:.0f}, at most {found.limit_along:.0f})"
        raise _contradiction(poses, beyond)
    return found


def require_poses(poses: Sequence[Pose]) -> None:
    """Check that there are enough poses, with different loads.

    Raises:
        WeighingError: there are too few, or their loads are equal.
    """
    if len(poses) < LEAST_POSES:
        raise WeighingError(
            f"{len(poses)} pose(s): at least {LEAST_POSES} needed, or a wrong weight could not be noticed; add another "
            "weight"
        )
    loads = [pose.weight_n for pose in poses]
    apart = max(float(np.linalg.norm(p.load_n / p.weight_n - poses[0].load_n / loads[0])) for p in poses)
    if max(loads) < LEAST_RATIO * min(loads) and apart < math.radians(10):
        raise WeighingError(
            f"all poses press with {min(loads):.1f} to {max(loads):.1f} N in one direction: use weights that differ by "
            f"a factor of {LEAST_RATIO:g} or more, or another tilt"
        )


def require_unit(pose: Pose) -> None:
    """Check that a pose's gain is one that silicone can have.

    Raises:
        WeighingError: it is not; the message names the unit with which it would be.
    """
    gain = pose.weight_n / pose.reading_n if pose.reading_n > 0 else math.nan
    if SOFTEST <= gain <= STIFFEST:
        return
    read = f"{pose.name}: {pose.weight_n:.3g} N are meant to press, the endcap reads {pose.reading_n:.3g} N"
    if not gain > 0:
        raise WeighingError(f"{read} the other way: is the tilt right, and was it zeroed untouched?")
    likely = [(unit, gain * size) for unit, size in UNITS_G.items() if SOFTEST <= gain * size <= STIFFEST]
    likely.sort(key=lambda entry: abs(math.log(entry[1])))
    if likely:
        words = " or ".join(f"{unit} (gain {value:.2f})" for unit, value in likely)
        raise WeighingError(f"{read}: that is no weight in g; was it {words}? give g, or the unit with the number")
    if 1 / STIFFEST <= gain / 1000 <= STIFFEST:
        raise WeighingError(f"{read}: the weight is about a thousand times too large; was it mg? give g")
    raise WeighingError(
        f"{read}: a gain of {gain:.3g} is outside {SOFTEST:g}..{STIFFEST:g}, what silicones have: check weight and unit"
    )


def pose_gain(pose: Pose) -> tuple[float, float]:
    """(gain, standard deviation) of one pose."""
    found = _fitted([pose])
    return found.gain, found.sd


def _fitted(poses: Sequence[Pose]) -> Gain:
    estimates, loads = np.array([p.force_n for p in poses]), np.array([p.load_n for p in poses])
    size = np.linalg.norm(loads, axis=1)
    along = np.einsum("ni,nj->nij", loads, loads) / size[:, None, None] ** 2
    model = np.array([p.covariance for p in poses]) + MODEL_SD**2 * np.einsum("ni,nj->nij", estimates, estimates)
    weight = np.array([p.load_sd_n**2 for p in poses])[:, None, None] * along
    weight = weight + ((size * ATTITUDE_RAD) ** 2)[:, None, None] * (np.eye(3) - along)
    gain = float((estimates * loads).sum() / (estimates**2).sum())
    for _ in range(ROUNDS):
        pull = np.linalg.solve(gain**2 * model + weight, estimates[:, :, None])[:, :, 0]  # V^-1 f
        before, gain = gain, float((pull * loads).sum() / (pull * estimates).sum())
        if abs(gain - before) < 1e-12 * abs(gain):
            break
    residual = gain * estimates - loads
    share = pull / (pull * estimates).sum()
    of_model = gain * np.sqrt(np.einsum("ni,nij,nj->n", share, model, share)).sum()
    of_weight = math.sqrt(np.einsum("ni,nij,nj->", share, weight, share))
    variance = gain**2 * model + weight
    chi_square = float(np.einsum("ni,ni->", residual, np.linalg.solve(variance, residual[:, :, None])[:, :, 0]))
    left = np.einsum("ni,ni->n", residual, loads) ** 2
    on_it = float((left / np.einsum("ni,nij,nj->n", loads, variance, loads)).sum())
    return Gain(gain, math.hypot(of_model, of_weight), chi_square, 3 * len(poses) - 1, residual, on_it)


def _chi_square_across(pose: Pose, gain: float) -> float:
    """Chi-square of the residual across the load: no other weight makes it smaller, but another attitude does."""
    across = np.linalg.svd(pose.load_n[None, :])[2][1:]  # (2, 3), orthogonal to the load
    side = across @ (gain * pose.force_n)
    model = pose.covariance + MODEL_SD**2 * np.outer(pose.force_n, pose.force_n)
    variance = gain**2 * across @ model @ across.T + (pose.weight_n * ATTITUDE_RAD) ** 2 * np.eye(2)
    return float(side @ np.linalg.solve(variance, side))


def _leaning(poses: Sequence[Pose], gain: float, beyond: str) -> str:
    """By how much the forces lean, and the attitudes that would explain it; one attitude where all agree."""
    across = [_chi_square_across(pose, gain) for pose in poses]
    limit = chi_square_quantile(1 - CONTRADICTION, 2)
    found = [pose for pose, size in zip(poses, across, strict=True) if size > limit or size == max(across)]
    shown = np.array([-pose.force_n / np.linalg.norm(pose.force_n) for pose in found])
    given = np.array([-pose.load_n / pose.weight_n for pose in found])
    mean = shown.mean(axis=0) / np.linalg.norm(shown.mean(axis=0))
    alike = [
        _angle_deg(v, mean) < ALIKE_DEG and _angle_deg(up, given[0]) < SAME_DEG
        for v, up in zip(shown, given, strict=True)
    ]
    if all(alike) and len(found) == len(poses):
        said = f"the force leans by {_angle_deg(mean, given[0]):.1f} degrees from the vertical given"
        names, shown = [""], mean[None, :]
    else:
        leans = [f"{p.name} by {_angle_deg(v, up):.1f}" for p, v, up in zip(found, shown, given, strict=True)]
        said = f"the force leans from the vertical given, under {', under '.join(leans)} degrees"
        names = [f" for {pose.name}" for pose in found]
    fix = "level the table and let nothing push the weight sideways"
    if max(_angle_deg(up, np.array([0.0, 0.0, 1.0])) for up in shown) <= MOST_TILT_DEG:
        words = ", ".join(f"{_attitude(up)}{name}" for up, name in zip(shown, names, strict=True))
        fix = f"{fix}, or give {words}"
    return f"{said}, which no wrong weight does {beyond}: {fix}"


def _attitude(up: Array) -> str:
    """A vertical in the endcap frame, in the words of a pose."""
    azimuth_deg = math.degrees(math.atan2(up[1], up[0])) % 360
    return f"tilt={math.degrees(math.acos(min(1.0, up[2]))):.1f},azimuth={azimuth_deg:.1f}"


def _angle_deg(one: Array, other: Array) -> float:
    """Angle between unit vectors, degrees; by the sine, too, because the cosine alone is inaccurate for small ones."""
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other)))


def _contradiction(poses: Sequence[Pose], beyond: str) -> ContradictionError:
    """Names the pose without which the others agree best; of two, both."""
    head = f"the weights contradict one another {beyond}"
    single = [pose_gain(pose)[0] for pose in poses]
    if len(poses) == LEAST_POSES:
        shown = zip(poses, single, strict=True)
        both = " and ".join(f"{pose.name} shows a gain of {gain:.3f}" for pose, gain in shown)
        return ContradictionError(f"{head}: {both}; weigh both again, with a third", None)
    rest = [_fitted([each for each in poses if each is not pose]) for pose in poses]
    worst = int(np.argmin([found.chi_square for found in rest]))
    others = single[:worst] + single[worst + 1 :]
    left = rest[worst]
    agree = left.chi_square <= left.limit and left.along <= left.limit_along
    return ContradictionError(
        f"{head}: {poses[worst].name} shows a gain of {single[worst]:.3f}, the others {min(others):.3f} to "
        f"{max(others):.3f}; weigh it again",
        worst if agree else None,
    )
