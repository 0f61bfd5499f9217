import io
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from live_stand_in import PATIENCE_S, LinearModel, endless, film, frames, pipeline, stand_in, wait_for

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed, Pace
from sensing.live.core.model import live_model, load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.robot import robot_state
from sensing.live.core.state import Condition, Event
from sensing.live.core.stats import STAGES, WINDOW, EndcapStats
from sensing.live.outputs.json_lines import JsonLines
from sensing.live.outputs.terminal import robot_line
from sensing.live.web.state import detail
from sensing.records import Frame, ShearField, Wrench
from sensing.sources.newest import Health, SourceError
from sensing.wrench.contact import ContactState


@pytest.fixture(scope="module")
def press() -> list[bytes]:
    return film([0] * 12 + [0.3, 0.7, 1.0, 1.0, 0.7, 0.3] + [0] * 4)


def readings(pipe: EndcapPipeline, given: list[Frame]) -> list:
    return [pipe.update(frame) for frame in given]


# --- model -----------------------------------------------------------------------------------------------------
def test_the_threshold_lies_above_what_the_model_answers_at_rest():
    class Biased(LinearModel):
        def estimate(self, field: ShearField) -> Wrench:
            return Wrench(field.time_s, np.array([0.0, 0.0, -1.85]), np.zeros(3), "sphere")

    model = live_model("biased", Biased())
    assert model.rest_n == pytest.approx(1.85)
    assert model.threshold().off_n > 1.85 and model.threshold(0.9, 0.4).on_n == 0.9


def test_the_papers_model_asks_for_its_checkpoint():
    with pytest.raises(FileError, match="--weights"):
        load_model("paper", EndcapParams(130, 8))
    with pytest.raises(ParameterError, match="choose"):
        load_model("best", EndcapParams(130, 8))


# --- pipeline --------------------------------------------------------------------------------------------------
def test_a_press_becomes_a_wrench_and_a_contact_with_capture_times(press):
    given = frames(press)
    found = [r for r in readings(pipeline(), given) if r is not None]
    assert [r.frame.time_s for r in found] == [f.time_s for f in given]
    assert all(r.wrench.time_s == r.frame.time_s for r in found)
    touching = [r.contact.touching for r in found]
    assert touching == [False] * 12 + [True] * 6 + [False] * 4
    assert found[14].contact.since_s == given[12].time_s
    peak = found[15]
    assert peak.wrench.frame == "endcap" and peak.estimate.force_n[0] > 5
    lever_m = np.array([0, 0, EndcapParams(130, 8).centre_height_mm]) / 1000
    torque = 0.01 * peak.estimate.force_n + np.cross(lever_m, peak.estimate.force_n)
    assert peak.estimate.torque_nm == pytest.approx(torque, abs=1e-9)  # about the origin, not the sphere's centre
    assert set(peak.stage_ms) >= {"decode", "track", "field", "wrench", "filter", "contact"}
    assert found[0].drift.cause == "none"


def test_after_a_restart_the_same_frames_give_the_same_bits(press):
    given, pipe = frames(press), pipeline()
    first = [r.wrench.force_n for r in readings(pipe, given)]
    pipe.restart()
    again = [r.wrench.force_n for r in readings(pipe, given)]
    assert np.array_equal(first, again)
    on = [r.wrench.force_n for r in readings(pipe, [replace(f, time_s=f.time_s + 1) for f in given])]
    assert not np.array_equal(first[0], on[0])  # without one the filter and the tracker remember


def test_zeroing_waits_for_rest_and_keeps_the_old_reference_when_touched(press):
    pipe = pipeline(zero_frames=10)
    rest = frames(press[:12] * 4)
    assert pipe.update(rest[0]) is None and pipe.outcome == (Event.COLLECTED, "leave it untouched")
    assert [pipe.update(f) for f in rest[1:10]] == [None] * 9
    wait_for(lambda: pipe.taker._made is not None)
    first = pipe.update(rest[10])
    assert first is not None and first.zero.frames == 10
    pipe.request_zero()
    moving = film([0, 0.5, 1.0, 0.5] * 3)
    for k, jpeg in enumerate(moving[:10]):
        pipe.update(Frame(200 + k / 30, k, "test", jpeg=jpeg, size=(640, 480)))
    wait_for(lambda: pipe.taker._made is not None)
    later = pipe.update(Frame(201, 12, "test", jpeg=press[0], size=(640, 480)))
    assert later.zero is first.zero and "not zeroed" in pipe.note


@pytest.mark.parametrize(("jump_s", "words"), [(-3600.0, "set back by 3600.0 s"), (7200.0, "no frame for 7200 s")])
def test_a_clock_that_jumps_starts_the_filter_anew_and_says_so(press, jump_s, words):
    pipe, given = pipeline(), frames(press)
    before = readings(pipe, given[:15])[-1]
    after = pipe.update(replace(given[15], time_s=given[15].time_s + jump_s))
    assert words in pipe.note and after.epoch == before.epoch + 1
    assert after.contact.touching and np.isfinite(after.wrench.force_n).all()


def test_a_late_frame_is_passed_over(press):
    pipe, given = pipeline(), frames(press)
    readings(pipe, given[:5])
    assert pipe.update(given[3]) is None and "late" in pipe.note and pipe.outcome is None
    assert pipe.update(given[5]).event is Event.GOOD


@pytest.mark.parametrize("method", ["dots", "gelslim"])
def test_a_size_change_and_a_corrupt_picture_are_reported_and_survived(press, method):
    import cv2

    pipe = EndcapPipeline(EndcapConfig("endcap_0", "test"), stand_in(method), None, 0, 1)
    given = frames(press)
    readings(pipe, given[:3])
    small = cv2.imencode(".jpg", np.full((240, 320, 3), 90, np.uint8))[1].tobytes()
    other = pipe.update(replace(given[3], jpeg=small, size=(320, 240)))
    assert other.event is Event.RESIZED and "320x240" in other.reason and "640x480" in other.reason
    damaged = pipe.update(replace(given[4], jpeg=b"\xff\xd8 no picture"))
    assert damaged.event is Event.UNDECODED and "damaged" in damaged.reason and pipe.faults == 2
    for reading in (other, damaged):
        assert not reading.valid and np.isnan(reading.wrench.force_n).all() and not reading.contact.known
    good = pipe.update(given[5])
    assert good.valid and good.reason == "" and np.isfinite(good.wrench.force_n).all()


# --- figures ---------------------------------------------------------------------------------------------------
def test_the_figures_are_those_of_the_last_readings(monkeypatch):
    now_s = 5000.0
    monkeypatch.setattr("sensing.live.core.stats.time", SimpleNamespace(monotonic=lambda: now_s))
    rng, stats, made = np.random.default_rng(0), EndcapStats("endcap_0"), []
    for number in range(WINDOW + 37):
        ready_s = now_s - 0.01 * (WINDOW + 37 - number)
        stages = {"decode": rng.uniform(), "track": rng.uniform()} | ({"drift": 5.0} if number % 30 == 0 else {})
        made.append(SimpleNamespace(latency_ms=rng.uniform(1, 9), ready_s=ready_s, stage_ms=stages, dots=(1, 2)))
        made[-1].captured_s, made[-1].drift = ready_s, None
        stats.add(made[-1])
    reported = stats.health(Health(), Condition(), 0, fresh=True)
    latency = [reading.latency_ms for reading in made[-WINDOW:]]
    assert reported.frames == WINDOW + 37 and reported.p50_ms == pytest.approx(np.median(latency))
    assert reported.p99_ms == sorted(latency)[round(0.99 * WINDOW)]
    assert reported.rate_hz == pytest.approx(100, abs=0.6)  # of the last two seconds, 10 ms apart
    last = made[-STAGES:]
    assert reported.stage_ms["decode"] == pytest.approx(np.median([r.stage_ms["decode"] for r in last]))
    assert reported.stage_ms["drift"] == 5.0


# --- engine ----------------------------------------------------------------------------------------------------
def test_files_are_played_in_step_and_none_of_their_frames_is_lost(press):
    given, got = frames(press), []

    class Slow:
        def put(self, reading):
            got.append((reading.endcap, reading.frame.sequence))
            time.sleep(0.002)

    pace = Pace(0)
    endcaps = [LiveEndcap(FileFeed(lambda: given, pace), pipeline(f"endcap_{k}", k)) for k in range(2)]
    with Engine(endcaps, [Slow()]) as engine:
        assert engine.wait(PATIENCE_S)
    for k in range(2):
        assert [n for endcap, n in got if endcap == f"endcap_{k}"] == list(range(len(given)))
    assert all(h.status == "ended" and h.frames == len(given) for h in engine.health())


def test_a_recording_is_played_at_its_own_pace():
    given = [Frame(50 + k / 20, k, "test", jpeg=b"x") for k in range(8)]
    feed = FileFeed(lambda: given)
    begin, taken = time.monotonic(), []
    feed.start(lambda: None)
    while not feed.ended:
        item = feed.take()
        if item is None:
            time.sleep(0.001)
        else:
            taken.append((item[1], time.monotonic()))
    due = np.diff([due for due, _ in taken])
    assert due == pytest.approx(0.05, abs=1e-6) and taken[0][0] >= begin
    assert all(at >= due for due, at in taken)


def test_a_camera_that_is_pulled_comes_back_and_the_others_go_on(press):
    rest, opened, seen = press[:12], [], threading.Event()

    def plugged():
        opened.append(1)
        if len(opened) == 2:
            seen.wait(PATIENCE_S)
            raise SourceError("/dev/video9: no such camera")
        for count, frame in enumerate(endless(rest)()):
            if len(opened) == 1 and count == 40:
                raise SourceError("/dev/video9: no more frames: is it unplugged?")
            yield frame

    endcaps = [
        LiveEndcap(CameraFeed(plugged), pipeline("endcap_0", 0)),
        LiveEndcap(CameraFeed(endless(rest)), pipeline("endcap_1", 1)),
    ]
    with Engine(endcaps) as engine:
        wait_for(lambda: "is it unplugged" in engine.health()[0].message)
        seen.set()
        wait_for(lambda: len(opened) >= 3)
        count = endcaps[1].stats.frames
        frames_before = endcaps[0].stats.frames
        wait_for(lambda: endcaps[0].stats.frames > frames_before + 5 and endcaps[1].stats.frames > count + 5)
        assert engine.health()[0].reopened == 1  # attempts do not count
        assert endcaps[1].health.faults == 0


def test_a_frozen_camera_is_reported_by_name_and_clock(press):
    endcap = LiveEndcap(CameraFeed(endless(press[:1], 120)), pipeline())
    with Engine([endcap]) as engine:
        wait_for(lambda: engine.health()[0].status == "frozen")
        assert "same picture" in engine.health()[0].message


def test_a_bug_in_one_endcap_leaves_the_others_alone(press):
    bad, good = pipeline("endcap_0", 0), pipeline("endcap_1", 1)

    def broken(*_):
        raise ZeroDivisionError("planted")

    bad.model.estimator.estimate = broken
    endcaps = [LiveEndcap(FileFeed(lambda: frames(press), Pace(0)), p) for p in (bad, good)]
    with Engine(endcaps) as engine:
        assert engine.wait(PATIENCE_S)
    reported = engine.health()
    assert reported[0].frames == 0 and reported[0].faults == len(press) and "planted" in reported[0].message
    assert reported[1].frames == len(press)


def test_a_slow_output_never_slows_the_loop(press):
    class Stuck(JsonLines):
        def write(self, reading):
            release.wait(PATIENCE_S)

    release, endcap = threading.Event(), LiveEndcap(CameraFeed(endless(press[:12], 200)), pipeline())
    stuck = Stuck(io.StringIO())
    stuck._queue = type(stuck._queue)(maxlen=5)
    stuck.start()
    with Engine([endcap], [stuck]):
        wait_for(lambda: stuck.dropped > 20)
    release.set()
    stuck.close(PATIENCE_S)


# --- robot -----------------------------------------------------------------------------------------------------
def test_three_endcaps_carry_the_weight_in_the_robots_frame(press):
    reading = readings(pipeline(), frames(press[:1]))[0]
    rng, endcaps, held = np.random.default_rng(0), [], {}
    for k in range(4):
        axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        axes *= np.sign(np.linalg.det(axes))
        pose = np.eye(4)
        pose[:3, :3] = axes
        endcaps.append(EndcapConfig(f"endcap_{k}", "0", T_robot_endcap=pose))
        force = axes.T @ np.array([0, 0, 40.0]) if k < 3 else np.zeros(3)
        wrench = Wrench(9.0, force, np.zeros(3), "endcap")
        contact = ContactState(9.0, k < 3, 8.0 + k / 10, float(np.linalg.norm(force)), True)
        held[f"endcap_{k}"] = replace(reading, wrench=wrench, contact=contact, captured_s=9.0)
    state = robot_state(endcaps, held, 120.0, 9.1)
    assert state.touching == ("endcap_0", "endcap_1", "endcap_2") and state.consistent
    assert state.force_n == pytest.approx([0, 0, 120])
    assert robot_state(endcaps, held, 200.0, 9.1).consistent is False
    assert robot_state(endcaps, held, 155.0, 9.1).consistent and not robot_state(endcaps, held, 165.0, 9.1).consistent
    assert robot_state(endcaps, {n: held[n] for n in state.touching}, 120.0, 9.1).consistent is None  # the fourth, too?
    assert robot_state(endcaps, held, 120.0, 30.0).touching == ()  # old readings say nothing
    assert "consistent" in robot_line(state)
    unstated = [replace(endcap, T_robot_endcap=np.eye(4)) for endcap in endcaps]  # as setup writes them
    unknown = robot_state(unstated, held, 120.0, 9.1)
    assert unknown.consistent is None and "force sum unknown" in robot_line(unknown)
    assert "force sum" not in robot_line(robot_state(unstated, held, 0.0, 9.1))
    assert robot_state(unstated[:1], held, 0.0, 9.1).force_n == pytest.approx(held["endcap_0"].wrench.force_n)


def test_a_source_that_does_not_say_the_size_of_its_pictures_is_read_all_the_same(press):
    pipe, given = pipeline(), [replace(frame, size=None) for frame in frames(press)]
    reading = [pipe.update(frame) for frame in given][-1]
    assert reading.valid and reading.frame.size == (640, 480) and detail(reading, 0)["size"] == [640, 480]
    other = cv2.imencode(".jpg", np.zeros((240, 320, 3), np.uint8))[1].tobytes()
    wrong = pipe.update(Frame(101.0, 90, "test", jpeg=other))
    assert wrong.event is Event.RESIZED and "320x240" in wrong.reason


def test_the_page_shows_a_picture_of_which_not_even_the_size_can_be_read(press):
    pipe = pipeline()
    pipe.update(frames(press)[0])
    reading = pipe.update(Frame(101.0, 90, "test", jpeg=b"<html>no picture"))
    assert reading.event is Event.UNDECODED and detail(reading, 3)["size"] == [640, 480]
