"""Errors of filtered wrenches of moving contacts at the time for which they are reported (s, N, N m)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sensing.learning.samples import Samples
from sensing.learning.scores import Score, score
from sensing.records import Wrench
from sensing.wrench.filter import FilterConfig, WrenchFilter
from sensing.wrench.model import WrenchModel

LATENCY_S = 0.05  # E: from mid-exposure to the answer of a USB camera; also the paper's pairing window
LAG_FRAMES = 10  # least that a lag is looked for in
MOVING_N = 1.0  # least standard deviation of the force, likewise, at D=130 T=8

Array = NDArray[np.float64]


def filtered_score(model: WrenchModel, test: Samples, latency_s: float, predict: bool = True) -> Score:
    """Score of the filter's answers at capture time plus latency, against the truth at that time.

    Args:
        model: answers single frames.
        test: frames; runs with too few for the latency are left out.
        latency_s: from capture to answer.
        predict: False leaves the lag in: the answer of capture time comes late.
    """
    value, covariance = model.predict(test.inputs)
    config, moving_n = FilterConfig().scaled(model.load_scale), MOVING_N * model.load_scale
    answers = [
        _answers(test, rows, value, covariance, latency_s, WrenchFilter(config), predict) for rows in _runs(test)
    ]
    reported, truth, spread, contact, _ = map(np.concatenate, zip(*answers, strict=True))
    found = [_lag_of_run(reported_, truth_, now, moving_n) for reported_, truth_, _, _, now in answers]
    lags = [lag for lag in found if np.isfinite(lag)]
    scored = score(reported, truth, contact, spread, load_scale=model.load_scale)
    return replace(scored, lag_s=float(np.median(lags)) if lags else float("nan"))


def _runs(test: Samples) -> Iterator[NDArray[np.int64]]:
    """Rows of each run in the order of time; of states reported for one time, the last."""
    run = np.array([f"{path} {azimuth}" for path, azimuth in zip(test.path, test.azimuth_deg, strict=True)])
    for name in np.unique(run):
        rows = np.flatnonzero(run == name)
        rows = rows[np.argsort(test.time_s[rows], kind="stable")]
        yield rows[np.diff(test.time_s[rows], append=np.inf) > 0]


def _answers(
    test: Samples, rows: NDArray[np.int64], value: Array, covariance: Array, latency_s: float, smooth: WrenchFilter,
    predict: bool,
) -> tuple[Array, Array, Array, NDArray[np.bool_], Array]:  # fmt: skip
    """Answers and truth (n, 6), covariances (n, 6, 6), contact and times (n,) of a run, all at the times of the report;
    there is contact where a frame beside that time has it."""
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
    return np.reshape(reported, (-1, 6)), truth, np.reshape(spread, (-1, 6, 6)), contact, now


def _lag_of_run(reported: Array, truth: Array, times_s: Array, moving_n: float) -> float:
    """Lag of the force that moves most; NaN where none moves, or frames are few or missing."""
    steps = np.diff(times_s)
    if len(steps) < LAG_FRAMES or steps.max() > 1.5 * np.median(steps):
        return float("nan")
    axis = int(truth[:, :3].std(axis=0).argmax())
    return lag_s(reported[:, axis], truth[:, axis], times_s) if truth[:, axis].std() > moving_n else float("nan")


def lag_s(reported: Array, truth: Array, times_s: Array) -> float:
    """Delay of an answer behind the truth: the shift that leaves the least misfit (parabola through the best three).

    Args:
        reported, truth: (n,) values of one axis.
        times_s: (n,) of both, evenly spaced.
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
