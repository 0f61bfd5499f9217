"""One gain for each endcap of a robot from its own weight: it stands in several postures, nothing else touches.

    found = fit_gains([Posture("one", up, forces, covariances, torques...), ...], weight_n=117.7)

Robot frame, N; names as in endcaps.toml.

Notes:
    In every posture p the forces of the ground carry the weight, sum_i g_i F_pi = W u_p, with F_pi the model's force on
    endcap i, turned to the robot frame, and u_p the vertical. That is linear in the gains: generalised least squares
    with the covariance sum_i g_i^2 (C_pi + m^2 F_pi F_pi') + s^2 u u' + (W a)^2 (I - u u') of a posture
    (:mod:`sensing.weighing.gain` has the letters). An endcap that never carries load, or only together with others in
    the same proportions, is refused by name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sensing.weighing.gain import ATTITUDE_RAD, CONTRADICTION, MODEL_SD, ROUNDS, SOFTEST, STIFFEST, Array, WeighingError
from sensing.wrench.quantiles import chi_square_quantile

LARGEST_SD = 0.1  # of a gain, relative: beyond it the postures do not show it
WEIGHT_SD = 0.005  # E: of the robot's weight, relative


@dataclass(frozen=True)
class Posture:
    """The robot standing still.

    Attributes:
        name: as the user knows it. up: (3,) vertical, robot frame, any length.
        force_n: (3,) of each endcap that carries load, robot frame, gain one. covariance: (3, 3) of each.
    """

    name: str
    up: Array
    force_n: Mapping[str, Array]
    covariance: Mapping[str, Array]


@dataclass(frozen=True)
class RobotGains:
    """The result.

    Attributes:
        gain, sd: by endcap. chi_square, freedom: of the residuals.
    """

    gain: dict[str, float]
    sd: dict[str, float]
    chi_square: float
    freedom: int


def fit_gains(postures: Sequence[Posture], weight_n: float, endcaps: Sequence[str]) -> RobotGains:
    """Gains of all endcaps at once.

    Args:
        postures: at least two. weight_n: of the robot, N. endcaps: names of those whose gain is wanted.

    Raises:
        WeighingError: too few postures, an endcap that they do not show, or postures that contradict one another.
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
    gain, normal, variance, forces = _solved(postures, weight_n * up, endcaps)
    spread = np.sqrt(np.maximum(np.diagonal(np.linalg.pinv(normal)), 0.0))
    _require_separated(normal, spread, endcaps)
    chi_square = _chi_square(gain, variance, forces, weight_n * up)
    limit = chi_square_quantile(1 - CONTRADICTION, freedom)
    if chi_square > limit:
        left = [[k for k in range(len(postures)) if k != p] for p in range(len(postures))]
        without = [_refitted([postures[k] for k in rows], weight_n * up[rows], endcaps) for rows in left]
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


def _solved(postures: Sequence[Posture], load_n: Array, endcaps: Sequence[str]) -> tuple[Array, Array, Array, Array]:
    """Gains (k,), normal matrix (k, k), covariance of the residuals (p, 3, 3) and forces (p, 3, k)."""
    forces, model = np.zeros((len(postures), 3, len(endcaps))), np.zeros((len(postures), len(endcaps), 3, 3))
    for p, posture in enumerate(postures):
        for k, name in enumerate(endcaps):
            if name in posture.force_n:
                force = posture.force_n[name]
                forces[p, :, k] = force
                model[p, k] = posture.covariance[name] + MODEL_SD**2 * np.outer(force, force)
    square = (load_n**2).sum(axis=1)[:, None, None]
    along = np.einsum("pi,pj->pij", load_n, load_n)
    known = WEIGHT_SD**2 * along + ATTITUDE_RAD**2 * (square * np.eye(3) - along)
    gain = np.ones(len(endcaps))
    for _ in range(ROUNDS):
        variance = np.einsum("k,pkij->pij", gain**2, model) + known
        pull = np.linalg.solve(variance, forces)
        normal = np.einsum("pik,pil->kl", pull, forces)
        before, gain = gain, np.linalg.lstsq(normal, np.einsum("pik,pi->k", pull, load_n), rcond=1e-10)[0]
        if np.abs(gain - before).max() < 1e-12:
            break
    return gain, normal, variance, forces


def _chi_square(gain: Array, variance: Array, forces: Array, load_n: Array) -> float:
    residual = np.einsum("pik,k->pi", forces, gain) - load_n
    return float(np.einsum("pi,pi->", residual, np.linalg.solve(variance, residual[:, :, None])[:, :, 0]))


def _refitted(postures: Sequence[Posture], load_n: Array, endcaps: Sequence[str]) -> float:
    """Chi-square that some of the postures leave."""
    gain, _, variance, forces = _solved(postures, load_n, endcaps)
    return _chi_square(gain, variance, forces, load_n)


def _require_separated(normal: Array, spread: Array, endcaps: Sequence[str]) -> None:
    """Whether every gain is seen by itself.

    Raises:
        WeighingError: names those that are not.
    """
    values, vectors = np.linalg.eigh(normal)
    blurred = spread > LARGEST_SD
    for value, vector in zip(values, vectors.T, strict=True):
        if value < 1 / LARGEST_SD**2:
            blurred |= np.abs(vector) > 0.3
    if blurred.any():
        names = ", ".join(name for name, bad in zip(endcaps, blurred, strict=True) if bad)
        raise WeighingError(
            f"the postures do not separate {names}: add one in which they carry the robot in other proportions"
        )
