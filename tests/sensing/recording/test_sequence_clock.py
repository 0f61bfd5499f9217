"""Sampling times of a force sensor from what it counts: packets that wait, drift, given rates."""

import numpy as np
import pytest

from sensing.recording.ft_streams import NetFt
from sensing.recording.sequence_clock import RateError, SequenceClock


def arrivals(rate_hz, seconds=20.0, packets_hz=500.0, late_s=0.004, drift=0.0, seed=1):
    """(counts, sampling times, arrivals) of a sensor whose packets wait for a random while on their way."""
    rng = np.random.default_rng(seed)
    taken = 1000.0 + np.arange(int(seconds * packets_hz)) / packets_hz
    counts = np.rint((taken - taken[0]) * rate_hz * (1 + drift)).astype(int)
    return counts, taken, taken + rng.exponential(late_s, len(taken))


@pytest.mark.parametrize("rate_hz", [7000.0, 1000.0, 500.0])
@pytest.mark.parametrize("given", [False, True], ids=["found_out", "given"])
def test_sampling_times_follow_what_the_sensor_counts(rate_hz, given):
    counts, taken, came = arrivals(rate_hz)
    clock = SequenceClock(rate_hz if given else None)
    wrapped = (counts + 4294960000) % 2**32
    times = np.array([clock.stamp(int(c), t) for c, t in zip(wrapped, came, strict=True)])
    off = times - taken
    assert np.abs(off[1000:]).max() < 1e-3 and np.abs(off).max() < 0.05  # 7000 Hz for a sensor of 500: 18 s
    assert np.std(off[1000:]) < 0.05 * np.std(came - taken)
    assert clock.rate_hz == pytest.approx(rate_hz, rel=1e-3)


@pytest.mark.parametrize("stands_at", [0, 7, 90_000])
def test_of_a_unit_whose_sequence_stands_still_the_packets_are_counted(stands_at):
    """At 90,000 none of the first three minutes counted: samples were stamped as they came, 30 ms late."""
    counts, taken, came = arrivals(500.0)
    stream = NetFt("127.0.0.1", delay_s=0.0)
    off = np.array([stream._stamped(int(c) + 1, stands_at, t) for c, t in zip(counts, came, strict=True)]) - taken
    assert np.abs(off[1000:]).max() < 1e-3 and np.abs(off).max() < 0.05


def test_a_clock_that_drifts_is_followed_and_one_that_begins_anew_too():
    counts, taken, came = arrivals(1000.0, seconds=400.0, packets_hz=50.0, drift=1e-4)
    counts[10000:] = counts[10000:] - counts[10000] + 10_000_000  # switched off and on: seen by the step
    clock = SequenceClock()
    off = np.array([clock.stamp(int(c), t) for c, t in zip(counts, came, strict=True)]) - taken
    assert np.abs(off[100:10000]).max() < 2e-3 and np.abs(off[10100:]).max() < 2e-3


def test_a_clock_whose_rate_changes_is_followed():
    """As it warms up: one line through ten minutes was off by 0.12 s at their end."""
    counts, taken, came = arrivals(1000.0, seconds=600.0, packets_hz=50.0)
    for drift in (2e-4, -2e-4):
        late, clock = counts + np.rint(drift * np.minimum(counts, 600_000 - counts)).astype(int), SequenceClock()
        off = np.array([clock.stamp(int(c), t) for c, t in zip(late, came, strict=True)]) - taken
        assert np.abs(off[100:15000]).max() < 2e-3 and np.abs(off[25000:]).max() < 2e-3


@pytest.mark.parametrize("given_hz", [985.0, 1001.0, 1015.0])
def test_a_rate_that_is_a_little_off_is_replaced_by_the_sensors_own(given_hz):
    """At 1001 instead of 1000 Hz samples were dated 0.1 s early after 100 s, at 1015 Hz by 1.5 s, without a word."""
    counts, taken, came = arrivals(1000.0, seconds=150.0, packets_hz=50.0)
    clock = SequenceClock(given_hz)
    off = np.array([clock.stamp(int(c), t) for c, t in zip(counts, came, strict=True)]) - taken
    assert np.abs(off[200:]).max() < 2e-3 and np.abs(off).max() < 0.05


@pytest.mark.parametrize("given_hz", [970.0, 1030.0, 7000.0])
def test_a_rate_that_is_not_the_sensors_is_refused(given_hz):
    counts, _, came = arrivals(1000.0, seconds=4.0)
    clock = SequenceClock(given_hz)
    with pytest.raises(RateError, match=f"counts 1000 times a second, not {given_hz:g}: leave --ft-rate out"):
        for c, t in zip(counts, came, strict=True):
            clock.stamp(int(c), t)
