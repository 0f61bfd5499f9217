"""Errors of a pose at a time at which an inertial sensor has no sample.

Notes:
    A sample is the mean over the time D that ends at its stamp. For a rate or an acceleration that is a random walk of
    intensity q, means that follow one another differ by 2 q D / 3 in the mean square (which is watched), and what is
    integrated to the time t after the last sample has these variances:

    - by the last mean, while no later one is known: once q (t^3 / 3 + D t^2 / 3), twice q (D t^4 / 12 + t^5 / 20);
    - by the mean that contains t: once q t^2 (D - t)^2 / (3 D), twice q (D t^4 / 12 - 7 t^5 / 60 + t^6 / (24 D)).

    At t = D the mean puts turns and velocities right, so no covariance of the filter contains these errors: they count
    as errors of what is measured at that time. Of places q D^5 / 120 remains. Where samples of a time M are missing
    before one, the mean of its neighbours stands for them, whose integral has the variance q M^2 (M / 12 + D / 6): that
    of a Brownian bridge, and of its ends, which means over D give with a variance of q D / 3.
"""

from __future__ import annotations

import numpy as np

from sensing.robot.layout import Layout
from sensing.robot.measurement_kernels import between_variances
from sensing.robot.settings import Settings
from sensing.robot.state import State
from sensing.tensegrity.description import Array
from sensing.tensegrity.vectors import minus_cross

TUNED_S = 0.005  # time between the samples with which the noises of Settings were chosen: they contain what it leaves


def is_between(state: State) -> bool:
    """Whether an inertial sensor has no sample at the state's time."""
    return bool((state.time_s > state.rate_s).any())


def measured_errors(state: State, rows: Array, layout: Layout, settings: Settings) -> Array:
    """(n,) variances that the errors between samples add to measurements at the state's time.

    Args:
        state: state of the filter.
        rows: (n, N) slopes of the measurements by the error state.
        layout, settings: indices and assumptions of the estimator.
    """
    if not is_between(state):
        return np.zeros(len(rows))
    bars = range(layout.bars)
    return between_variances(
        rows, np.array([turn_variance(state, bar, settings) for bar in bars]),
        np.array([_moved(state, bar, layout, settings) for bar in bars]), layout.has_force, state.place,
        state.velocity, state.anchor, state.normal, state.anchored, layout.endcap_bar, layout.radius_m, state.leader,
    )  # fmt: skip


def turn_variance(state: State, bar: int, settings: Settings) -> float:
    """Variance of a bar's turn about each axis since its last sample, rad^2; 0 at a sample, and in a silence.

    Args:
        state: state of the filter.
        bar: number of the bar.
        settings: assumptions of the estimator.
    """
    since_s, walk = _since_s(state, bar), rate_walk(state, bar, settings)
    return _once(state, bar, since_s, walk) if since_s and walk else 0.0


def turn_slopes(state: State, bar: int, layout: Layout) -> Array:
    """(N, 3) slopes of the error state by a turn of a bar, world axes: of the leading one, what refers to it, too.

    Args:
        state: state of the filter.
        bar: number of the bar.
        layout: indices of the robot.
    """
    slopes = np.zeros((layout.size, 3))
    slopes[layout.turn(bar)] = np.eye(3)
    if bar == state.leader:  # errors of places refer to its rotation, and do not change with it
        for other in range(layout.bars):
            slopes[layout.place(other)] = -minus_cross(state.place[other])
            slopes[layout.velocity(other)] = -minus_cross(state.velocity[other])
    for endcap in np.flatnonzero(state.anchored):
        at = layout.anchor(int(endcap))
        if bar == state.leader:
            slopes[at] = -minus_cross(state.anchor[endcap])
        if layout.endcap_bar[endcap] == bar:  # it rolls
            slopes[at] += layout.radius_m[endcap] * minus_cross(state.normal[endcap])
    return slopes


def rate_walk(state: State, bar: int, settings: Settings) -> float:
    """Intensity of a bar's rate as a random walk, rad^2/s^3; its mean square change contains the noise of two samples.

    Args:
        state: state of the filter.
        bar: number of the bar.
        settings: assumptions of the estimator.
    """
    return _walk(state, bar, float(state.rate_change[bar]), settings.rate_noise)


def extrapolate(state: State, layout: Layout, settings: Settings) -> None:
    """Add to the covariance of an answer that rates and accelerations have changed since the last samples.

    The next samples correct that, so the filter's own covariance must not contain it.

    Args:
        state: copy of the filter's state at the time of the answer; it is changed.
        layout, settings: indices and assumptions of the estimator.
    """
    for bar in range(layout.bars):
        if turned := turn_variance(state, bar, settings):
            slopes = turn_slopes(state, bar, layout)
            state.covariance += turned * slopes @ slopes.T
        if moved := _moved(state, bar, layout, settings)[0]:
            _add_along_axes(state, 3 * (2 * layout.bars + _driven(state, bar, layout)), moved**2)


def settle(state: State, bar: int, layout: Layout, settings: Settings) -> None:
    """Add what remains unknown once a new inertial sample has come: of places, and of samples that are missing.

    Args:
        state: state at the time of the sample; it is changed.
        bar: number of the bar.
        layout, settings: indices and assumptions of the estimator.
    """
    over_s, missed_s = float(state.rate_over_s[bar]), float(state.missed_s[bar])
    missing = missed_s**2 * (missed_s / 12 + over_s / 6)
    if missed_s:
        slopes = turn_slopes(state, bar, layout)
        state.covariance += rate_walk(state, bar, settings) * missing * slopes @ slopes.T
    if not layout.has_force[bar] or state.force_s[bar] != state.time_s or not (missed_s or over_s > 1.01 * TUNED_S):
        return
    walk = _walk(state, bar, float(state.force_change[bar]), settings.force_noise)
    if not walk:
        return
    remains = walk * over_s * max(0.0, over_s**4 - TUNED_S**4) / 120
    places = 3 * (layout.bars + _driven(state, bar, layout))
    _add_along_axes(state, places, remains)
    if missed_s:
        times = np.repeat([over_s + missed_s / 2, 1.0], len(places))
        both = np.concatenate([places, places + 3 * layout.bars])
        _add_along_axes(state, both, walk * missing * np.outer(times, times))


def _since_s(state: State, bar: int) -> float:
    """Time since a bar's last sample, s; 0 in a silence, of which the filter's own covariance knows."""
    since_s = state.time_s - float(state.rate_s[bar])
    return since_s if 0 < since_s <= state.silent_after_s[bar] else 0.0


def _by_later_mean(state: State, bar: int) -> bool:
    """Whether a bar was moved by the mean that contains the state's time, with no sample missing in it."""
    return bool(state.rate_until_s[bar] > state.time_s and not state.missed_s[bar])


def _once(state: State, bar: int, since_s: float, walk: float) -> float:
    """Variance of what is integrated once, of a random walk of that intensity."""
    over_s = float(state.rate_over_s[bar])
    if _by_later_mean(state, bar):
        return walk * since_s**2 * (over_s - since_s) ** 2 / (3 * over_s)
    return walk * since_s**2 * (since_s + over_s) / 3


def _moved(state: State, bar: int, layout: Layout, settings: Settings) -> tuple[float, float]:
    """Standard deviations of velocity, m/s, and place, m, by a bar's accelerometer; 0 at a sample."""
    since_s, over_s = _since_s(state, bar), float(state.rate_over_s[bar])
    walk = _walk(state, bar, float(state.force_change[bar]), settings.force_noise)
    if not (since_s and walk and layout.has_force[bar]):
        return 0.0, 0.0
    twice = over_s * since_s**4 / 12 + since_s**5 / 20
    if _by_later_mean(state, bar):
        twice = over_s * since_s**4 / 12 - 7 * since_s**5 / 60 + since_s**6 / (24 * over_s)
    return _once(state, bar, since_s, walk) ** 0.5, (walk * twice) ** 0.5


def _walk(state: State, bar: int, change: float, noise: float) -> float:
    """Intensity of a random walk whose means over the time of a sample differ by a mean square, with their noise."""
    over_s = float(state.rate_over_s[bar])
    if not over_s <= state.silent_after_s[bar]:
        return 0.0
    return 1.5 * max(0.0, change - 2 * noise**2 / over_s) / over_s


def _driven(state: State, bar: int, layout: Layout) -> np.ndarray:
    """Numbers of the bars that a bar's accelerometer moves: the leading one's moves those without, too."""
    without: list[int] = np.flatnonzero(layout.has_force == 0).tolist() if bar == state.leader else []
    return np.array([bar, *without])


def _add_along_axes(state: State, first: np.ndarray, covariance: float | Array) -> None:
    """Add a covariance that is the same along x, y and z; ``first``: (n,) numbers of the x components."""
    for at in (first, first + 1, first + 2):
        state.covariance[at[:, None], at] += covariance
