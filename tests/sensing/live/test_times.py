"""Times in the live loop: when a recorded frame is due, and what is expected of a wrench later."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import endless, film, frames, pipeline, stand_in, wait_for

from cad.errors import ParameterError
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed, Pace
from sensing.live.core.measurement import Measurement
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import predicted
from sensing.live.core.state import MEASURED, VALID, Event, State, next_state
from sensing.live.endcap import Endcap
from sensing.records import Wrench
from sensing.sources.newest import SourceError
from sensing.wrench.filter import WrenchFilter


def test_a_recording_at_another_pace_is_due_so_much_sooner():
    pace = Pace(4.0)
    first, later = pace.due_s(50.0), pace.due_s(52.0)
    assert later - first == pytest.approx(0.5)
    assert Pace(0).due_s(1e6) <= time.monotonic()


def test_a_trend_counts_up_to_the_longest_delay_that_was_compared_and_widens_the_interval():
    trend = np.outer([1, 1, 1, 2], [3.0, -2.0, 1.0, 0.1, 0.2, 0.3])
    reading = SimpleNamespace(
        captured_s=5.0, trend=trend, wrench=Wrench(4.0, np.ones(3), np.zeros(3), "endcap", np.eye(6))
    )
    near, far, farther = (predicted(reading, 5.0 + delay_s) for delay_s in (0.04, 0.15, 2.0))
    assert near.force_n == pytest.approx(1 + 0.04 * trend[1, :3]) and far.force_n == pytest.approx(
        1 + 0.15 * trend[3, :3]
    )
    assert (farther.force_n == far.force_n).all() and (farther.torque_nm == far.torque_nm).all()
    assert near.covariance.diagonal() == pytest.approx(1 + (0.04 * trend[1]) ** 2)


def test_a_camera_that_was_pulled_leaves_no_wrench_of_this_moment():
    def pulled():
        for count, frame in enumerate(endless(film([0] * 6))()):
            if count == 30:
                raise SourceError("/dev/video9: no more frames: is it unplugged?")
            yield frame

    with Endcap(LiveEndcap(CameraFeed(pulled), pipeline())) as endcap:
        wait_for(lambda: endcap.valid)
        assert np.isfinite(endcap.now().force_n).all()
        wait_for(lambda: endcap.health.status == "unplugged")
        wrench = endcap.now()
    assert np.isnan([*wrench.force_n, *wrench.torque_nm, *wrench.covariance.ravel()]).all()
    assert "unplugged" in wrench.flags and endcap.touching is None


def test_an_endcap_outside_of_its_with_block_says_so():
    endcap = Endcap(LiveEndcap(CameraFeed(endless(film([0] * 6))), pipeline()))
    with pytest.raises(ParameterError, match=r"endcap_0 does not run: use it as `with"):
        next(endcap.stream())
    with endcap:
        assert next(endcap.stream()).frame == "endcap"
    with pytest.raises(ParameterError, match="endcap_0 has run already: open it again"), endcap:
        pass


def test_after_a_gap_no_force_is_expected():
    smooth = WrenchFilter()
    expected = lambda time_s: Measurement._predicted_n(SimpleNamespace(_filter=smooth), time_s)  # noqa: E731
    assert expected(0.0) is None
    smooth.update(Wrench(0.0, np.full(3, 7.0), np.zeros(3), "sphere", np.eye(6)))
    assert expected(0.4) == pytest.approx(np.full(3, 7.0)) and expected(0.6) is None


def test_a_place_of_contact_is_one_only_while_it_touches():
    """Above a newton a wrench has a place; under the threshold of its contact nothing is touched."""
    given = frames(film([0, 0, 1.0, 1.0]))
    for on_n, is_known in ((0.2, True), (80.0, False)):
        pipe = EndcapPipeline(EndcapConfig("a", "test", contact_on_n=on_n, contact_off_n=0.1), stand_in(), None, 0, 1)
        last = [reading for reading in map(pipe.update, given) if reading is not None][-1]
        assert np.linalg.norm(last.wrench.force_n) > 1.5 and last.contact.touching is is_known
        assert last.place.known is is_known


def test_numbers_count_after_a_measured_frame_and_no_other():
    """From a state in which they do not, and after the end of a file the last ones still do."""
    for event in Event:
        after = next_state(State.BLIND, event)
        assert (after in VALID) is (event in MEASURED or event is Event.ENDED), event
