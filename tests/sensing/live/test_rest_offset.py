"""What an untouched endcap reads is an error: it stands in the covariance, under the next touch, too."""

import numpy as np
import pytest
from turned_endcap import RATE_HZ, Turned

from sensing.live.core.kept import Kept, kept_of
from sensing.live.core.rest_offset import RestOffset
from sensing.records import Wrench

SD_N = 0.01
OFFSET = np.array([0.1, 0.0, -0.2, 0.0, 0.003, 0.0])


def given(offset: RestOffset, values: np.ndarray, begin_s: float, touching: bool = False) -> float:
    """Readings at the rate of a camera; returns the time of the next."""
    for k, value in enumerate(values):
        offset.update(Wrench(begin_s + k / RATE_HZ, value[:3], value[3:], "sphere"), touching)
    return begin_s + len(values) / RATE_HZ


def stated(offset: RestOffset) -> np.ndarray:
    """Standard deviations of a wrench whose own are :data:`SD_N`."""
    wrench = Wrench(0.0, np.zeros(3), np.zeros(3), "sphere", SD_N**2 * np.eye(6))
    return np.sqrt(np.diagonal(offset.widened(wrench).covariance))


def test_what_lasts_without_a_touch_is_in_the_standard_deviations_and_stays_under_a_touch():
    offset, rng = RestOffset(), np.random.default_rng(0)
    noisy = OFFSET + rng.normal(0, SD_N, (75, 6)) * [1, 1, 1, 0.01, 0.01, 0.01]
    then_s = given(offset, noisy, 5.0)
    assert stated(offset)[:3] == pytest.approx(np.hypot(SD_N, np.abs(OFFSET[:3])), abs=0.005)
    assert offset.widened(Wrench(0.0, *np.zeros((2, 3)), "sphere", np.zeros((6, 6)))).covariance == pytest.approx(
        np.outer(offset.state, offset.state)
    )  # one error: its axes go together
    before = stated(offset)
    then_s = given(offset, 50 * OFFSET[None].repeat(90, 0), then_s, touching=True)
    assert np.array_equal(stated(offset), before)
    given(offset, np.zeros((75, 6)), then_s)  # it was zeroed by itself: the lamp is back
    assert stated(offset) == pytest.approx(SD_N)


def test_a_touch_that_begins_slowly_and_a_pause_leave_no_offset():
    offset = RestOffset()
    then_s = given(offset, np.zeros((65, 6)), 5.0)
    ramp = np.linspace(0, 1, 45)[:, None] * OFFSET  # under the threshold for more than a second
    then_s = given(offset, ramp, then_s)
    given(offset, 5 * OFFSET[None], then_s, touching=True)
    assert stated(offset) == pytest.approx(SD_N)
    for k in range(10):  # a camera that gives a frame in two seconds, of which each could be a touch
        given(offset, OFFSET[None], 50.0 + 2 * k)
    assert stated(offset) == pytest.approx(SD_N)


def test_live_states_it_keeps_it_over_a_restart():
    turned = Turned()
    drift = 0.03 * turned.touch  # well under the threshold of contact
    clear = turned.give(0 * drift, 70)[-1]
    last = turned.give(drift, 100)[-1]
    off_n, own_sd = last.wrench.force_n, np.sqrt(np.diagonal(clear.wrench.covariance)[:3])
    assert not last.contact.touching and np.abs(off_n).max() > 1.5 * own_sd.max()
    sd = np.sqrt(np.diagonal(last.wrench.covariance)[:3])
    assert sd == pytest.approx(np.hypot(own_sd, off_n), rel=0.03)
    assert np.array_equal(last.estimate.covariance, clear.estimate.covariance)  # of the picture alone
    pressed = turned.give(drift + turned.touch, 10)[-1]
    assert pressed.contact.touching and pressed.before.offset == last.before.offset
    turned.pipe.request_restart()
    again = turned.give(drift + turned.touch, 1)[0]
    assert again.epoch > pressed.epoch and again.before.offset == last.before.offset


def test_a_camera_that_has_moved_reads_a_touch_whose_force_is_in_the_standard_deviations():
    turned = Turned()
    shift = np.tile((1.0, 0.3), (len(turned.places), 1))
    last = turned.give(shift, 100)[-1]
    assert last.contact.touching and "moved" in last.wrench.flags
    sd = np.sqrt(np.diagonal(last.wrench.covariance)[:3])
    assert (np.abs(last.wrench.force_n) < 1.05 * sd).all()


def test_it_is_read_as_it_was_written_and_other_text_is_refused():
    kept = Kept(offset=tuple(OFFSET.tolist()))
    assert kept_of(kept.text()) == kept
    for wrong in ("[1]", "[1, 2, 3, 4, 5, NaN]", '"abcdef"', "3"):
        with pytest.raises((ValueError, TypeError)):
            kept_of(f'{{"own_weight_g": [0, 0, 0], "moved": "", "offset": {wrong}}}')
