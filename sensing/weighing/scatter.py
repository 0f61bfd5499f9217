"""What scatter of the readings adds to sums of squares and products of a dwell test, and strengths without it.

The overstress of :mod:`sensing.weighing.dwell` is made of the readings that it is compared with, so it scatters as they
do (errors in variables: Fuller 1987, Measurement error models, sec. 2.2). N, s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST = 0.03  # E: part of the squares, in any direction of the terms, beyond which strengths would get too unsure


@dataclass(frozen=True)
class Scatter:
    """What scatter adds, on average, to sums over the rows that are fitted, N^2.

    Attributes:
        squares: (terms, terms) to those of the products of unit overstresses.
        with_reading: (terms,) to those of the products of each with the reading of its time.
    """

    squares: Array
    with_reading: Array

    def of(self, terms: Sequence[int]) -> Scatter:
        """That of some of the terms."""
        return Scatter(self.squares[np.ix_(terms, terms)], self.with_reading[terms])


def scatter_of(time_s: Array, used: NDArray[np.bool_], taus_s: Sequence[float], noise_n: float) -> Scatter:
    """What white scatter of the readings adds.

    Args:
        time_s: (n,) times of the readings, s.
        used: (n,) those that are fitted.
        taus_s: relaxation time of each term, s.
        noise_n: standard deviation of a reading, N.

    Notes:
        With g' = e g + r (f' - f) (:func:`sensing.wrench.relaxation.advanced`) and u the covariance of g and f, over a
        reading's variance, <g_i' g_j'> = e_i e_j <g_i g_j> + 2 r_i r_j - e_i u_i r_j - e_j u_j r_i, and u' = r. The
        mean of the dwell, which is subtracted from its rows, takes out one of hundreds of rows; that is neglected.
    """
    tau = np.asarray(taus_s, float)
    squares, own = np.zeros((len(tau), len(tau))), np.zeros(len(tau))
    total, with_reading = np.zeros_like(squares), np.zeros_like(own)
    for k, step_s in enumerate(np.diff(time_s), 1):
        part = step_s / tau
        ramp, keep = -np.expm1(-part) / part, np.exp(-part)
        crossed = np.outer(keep * own, ramp)
        squares = np.outer(keep, keep) * squares + 2 * np.outer(ramp, ramp) - crossed - crossed.T
        own = ramp
        if used[k]:
            total, with_reading = total + squares, with_reading + own
    return Scatter(noise_n**2 * total, noise_n**2 * with_reading)


def unbiased(matrix: Array, wanted: Array, scatter: Scatter) -> tuple[Array, Scatter]:
    """(least-squares strengths without what scatter adds, what was subtracted: nothing where it is too much).

    Args:
        matrix: (rows, terms) unit overstresses.
        wanted: (rows,) their sum, less the readings.
        scatter: of these terms.
    """
    raw = matrix.T @ matrix
    size = np.sqrt(np.maximum(np.diag(raw), 1e-300))
    if np.linalg.eigvalsh((raw - scatter.squares / MOST) / size / size[:, None])[0] <= 0:
        scatter = Scatter(np.zeros_like(raw), np.zeros(len(raw)))
    normal = (raw - scatter.squares) / size / size[:, None]
    right = (matrix.T @ wanted + scatter.with_reading) / size
    return np.linalg.lstsq(normal, right, rcond=None)[0] / size, scatter
