"""Fits the constants of the rate effects to one dwell test: a weight is put on, left, and taken off (N, s).

    found = fit_dwell(time_s, force_n, sd_n)
    found.terms

While a dead weight stands on the dome the true force is constant, and zero once it is gone; the force of the model
creeps, because it depends on the shell's shape alone. The fitted terms make the corrected force constant in the dwell,
and after it equal to that before: the weight need not be known, and the moments at which it is put on and
taken off are not used. A small constant reading of the untouched endcap is due to an old reference, not to creep.

Notes:
    For given relaxation times the corrected force is linear in the strengths b and the dwell's level F,
    f(t_k) + sum_i b_i g_i(t_k) = F on the dwell and 0 after it, g_i the overstress of unit strength
    (:func:`sensing.wrench.relaxation.advanced`): non-negative least squares for each pair of times on a logarithmic
    grid, refined around the best (variable projection: Golub, Pereyra 1973, doi:10.1137/0710036). Deviations are those
    of the linearised fit, times included, with the residuals' autocorrelation counted. Times that the test cannot
    separate show as one term.

    The g_i are made of readings that scatter, which would make strengths too small, the more the longer the dwell and
    the lighter the weight (errors in variables: Fuller 1987, Measurement error models, sec. 2.2). So what scatter of
    the readings' size, white, adds to squares and products is subtracted (:mod:`sensing.weighing.scatter`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError
from sensing.weighing.scatter import Scatter, scatter_of, unbiased
from sensing.wrench.contact import autocorrelation_time
from sensing.wrench.relaxation import Term, advanced

Array = NDArray[np.float64]
LEAST_DWELL_S, LEAST_AFTER_S = 3.0, 2.0  # least time under the weight, and after its release
LEAST_LOAD_N = 3.0  # least load, at D=130 T=8
LIFTED_PART, LIFTED_READINGS = 0.5, 3  # part of the load, and number of readings below it: the weight was lifted
JUMP_PART = 0.25  # of the steepest slope; below it the weight stands, and the remaining motion is creep
GRID = 13  # relaxation times that are evaluated in each round
RESOLUTION = 0.002  # relative resolution of the relaxation times
STEP = 1e-4  # relative step of a relaxation time for derivatives
SIGNIFICANT = 3.0  # in standard deviations; a term of smaller strength is left out


class DwellError(EndcapError):
    """A dwell test that does not determine constants: too short, no load, or no rate effect above the noise."""


@dataclass(frozen=True)
class Dwell:
    """Result of a dwell test.

    Attributes:
        terms: terms of the Prony series, short times first.
        rest_n: median force before the weight, which is subtracted, N.
        level_n: corrected force in the dwell, N.
        before_n, after_n: root mean square creep in the dwell and after it, without and with the correction, N.
        noise_n: standard deviation of single readings, N.
        used: (n,) bool, whether the reading was used.
        corrected_n: (n,) corrected force, N.
    """

    terms: tuple[Term, ...]
    rest_n: float
    level_n: float
    before_n: float
    after_n: float
    noise_n: float
    used: NDArray[np.bool_]
    corrected_n: Array

    @property
    def left_share(self) -> float:
        """Part of the creep that the terms leave, without the noise of single readings; 0 is a perfect fit."""
        creep, left = (math.sqrt(max(n**2 - self.noise_n**2, 0.0)) for n in (self.before_n, self.after_n))
        return left / creep if creep else 1.0


def fit_dwell(time_s: Array, force_n: Array, load_scale: float = 1.0) -> Dwell:
    """Fit the terms to one dwell test.

    Args:
        time_s: (n,) rising times, s.
        force_n: (n,) force of the model along the load, N, positive under it; untouched at the start.
        load_scale: scale of the endcap's forces (:mod:`sensing.wrench.load_scale`).

    Raises:
        DwellError: no load, a dwell or a time after it that is too short, or no relaxation.
    """
    rest_n, dwell, after = _intervals(time_s, force_n, LEAST_LOAD_N * load_scale)
    force_n, used = force_n - rest_n, dwell | after
    test = _Test(time_s, force_n, dwell, after, _noise_n(force_n, used))
    centre, width = math.log(0.5), math.log(30.0)
    times = np.exp(np.linspace(centre - width, centre + width, GRID))
    best = _best(test, list(itertools.combinations(times, 2)))
    width /= GRID - 1
    while width > RESOLUTION:
        near = np.exp([-width, 0.0, width])
        found = _best(test, [(best[1][0] * a, best[1][1] * b) for a in near for b in near])
        best, width = (found, width) if found[0] < best[0] - 1e-12 * abs(best[0]) else (best, width / 2)
    terms = _significant(test, best[1])
    if not terms:
        raise DwellError(
            "no rate effect over the noise: the force under the weight does not creep; leave relaxation out, or repeat "
            "with a heavier weight put on at once"
        )
    curves = unit_overstress(time_s, force_n, [term.tau_s for term in terms])
    corrected = force_n + np.array([term.strength for term in terms]) @ curves
    level = float(corrected[dwell].mean())
    left = [np.concatenate([f[dwell] - f[dwell].mean(), f[after]]) for f in (force_n, corrected)]
    before_n, after_n = (float(np.sqrt((each**2).mean())) for each in left)
    return Dwell(terms, rest_n, level, before_n, after_n, test.noise_n, used, corrected)


@dataclass(frozen=True)
class _Test:
    """Readings of a dwell test: times, s, forces less those before the weight, N, and which are of which part."""

    time_s: Array
    force_n: Array
    dwell: NDArray[np.bool_]
    after: NDArray[np.bool_]
    noise_n: float

    def scatter(self, taus_s: Sequence[float]) -> Scatter:
        """What the readings' scatter adds for terms of these relaxation times, s."""
        return scatter_of(self.time_s, self.dwell | self.after, taus_s, self.noise_n)


def _noise_n(force_n: Array, used: NDArray[np.bool_]) -> float:
    """Standard deviation of single readings, N: median of second differences, where creep is small and jumps few."""
    second = np.diff(force_n, 2)[np.flatnonzero(used[1:-1])]
    return 1.4826 * float(np.median(np.abs(second))) / math.sqrt(6)


def _intervals(time_s: Array, force_n: Array, least_n: float) -> tuple[float, NDArray[np.bool_], NDArray[np.bool_]]:
    """(force before the load, readings of the dwell, those after it), without the moments around load and release.

    Raises:
        DwellError: the force does not rise, stay and fall.
    """
    if len(time_s) < 30 or not np.isfinite(force_n).all() or not (np.diff(time_s) > 0).all():
        raise DwellError(f"{len(time_s)} readings: a dwell test has hundreds, in the order of time")
    largest = float(np.quantile(force_n, 0.9))
    if largest < least_n:
        raise DwellError(f"the force never exceeds {largest:.2g} N: put a weight of {least_n:.2g} N or more on it")
    top = float(np.median(force_n[force_n > 0.5 * largest]))
    loaded = np.flatnonzero(force_n > 0.8 * top)
    if force_n[: max(1, loaded[0] // 2)].min() > 0.2 * top:
        raise DwellError("the test begins under load: begin with the untouched endcap")
    slope = np.abs(np.diff(force_n) / np.diff(time_s))
    first, last = _settled(slope, int(loaded[0]), 1), _settled(slope, int(loaded[-1]), -1)
    if time_s[last] - time_s[first] < LEAST_DWELL_S:
        stood_s = max(0.0, time_s[last] - time_s[first])
        raise DwellError(f"the weight stands for {stood_s:.1f} s: leave it for {LEAST_DWELL_S:g} s or more")
    stood_n = force_n[first : last + 1]
    if (stood_n < LIFTED_PART * top).sum() >= LIFTED_READINGS:
        raise DwellError(
            f"the force falls to {stood_n.min():.2g} N while the weight should stand with {top:.2g} N: put it on once "
            "and leave it untouched until it is taken off"
        )
    gone = np.flatnonzero(np.abs(force_n[loaded[-1] :]) < 0.2 * top)
    free = _settled(slope, int(loaded[-1] + gone[0]), 1) if len(gone) else len(time_s) - 1
    if time_s[-1] - time_s[free] < LEAST_AFTER_S:
        left_s = time_s[-1] - time_s[free]
        raise DwellError(f"{left_s:.1f} s after the release: record {LEAST_AFTER_S:g} s or more without the weight")
    untouched = _settled(slope, int(np.flatnonzero(force_n > 0.2 * top)[0]), -1)
    rest_n = float(np.median(force_n[: untouched + 1]))
    place = np.arange(len(time_s))
    return rest_n, (place >= first) & (place <= last), place >= free


def unit_overstress(time_s: Array, force_n: Array, taus_s: Sequence[float]) -> Array:
    """(terms, n) overstress for terms of strength one.

    Args:
        time_s, force_n: (n,) times, s, and forces, N, of the curve.
        taus_s: relaxation time of each term, s.
    """
    tau = np.asarray(taus_s, float)
    found, now = np.zeros((len(tau), len(time_s))), np.zeros((len(tau), 1))
    for k in range(1, len(time_s)):
        now = advanced(
            now, force_n[k : k + 1] - force_n[k - 1], float(time_s[k] - time_s[k - 1]), np.ones(len(tau)), tau
        )
        found[:, k] = now[:, 0]
    return found


def _settled(slope: Array, start: int, way: int) -> int:
    """First reading from ``start`` on, in the direction ``way``, at which the jump around ``start`` is over."""
    near = slope[max(0, start - 15) : start + 15]
    limit = JUMP_PART * float(near.max())
    place = start
    while 0 < place < len(slope) and slope[place - 1 if way > 0 else place] > limit:
        place += way
    return place


def _best(test: _Test, pairs: Sequence[tuple[float, float]]) -> tuple[float, tuple[float, float]]:
    """(least sum of squares less what scatter adds, its pair of relaxation times)."""
    taus = sorted({tau for pair in pairs for tau in pair})
    curves, scatter = unit_overstress(test.time_s, test.force_n, taus), test.scatter(taus)
    results = []
    for pair in pairs:
        rows = [taus.index(tau) for tau in pair]
        results.append((_solved(curves[rows], scatter.of(rows), test)[0], (min(pair), max(pair))))
    return min(results)


def _solved(curves: Array, scatter: Scatter, test: _Test) -> tuple[float, Array, Array]:
    """(sum of squares less what scatter adds, strengths (terms,) of at least zero, design matrix)."""
    matrix, wanted = _system(curves, test)
    strength = np.zeros(len(curves))
    active = list(range(len(curves)))
    while active:  # negative terms are left out
        found, counted = unbiased(matrix[:, active], wanted, scatter.of(active))
        if (found >= 0).all():
            left = wanted - matrix[:, active] @ found
            strength[active] = found
            return (
                float(left @ left - found @ counted.squares @ found - 2 * found @ counted.with_reading),
                strength,
                matrix,
            )
        del active[int(found.argmin())]
    return float(wanted @ wanted), strength, matrix


def _system(curves: Array, test: _Test) -> tuple[Array, Array]:
    """Design matrix and right-hand side: the dwell without its mean (which eliminates the level), then the rest."""
    force_n, dwell, after = test.force_n, test.dwell, test.after
    rows = np.vstack([(curves[:, dwell] - curves[:, dwell].mean(axis=1, keepdims=True)).T, curves[:, after].T])
    wanted = -np.concatenate([force_n[dwell] - force_n[dwell].mean(), force_n[after]])
    return rows, wanted


def _significant(test: _Test, taus_s: tuple[float, ...]) -> tuple[Term, ...]:
    """The terms with a significant strength; the weakest of the others is removed first."""
    taus = list(taus_s)
    while taus:
        curves = unit_overstress(test.time_s, test.force_n, taus)
        _, strength, matrix = _solved(curves, test.scatter(taus), test)
        left = _system(curves, test)[1] - matrix @ strength
        variance = float(left @ left) / max(1, len(left) - 2 * len(taus) - 1) * autocorrelation_time(left)
        moved = unit_overstress(test.time_s, test.force_n, [tau * (1 + STEP) for tau in taus])
        by_time = strength[:, None] * (moved - curves) / STEP  # derivative by the logarithm of a relaxation time
        whole = np.hstack([matrix, _system(by_time, test)[0]])
        scale = np.maximum(np.linalg.norm(whole, axis=0), 1e-12)
        inverse = np.linalg.pinv((whole / scale).T @ (whole / scale), rcond=1e-10) / np.outer(scale, scale)
        sd = np.sqrt(variance * np.diagonal(inverse))[: len(taus)]
        ratio = strength / np.maximum(sd, 1e-12)
        if (ratio > SIGNIFICANT).all():
            return tuple(Term(float(b), float(tau), float(s)) for b, tau, s in zip(strength, taus, sd, strict=True))
        del taus[int(ratio.argmin())]
        if taus:
            taus = [_best_single(test)]
    return ()


def _best_single(test: _Test) -> float:
    taus = np.exp(np.linspace(math.log(0.02), math.log(20.0), 60)).tolist()
    curves, scatter = unit_overstress(test.time_s, test.force_n, taus), test.scatter(taus)
    costs = [_solved(curves[k : k + 1], scatter.of([k]), test)[0] for k in range(len(taus))]
    return float(taus[int(np.argmin(costs))])
