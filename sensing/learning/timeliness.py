"""Errors of filtered wrenches of moving contacts at the time for which they are reported (s, N, N m)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sensing.learning.samples import Samples
from sensing.learning.scores import Score, score
from sensing.records import Wrench
from sensing.wrench.filter import FilterConfig, WrenchFilter

LATENCY_S = 0.05  # E: from mid-exposure to the answer of a USB camera; also the paper's pairing window
LAG_FRAMES = 10  # fewest frame intervals of a run whose lag is searched
MOVING_N = 1.0  # least standard deviation of a force component whose lag is searched, at D=130 T=8

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Run:
    """Filtered wrenches of one run and the truth, all at the n times for which they are reported.

    Attributes:
        reported, truth: (n, 6) wrenches, N and N m.
        covariance: (n, 6, 6) of ``reported``.
        contact: (n,) whether a frame next to that time has contact.
        time_s: (n,) times, s.
    """

    reported: Array
    truth: Array
    covariance: Array
    contact: NDArray[np.bool_]
    time_s: Array


def filtered_score(
    value: Array, covariance: Array, test: Samples, load_scale: float, latency_s: float, predict: bool = True
) -> Score:
    """Score of filtered wrenches at capture time plus latency, against the truth at that time.

    Args:
        value, covariance: (N, 6) answers of single frames, N and N m, and (N, 6, 6) their covariances.
        test: the frames; runs with too few for the latency are left out.
        load_scale: scale of the endcap's forces (:mod:`sensing.wrench.load_scale`).
        latency_s: time from the capture to the report, s.
        predict: False reports the wrench of the capture time late, without prediction.
    """
    config, moving_n = FilterConfig().scaled(load_scale, test.design.outer_radius_mm), MOVING_N * load_scale
    runs = [_filtered(test, rows, value, covariance, latency_s, WrenchFilter(config), predict) for rows in _runs(test)]
    lags = [lag for run in runs if np.isfinite(lag := _lag_of_run(run, moving_n))]
    scored = score(
        np.concatenate([run.reported for run in runs]),
        np.concatenate([run.truth for run in runs]),
        np.concatenate([run.contact for run in runs]),
        np.concatenate([run.covariance for run in runs]),
        load_scale=load_scale,
    )
    return replace(scored, lag_s=float(np.median(lags)) if lags else float("nan"))


def _runs(test: Samples) -> Iterator[NDArray[np.int64]]:
    """Rows of each run in the order of time; of several states reported for one time, the last."""
    run = np.array([f"{path} {azimuth}" for path, azimuth in zip(test.path, test.azimuth_deg, strict=True)])
    for name in np.unique(run):
        rows = np.flatnonzero(run == name)
        rows = rows[np.argsort(test.time_s[rows], kind="stable")]
        yield rows[np.diff(test.time_s[rows], append=np.inf) > 0]


def _filtered(
    test: Samples, rows: NDArray[np.int64], value: Array, covariance: Array, latency_s: float, smooth: WrenchFilter,
    predict: bool,
) -> _Run:  # fmt: skip
    times = test.time_s[rows]
    reported, spread = [], []
    for row in rows[times + latency_s <= times[-1]]:
        at = test.time_s[row]
        smooth.update(Wrench(at, value[row, :3], value[row, 3:], "sphere", covariance[row]))
        answer = smooth.now(at + latency_s) if predict else smooth.at(at)
        reported.append([*answer.force_n, *answer.torque_nm])
        spread.append(answer.covariance)
    now = times[: len(reported)] + latency_s
    truth = np.stack([np.interp(now, times, test.wrenches[rows, axis]) for axis in range(6)], axis=1)
    contact = np.interp(now, times, test.contact[rows].astype(float)) > 0
    return _Run(np.reshape(reported, (-1, 6)), truth, np.reshape(spread, (-1, 6, 6)), contact, now)


def _lag_of_run(run: _Run, moving_n: float) -> float:
    """Lag of the force component that moves most, s; NaN where none moves, or frames are few or missing."""
    steps = np.diff(run.time_s)
    if len(steps) < LAG_FRAMES or steps.max() > 1.5 * np.median(steps):
        return float("nan")
    axis = int(run.truth[:, :3].std(axis=0).argmax())
    moves = run.truth[:, axis].std() > moving_n
    return lag_s(run.reported[:, axis], run.truth[:, axis], run.time_s) if moves else float("nan")


def lag_s(reported: Array, truth: Array, times_s: Array) -> float:
    """Delay of a wrench behind the truth, s: the shift of least misfit (vertex of the parabola through three shifts).

    Args:
        reported, truth: (n,) values of one axis.
        times_s: (n,) times of both, evenly spaced, s.
    """
    step = float(np.median(np.diff(times_s)))
    shifts = np.arange(-5, 6)
    misfits = np.array([_misfit(reported, truth, int(k)) for k in shifts])
    best = int(np.clip(misfits.argmin(), 1, len(misfits) - 2))
    left, middle, right = misfits[best - 1 : best + 2]
    bend = left - 2 * middle + right
    return float(step * (shifts[best] + (0.5 * (left - right) / bend if bend > 0 else 0.0)))


def _misfit(reported: Array, truth: Array, shift: int) -> float:
    """Mean square difference of an answer to the truth ``shift`` samples earlier."""
    ahead, behind = (
        (reported[shift:], truth[: len(truth) - shift]) if shift >= 0 else (reported[:shift], truth[-shift:])
    )
    return float(((ahead - behind) ** 2).mean())
