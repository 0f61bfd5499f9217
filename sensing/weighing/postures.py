"""Fits one gain for each endcap of a robot to its own weight: it stands in several postures, nothing else touches.

    found = fit_gains([Posture("one", up, forces, covariances, torques...), ...], weight_n=117.7)

Robot frame, N; names as in endcaps.toml.

Notes:
    In every posture p the forces of the ground carry the weight, sum_i g_i F_pi = W u_p, with F_pi the model's force on
    endcap i in the robot frame, and u_p the vertical. That is linear in the gains: generalised least squares with the
    covariance sum_i g_i^2 (C_pi + m^2 F_pi F_pi') + s^2 u u' + (W a)^2 (I - u u') of a posture
    (:mod:`sensing.weighing.gain` defines symbols). An endcap that never carries load, or only together with others in
    the same proportions, is refused by name. Errors that repeat from posture to posture do not average out of a gain's
    standard deviation: m and the relative error of W enter it in full, and the errors of C of one endcap are added over
    the postures, those of several endcaps and of the verticals as squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sensing.weighing.gain import ATTITUDE_RAD, CONTRADICTION, MODEL_SD, ROUNDS, SOFTEST, STIFFEST, Array, WeighingError
from sensing.wrench.quantiles import chi_square_quantile

LARGEST_SD = 0.1  # relative standard deviation of a gain above which the postures do not determine it
WEIGHT_SD = 0.005  # E: relative error of the robot's weight


@dataclass(frozen=True)
class Posture:
    """Readings of the robot standing still.

    Attributes:
        name: name that the user gave.
        up: (3,) vertical, robot frame, of any length.
        force_n: (3,) force of each endcap that carries load, robot frame, with gain one, N.
        covariance: (3, 3) covariance of each, N2.
    """

    name: str
    up: Array
    force_n: Mapping[str, Array]
    covariance: Mapping[str, Array]


@dataclass(frozen=True)
class RobotGains:
    """Result of the fit.

    Attributes:
        gain, sd: gain and its standard deviation by endcap.
        chi_square, freedom: chi-square of the residuals and its degrees of freedom.
    """

    gain: dict[str, float]
    sd: dict[str, float]
    chi_square: float
    freedom: int


def fit_gains(postures: Sequence[Posture], weight_n: float, endcaps: Sequence[str]) -> RobotGains:
    """Gains of all endcaps at once.

    Args:
        postures: postures, at least two.
        weight_n: weight of the robot, N.
        endcaps: names of the endcaps whose gain is wanted.

    Raises:
        WeighingError: too few postures, an endcap without a determined gain, or postures that contradict one another.
    """
    freedom = 3 * len(postures) - len(endcaps)
    if len(postures) < 2 or freedom < 1:
        raise WeighingError(
            f"{len(postures)} posture(s) for {len(endcaps)} gains: at least 2 needed, and 3 equations each must be "
            "more than the gains, or nothing can be contradicted"
        )
    unseen = [name for name in endcaps if not any(name in posture.force_n for posture in postures)]
    if unseen:
        raise WeighingError(
            f"{', '.join(unseen)} never carries load: add a posture in which it stands, or leave it out"
        )
    up = np.array([posture.up / np.linalg.norm(posture.up) for posture in postures])
    fit = _fitted(postures, weight_n * up, endcaps)
    gain, spread = fit.gain, _spread(fit, weight_n * up)
    _require_separated(fit, spread, endcaps)
    chi_square = _chi_square(fit, weight_n * up)
    limit = chi_square_quantile(1 - CONTRADICTION, freedom)
    if chi_square > limit:
        left = [[k for k in range(len(postures)) if k != p] for p in range(len(postures))]
        without = [_chi_square_of([postures[k] for k in rows], weight_n * up[rows], endcaps) for rows in left]
        raise WeighingError(
            f"the postures contradict one another (chi-square {chi_square:.0f}, at most {limit:.0f}), "
            f"{postures[int(np.argmin(without))].name} the most: does something else carry or pull the robot, "
            "are weight_n and the vertical right?"
        )
    odd = [f"{name} {g:.3g}" for name, g in zip(endcaps, gain, strict=True) if not SOFTEST <= g <= STIFFEST]
    if odd:
        raise WeighingError(f"gain of {', '.join(odd)} outside {SOFTEST:g}..{STIFFEST:g}: check weight_n (N)")
    gains, spreads = (dict(zip(endcaps, values.tolist(), strict=True)) for values in (gain, spread))
    return RobotGains(gains, spreads, chi_square, freedom)


@dataclass(frozen=True)
class _Fit:
    """Fit of k gains to p postures.

    Attributes:
        gain: (k,) gains.
        normal: (k, k) normal matrix.
        pull: (p, 3, k) inverse covariance of the residuals times the forces.
        variance: (p, 3, 3) covariance of the residuals, N2.
        forces: (p, 3, k) forces of the endcaps, N.
        covariance: (p, k, 3, 3) covariance of the forces, N2.
    """

    gain: Array
    normal: Array
    pull: Array
    variance: Array
    forces: Array
    covariance: Array


def _fitted(postures: Sequence[Posture], load_n: Array, endcaps: Sequence[str]) -> _Fit:
    """Fit of postures with loads (p, 3), N."""
    forces, covariance = np.zeros((len(postures), 3, len(endcaps))), np.zeros((len(postures), len(endcaps), 3, 3))
    for p, posture in enumerate(postures):
        for k, name in enumerate(endcaps):
            if name in posture.force_n:
                forces[p, :, k], covariance[p, k] = posture.force_n[name], posture.covariance[name]
    model = covariance + MODEL_SD**2 * np.einsum("pik,pjk->pkij", forces, forces)
    known = WEIGHT_SD**2 * np.einsum("pi,pj->pij", load_n, load_n) + _of_attitude(load_n)
    gain = np.ones(len(endcaps))
    for _ in range(ROUNDS):
        variance = np.einsum("k,pkij->pij", gain**2, model) + known
        pull = np.linalg.solve(variance, forces)
        normal = np.einsum("pik,pil->kl", pull, forces)
        before, gain = gain, np.linalg.lstsq(normal, np.einsum("pik,pi->k", pull, load_n), rcond=1e-10)[0]
        if np.abs(gain - before).max() < 1e-12:
            break
    return _Fit(gain, normal, pull, variance, forces, covariance)


def _of_attitude(load_n: Array) -> Array:
    """(p, 3, 3) covariance of loads (p, 3) by the uncertainty of the verticals, N2."""
    square = (load_n**2).sum(axis=1)[:, None, None]
    return np.asarray(ATTITUDE_RAD**2 * (square * np.eye(3) - np.einsum("pi,pj->pij", load_n, load_n)))


def _spread(fit: _Fit, load_n: Array) -> Array:
    """(k,) standard deviations of the gains."""
    share = np.einsum("jk,pik->pji", np.linalg.pinv(fit.normal), fit.pull)  # (p, k, 3): derivative of each gain
    of_model = np.sqrt(np.einsum("pji,plim,pjm->pjl", share, fit.covariance, share)).sum(axis=0) * np.abs(fit.gain)
    of_attitude = np.einsum("pji,pim,pjm->j", share, _of_attitude(load_n), share)
    whole = (MODEL_SD**2 + WEIGHT_SD**2) * fit.gain**2
    return np.asarray(np.sqrt((of_model**2).sum(axis=1) + of_attitude + whole))


def _chi_square(fit: _Fit, load_n: Array) -> float:
    residual = np.einsum("pik,k->pi", fit.forces, fit.gain) - load_n
    return float(np.einsum("pi,pi->", residual, np.linalg.solve(fit.variance, residual[:, :, None])[:, :, 0]))


def _chi_square_of(postures: Sequence[Posture], load_n: Array, endcaps: Sequence[str]) -> float:
    """Chi-square of a fit to some of the postures."""
    return _chi_square(_fitted(postures, load_n, endcaps), load_n)


def _require_separated(fit: _Fit, spread: Array, endcaps: Sequence[str]) -> None:
    """Check that every gain is determined separately, to a tenth of it: a soft silicone's is small.

    Raises:
        WeighingError: some are not; the message names them.
    """
    values, vectors = np.linalg.eigh(fit.normal * np.outer(fit.gain, fit.gain))
    blurred = spread > LARGEST_SD * np.abs(fit.gain)
    for value, vector in zip(values, vectors.T, strict=True):
        if value < 1 / LARGEST_SD**2:
            blurred |= np.abs(vector) > 0.3
    if blurred.any():
        names = ", ".join(name for name, bad in zip(endcaps, blurred, strict=True) if bad)
        raise WeighingError(
            f"the postures do not separate {names}: add one in which they carry the robot in other proportions"
        )
