"""References in the running pipeline: refused under load, confirmed, undone, and pressed from the very start."""

import itertools
import re
import threading
import time

import cv2
import numpy as np
import pytest
from live_stand_in import SHAPE, LinearModel, film, frames, pipeline, wait_for

from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.core.reading import EndcapReading
from sensing.live.core.reference import PressedError, ReferenceTaker, misplaced_px
from sensing.records import Frame
from sensing.sources.newest import SourceError

SIZE = (640, 480)


@pytest.fixture(scope="module")
def press() -> list[bytes]:
    return film([0] * 12 + [0.3, 0.7, 1.0, 1.0, 0.7, 0.3] + [0] * 6)


def zeroed(press: list[bytes]):
    pipe, clock = pipeline(zero_frames=10), itertools.count()

    def feed(jpeg: bytes, count: int = 1) -> EndcapReading | None:
        for _ in range(count):
            number = next(clock)
            picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1)
            picture[-4:, : 1 + number % 600] ^= 8
            reading = pipe.update(
                Frame(100 + number / 30, number, "test", jpeg=cv2.imencode(".jpg", picture)[1].tobytes(), size=SIZE)
            )
        return reading

    feed(press[0], 10)
    wait_for(lambda: pipe.taker._made is not None)
    return pipe, feed


def settle(pipe, feed, jpeg: bytes) -> EndcapReading:
    """Frames until a reference that was asked for is made or refused."""
    feed(jpeg, 10)
    wait_for(lambda: pipe.taker._made is not None)
    return feed(jpeg)


def test_zero_under_load_is_refused_until_confirmed_and_can_be_undone(press):
    pipe, feed = zeroed(press)
    pressed = feed(press[14], 3)
    first, force_n = pipe.zero, np.linalg.norm(pressed.wrench.force_n)
    assert force_n > 5 and pressed.contact.touching
    assert "touched" in pipe.request_zero() and pipe.confirmable and "touched" in pipe.note
    assert np.linalg.norm(feed(press[14], 12).wrench.force_n) == pytest.approx(force_n, rel=0.05)
    assert pipe.zero is first
    assert pipe.request_zero(confirmed=True) == ""
    taken = settle(pipe, feed, press[14])
    assert pipe.zero is not first and np.linalg.norm(taken.wrench.force_n) < 0.2 and pipe.zero.date
    assert np.linalg.norm(feed(press[0], 4).wrench.force_n) > 4  # what the user would have had unasked
    assert pipe.request_undo() == ""
    assert np.linalg.norm(feed(press[0], 4).wrench.force_n) < 0.2 and pipe.zero.digest == first.digest
    assert "no earlier" in pipe.request_undo()


def test_a_reference_that_is_being_taken_is_undone_before_an_earlier_one(press):
    pipe, feed = zeroed(press)
    feed(press[0], 3)
    pipe.request_zero()
    settle(pipe, feed, press[0])
    second = pipe.zero
    pipe.request_zero()
    feed(press[0], 4)
    assert pipe.request_undo() == "" and pipe.undoable
    feed(press[0], 12)
    pipe.close()
    feed(press[0])
    assert pipe.zero is second and pipe.undoable


def test_an_undone_reference_needs_not_be_set_up_again_and_gives_the_bits_of_a_new_one(press, monkeypatch):
    """That took 1.6 s in the loop, in which no endcap gave a reading."""
    pipe, feed = zeroed(press)
    feed(press[14], 3)
    first = pipe.zero
    pipe.request_zero(confirmed=True)
    settle(pipe, feed, press[14])
    monkeypatch.setattr(pipe, "_build", lambda _: pytest.fail("set up again"))
    pipe.request_undo()
    undone = feed(press[15], 2)
    other = pipeline(zero_frames=10)
    other.set_zero(first)
    before = Frame(undone.frame.time_s - 1 / 30, 0, "test", jpeg=press[15], size=SIZE)
    pipe.restart(), pipe.update(before), other.update(before)
    one, two = pipe.update(undone.frame), other.update(undone.frame)
    assert pipe.zero is first and np.linalg.norm(one.wrench.force_n) > 3
    assert np.array_equal(one.wrench.force_n, two.wrench.force_n)
    assert np.array_equal(one.wrench.covariance, two.wrench.covariance)


@pytest.mark.long
def test_a_press_that_begins_after_the_button_is_found_in_the_new_reference(press):
    pipe, feed = zeroed(press)
    feed(press[0], 3)
    first = pipe.zero
    assert pipe.request_zero() == ""
    settle(pipe, feed, press[13])
    assert pipe.zero is first and re.search(r"press of \d", pipe.note) and pipe.confirmable
    assert pipe.request_zero(confirmed=True) == ""
    settle(pipe, feed, press[13])
    assert pipe.zero is not first


def test_a_new_reference_of_the_untouched_endcap_is_taken(press):
    pipe, feed = zeroed(press)
    feed(press[0], 3)
    first = pipe.zero
    assert pipe.request_zero() == ""
    settle(pipe, feed, press[0])
    assert pipe.zero is not first and pipe.undoable and not pipe.confirmable


@pytest.mark.long
def test_pressed_at_the_very_start_is_seen_against_the_design():
    """On the simulator's pictures: a camera of the design, 41 N on the endcap when the run begins."""
    from sensing.live.demo.scene import scene_film
    from sensing.tracking.zero import single_zero

    robot, params = scene_film(), EndcapConfig("a", "0").params
    loads = [np.linalg.norm(robot.truth(0, tick)[:3]) for tick in range(robot.ticks)]
    free, heavy = robot.jpeg(0, int(np.argmin(loads))), robot.jpeg(0, int(np.argmin(np.abs(np.array(loads) - 41))))
    away = [misplaced_px(single_zero(Frame(0.0, 0, "a", jpeg=j, size=SIZE)), params) for j in (free, heavy)]
    assert away[0] < 2.6 and away[1] > 4.0
    taker = ReferenceTaker("a", params, 3, stand_in_build, LinearModel(), 1.0)
    for jpeg, refused in ((heavy, True), (free, False)):
        taker.ask()
        for k in range(3):
            taker.offer(Frame(k / 30, k, "a", jpeg=jpeg, size=SIZE), None)
        wait_for(lambda: taker._made is not None)
        if refused:
            with pytest.raises(PressedError, match="pressed"):
                taker.take()
        else:
            assert taker.take() is not None


def stand_in_build(zero):
    from sensing.tracking.model_input import model_input

    return model_input(zero.frame(), SHAPE, EndcapConfig("a", "0").params)


def test_a_zero_asked_for_while_the_camera_is_gone_is_refused_and_not_taken_once_it_is_back(press):
    """It waited, for minutes: whatever the endcap carried when the camera came back became the reference."""
    plugged = threading.Event()
    plugged.set()

    def source():
        for count in itertools.count():
            if not plugged.is_set():
                raise SourceError("test: no such camera")
            time.sleep(1 / 60)
            yield frames(press[count % 12 : count % 12 + 1], time.monotonic())[0]

    endcap = LiveEndcap(CameraFeed(source), pipeline(zero_frames=10))
    with Engine([endcap]):
        wait_for(lambda: endcap.stats.frames > 3)
        zero = endcap.pipeline.zero
        plugged.clear()
        wait_for(lambda: endcap.health.status == "unplugged")
        assert endcap.pipeline.request_zero() == ""  # as just before it went
        wait_for(lambda: not endcap.pipeline.taker.collecting)
        assert "not zeroed: no frame comes" in endcap.health.message
        assert "no frame comes" in endcap.zero() and not endcap.pipeline.taker.collecting
        plugged.set()
        last = endcap.stats.frames
        wait_for(lambda: endcap.stats.frames > last + 12)
        assert endcap.pipeline.zero is zero and not endcap.pipeline.taker.computing
