"""What the filter makes of a moving contact: errors of the wrench told for the time at which it is told (s, N, N m)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sensing.learning.samples import Samples
from sensing.learning.scores import Score, score
from sensing.records import Wrench
from sensing.wrench.filter import FilterConfig, WrenchFilter
from sensing.wrench.model import WrenchModel

LATENCY_S = 0.05  # E: from mid-exposure to the answer of a USB camera; also the paper's pairing window

Array = NDArray[np.float64]


def filtered_score(
    model: WrenchModel, test: Samples, latency_s: float, config: FilterConfig | None = None, predict: bool = True
) -> Score:
    """Score of the filter's answers at capture time plus latency, against the truth at that time.

    Args:
        model: answers single frames. test: frames; runs with too few for the latency are left out.
        latency_s: from capture to answer. predict: False leaves the lag in: the answer of capture time is told late.
    """
    value, covariance = model.predict(test.inputs)
    told, truth, spread, contact = [], [], [], []
    run = np.array([f"{path} {azimuth}" for path, azimuth in zip(test.path, test.azimuth_deg, strict=True)])
    for name in np.unique(run):
        rows = np.flatnonzero(run == name)
        rows = rows[np.argsort(test.time_s[rows], kind="stable")]
        rows = rows[np.diff(test.time_s[rows], append=np.inf) > 0]  # of states told for one time, the last
        times, filtering = test.time_s[rows], WrenchFilter(config)
        for row in rows:
            at = test.time_s[row]
            filtering.update(Wrench(at, value[row, :3], value[row, 3:], "sphere", covariance[row]))
            now = at + latency_s
            if now > times[-1]:
                break
            answer = filtering.at(now if predict else at)
            told.append([*answer.force_n, *answer.torque_nm])
            truth.append([np.interp(now, times, test.wrenches[rows, axis]) for axis in range(6)])
            spread.append(answer.covariance)
            contact.append(test.contact[row])
    return score(np.array(told), np.array(truth), np.array(contact, bool), np.array(spread))


def lag_s(told: Array, truth: Array, times_s: Array) -> float:
    """Delay of one answer behind the truth: the shift that correlates both best (parabola through the best three)."""
    step = float(np.median(np.diff(times_s)))
    a, b = told - told.mean(), truth - truth.mean()
    shifts = np.arange(-5, 6)
    scores = np.array([_overlap(a, b, int(k)) for k in shifts])
    best = int(np.clip(scores.argmax(), 1, len(scores) - 2))
    left, middle, right = scores[best - 1 : best + 2]
    bend = left - 2 * middle + right
    return float(step * (shifts[best] + (0.5 * (left - right) / bend if bend < 0 else 0.0)))


def _overlap(a: Array, b: Array, shift: int) -> float:
    """Product of a with b taken ``shift`` samples earlier."""
    return float((a[shift:] * b[: len(b) - shift]).sum() if shift >= 0 else (a[:shift] * b[-shift:]).sum())
