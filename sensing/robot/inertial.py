"""Which rates and specific forces the predict step uses: each sample is a mean over the time that ends at its stamp.

A sample that was taken after the state's time, but whose interval contains it, is therefore used before its stamp: at
25 Hz a bar that tips turns otherwise than its last sample says for 40 ms, and lengths and contacts of that time would
be compared with a pose that the next sample puts right. Without such a sample the last one goes on.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sensing.robot.layout import Layout
from sensing.robot.state import SILENT_S, State
from sensing.tensegrity.description import Array
from sensing.tensegrity.samples import InertialSample

SLOWEST_S = 0.3  # E: longest time for which the last sample of a slow sensor is used
SLOWER = 1.2  # E: most by which one sample lengthens the usual time between samples
MISSED = 1.5  # E: usual times between samples from which one between them is missing
SILENT = 3.5  # E: usual times between samples of a slow sensor after which it is silent
CHANGES_S = 0.1  # E: time over which the changes of the rates are averaged


@dataclass(frozen=True)
class Used:
    """Means over a step.

    Attributes:
        rate, force: (B, 3) angular velocities, rad/s, and specific forces, m/s^2, bar axes, with their biases.
        heard: (2, B) whether the gyroscope and the accelerometer of the bar measure them.
    """

    rate: Array
    force: Array
    heard: np.ndarray


def silent_after_s(usual_s: float) -> float:
    """Time without a sample after which a sensor counts as silent, s: a slow one does not between its samples.

    Args:
        usual_s: usual time between its samples, s; inf where none is known.
    """
    return min(max(SILENT * usual_s, SILENT_S), SLOWEST_S) if usual_s < np.inf else SILENT_S


def usual_s(before_s: float, gap_s: float) -> float:
    """Usual time between samples after one more, s: one silence does not make a sensor slow.

    Args:
        before_s: the usual time before, s; inf where none is known.
        gap_s: time since the last sample, s.
    """
    return min(gap_s, SLOWER * before_s)


def used_over_step(state: State, time_s: float, samples: Iterable[InertialSample], layout: Layout) -> Used:
    """What the sensors say of the step from a state to a time; their samples' times and values go into the state.

    Args:
        state: state at the beginning of the step; its record of the sensors is changed.
        time_s: end of the step, s.
        samples: the next sample of each sensor, at that time or later.
        layout: indices of the robot.
    """
    step_s, longest_s = time_s - state.time_s, state.silent_after_s.tolist()
    rate, force = state.rate.copy(), state.force.copy()
    heard = np.array([time_s - state.rate_s, time_s - state.force_s]) <= state.silent_after_s
    for sample in samples:
        bar = layout.sensor_of_bar.index(sample.sensor)
        gap_s, left_s = sample.time_s - state.rate_s[bar], sample.time_s - state.time_s
        if sample.time_s > time_s and not 0 < gap_s <= longest_s[bar]:
            continue  # it comes after a silence
        turn, heard[0, bar] = layout.sensor_turn[bar], True
        new = turn @ sample.rate_rad_s
        _begin_rate(state, bar, new, sample.time_s, longest_s[bar])
        rate[bar] = _over_rest(state.rate_mean[bar], state.rate_used[bar], gap_s, left_s, longest_s[bar])
        if sample.time_s <= time_s:
            state.rate_s[bar], state.rate_used[bar] = sample.time_s, -rate[bar] * step_s
        if sample.acceleration_m_s2 is not None:
            gap_s = sample.time_s - state.force_s[bar]
            if sample.time_s > time_s and not 0 < gap_s <= longest_s[bar]:
                continue
            new, heard[1, bar] = turn @ sample.acceleration_m_s2, True
            missed_s = float(state.missed_s[bar])
            mean = _mean(new, state.force[bar], gap_s, missed_s)
            force[bar] = _over_rest(mean, state.force_used[bar], gap_s, left_s, longest_s[bar])
            if sample.time_s <= time_s:
                if gap_s <= longest_s[bar] and not missed_s:
                    _follow(state.force_change, bar, new - state.force[bar], gap_s)
                state.force[bar], state.force_s[bar] = new, sample.time_s
                state.force_used[bar] = -force[bar] * step_s
    if step_s > 0:
        state.rate_used += rate * step_s
        state.force_used += force * step_s
    return Used(rate, force, heard)


def _begin_rate(state: State, bar: int, rate: Array, until_s: float, longest_s: float) -> None:
    """Record a rate (3,), bar axes, that is a mean over the time from the last sample to ``until_s``, at its first use.

    The mean square of the change from one rate to the next follows, except where samples are missing.
    """
    if state.rate_until_s[bar] == until_s:
        return
    gap_s, usual = until_s - float(state.rate_s[bar]), float(state.usual_s[bar])
    missed_s = gap_s - usual if MISSED * usual < gap_s <= longest_s else 0.0
    if gap_s <= longest_s and not missed_s:
        _follow(state.rate_change, bar, rate - state.rate[bar], gap_s)
    state.rate_mean[bar] = _mean(rate, state.rate[bar], gap_s, missed_s)
    state.rate[bar], state.rate_until_s[bar] = rate, until_s
    state.rate_over_s[bar], state.missed_s[bar] = gap_s - missed_s, missed_s
    state.usual_s[bar] = usual_s(usual, gap_s)
    state.silent_after_s[bar] = silent_after_s(float(state.usual_s[bar]))


def _follow(square: Array, bar: int, change: Array, gap_s: float) -> None:
    """Update the fading mean square of an axis (B,) by one more change (3,)."""
    keep = float(np.exp(-gap_s / CHANGES_S))
    square[bar] += (1 - keep) * (float(change @ change) / 3 - square[bar])


def _mean(new: Array, old: Array, gap_s: float, missed_s: float) -> Array:
    """Mean since the last sample, where for a part of that time one is missing: the mean of its neighbours then."""
    return new + missed_s / (2 * gap_s) * (old - new) if missed_s else new


def _over_rest(new: Array, used: Array, gap_s: float, left_s: float, longest_s: float) -> Array:
    """Mean over what is left of a sample's interval, such that the integral since the last sample is the new one."""
    if not 0 < gap_s <= longest_s or not left_s > 0:
        return new
    return np.asarray((new * gap_s - used) / left_s)
