"""A blind, pressed or damaged sensor says so: every state and fault, through the pipeline and the running loop."""

import io
import itertools
import json
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
import pytest
from live_stand_in import PATIENCE_S, endless, film, frames, pipeline, stand_in, wait_for

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed, Pace
from sensing.live.core.gate import DISTURBED, UNCONFIRMED
from sensing.live.core.reading import plain
from sensing.live.core.state import LEVEL, TRANSITIONS, VALID, Event, Machine, State, next_state
from sensing.live.outputs.diagnosis import diagnosis
from sensing.live.outputs.json_lines import JsonLines
from sensing.live.outputs.terminal import endcap_line
from sensing.live.replay import verify
from sensing.live.run import LiveRun
from sensing.records import Frame
from sensing.sources.newest import Health, Status

ROOT = Path(__file__).resolve().parents[3]
SIZE = (640, 480)
CONFIG = LiveConfig((EndcapConfig("endcap_0", "test"),))


@pytest.fixture(scope="module")
def press() -> list[bytes]:
    return film([0] * 12 + [0.3, 0.7, 1.0, 1.0, 0.7, 0.3] + [0] * 6)


def encoded(picture: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", picture)[1].tobytes()


def black(seed: int) -> bytes:
    return encoded(np.random.default_rng(seed).integers(0, 4, (480, 640, 3), np.uint8))


def noise(seed: int) -> bytes:
    return encoded(np.random.default_rng(seed).integers(0, 256, (480, 640, 3), np.uint8))


def broken(jpeg: bytes) -> bytes:
    return jpeg[: len(jpeg) // 2] + jpeg[len(jpeg) // 2 + 900 :]  # a lost USB packet


# --- the machine -----------------------------------------------------------------------------------------------
def test_every_state_knows_every_event_and_only_the_end_is_for_ever():
    assert set(TRANSITIONS) == set(State) and all(set(row) == set(Event) for row in TRANSITIONS.values())
    sticky = {s for s in State if {next_state(s, e) for e in Event} == {s}}
    assert sticky == {State.ENDED}
    for state in set(State) - {State.ENDED}:  # nothing else is: one good frame is enough
        assert next_state(state, Event.GOOD) is State.RUNNING and next_state(state, Event.FLAGGED) is State.DEGRADED


@pytest.mark.parametrize(
    ("event", "state"),
    [
        (Event.UNSEEN, State.BLIND), (Event.RESIZED, State.WRONG_SIZE), (Event.REPEATED, State.FROZEN),
        (Event.ERROR, State.FAILED), (Event.SILENCE, State.SILENT), (Event.LOST, State.UNPLUGGED),
        (Event.REFUSED, State.WAITING), (Event.ENDED, State.ENDED),
    ],
)  # fmt: skip
def test_a_fault_shows_at_once_from_any_running_state(event, state):
    for before in (
        State.STARTING,
        State.RUNNING,
        State.DEGRADED,
        State.BLIND,
        State.DAMAGED,
        State.FROZEN,
        State.SILENT,
    ):
        assert next_state(before, event) is state


@pytest.mark.parametrize(
    ("before", "event", "after"),
    [
        (State.RUNNING, Event.UNDECODED, State.DEGRADED),  # one damaged picture
        (State.DEGRADED, Event.UNDECODED, State.DAMAGED),  # and another
        (State.STARTING, Event.UNDECODED, State.DAMAGED),
        (State.STARTING, Event.COLLECTED, State.ZEROING),
        (State.WAITING, Event.COLLECTED, State.WAITING),  # the reason stays in sight
        (State.UNPLUGGED, Event.SILENCE, State.UNPLUGGED),
        (State.UNPLUGGED, Event.COLLECTED, State.ZEROING),
        (State.FAILED, Event.ENDED, State.FAILED),
    ],
)
def test_transitions_that_depend_on_the_state(before, event, after):
    assert next_state(before, event) is after


def test_every_event_and_every_status_of_a_source_is_reported_somewhere():
    live = "".join(path.read_text() for path in (ROOT / "sensing" / "live").rglob("*.py") if path.name != "state.py")
    assert {event for event in Event if f"Event.{event.name}" not in live} == set()
    sources = live + (ROOT / "sensing" / "sources" / "newest.py").read_text()
    assert set(get_args(Status)) == {Health().status} | set(re.findall(r'status="([a-z]+)"', sources))


def test_levels_are_those_of_diagnostics():
    assert [s for s in State if LEVEL.get(s, 2) == 0] == [State.RUNNING]
    for state in set(State) - VALID - {State.STARTING, State.ZEROING}:
        assert LEVEL.get(state, 2) == 2


def test_the_docs_draw_the_machine():
    drawn = (ROOT / "docs" / "live.md").read_text()
    diagram = re.search(r"```mermaid\n(.*?)```", drawn, re.S)[1]
    for state in State:
        assert state.name.lower() in diagram, state
    for event in Event:
        assert event.value in diagram, event


def test_the_reason_goes_with_the_state_and_never_outlives_it():
    machine = Machine()
    assert machine.happened(Event.REFUSED, "0 dots found").message == "0 dots found"
    assert machine.happened(Event.COLLECTED, "leave it untouched").message == "0 dots found"
    good = machine.happened(Event.GOOD, "")
    assert good.message == "" and good.valid


# --- pictures that show nothing --------------------------------------------------------------------------------
@pytest.mark.parametrize("method", ["dots", "gelslim"])
@pytest.mark.parametrize("picture", [black, noise])
def test_a_blind_camera_gives_no_number_anywhere(press, picture, method):
    from sensing.live.core.pipeline import EndcapPipeline

    pipe = EndcapPipeline(EndcapConfig("endcap_0", "test"), stand_in(method), None, 0, 1)
    given = frames(press[:12] + [picture(k) for k in range(5)] + press[12:16])
    found = [pipe.update(frame) for frame in given]
    for reading in found[12:17]:
        assert reading.event is Event.UNSEEN and not reading.valid and "lamp" in reading.reason
        shown = plain(reading)
        assert shown["force_n"] == [None] * 3 and shown["force_norm_n"] is None and shown["contact"] is None
        assert shown["valid"] is False and shown["state"] == "blind" and "blind" in shown["flags"]
    assert found[11].valid and found[18].valid and found[18].contact.touching  # and the press behind it is seen


def test_a_black_camera_is_an_error_for_json_terminal_and_diagnostics(press):
    stream, got = io.StringIO(), []
    endcap = LiveEndcap(FileFeed(lambda: frames(press[:3] + [black(k) for k in range(4)]), Pace(0)), pipeline())

    class Keep:
        def put(self, reading):
            got.append((reading, endcap.machine.condition))

    lines = JsonLines(stream)
    lines.start()
    with Engine([endcap], [lines, Keep()]) as engine:
        assert engine.wait(PATIENCE_S)
    lines.close(PATIENCE_S)
    last = json.loads(stream.getvalue().splitlines()[6])
    assert last["force_n"] == [None] * 3 and last["state"] == "blind" and last["valid"] is False
    reading, condition = got[-1]
    health = endcap.stats.health(endcap.feed.health, condition, endcap.pipeline.faults)
    _name, level, message, values = diagnosis(health)
    assert level == 2 and message.startswith("blind: ") and values["valid"] == "false"
    assert " F    -  blind" in endcap_line(health, reading) and "0.0 N" not in endcap_line(health, reading)


def test_without_dots_from_the_start_the_reason_is_given_and_stays():
    endcap = LiveEndcap(CameraFeed(endless([black(k) for k in range(20)])), pipeline(zero_frames=10))
    with Engine([endcap]):
        wait_for(lambda: endcap.health.status == "waiting for a reference")
        seen = endcap.frame.sequence
        while endcap.frame.sequence < seen + 30:  # three more attempts
            health = endcap.health
            assert health.level == 2 and ("dots" in health.message or health.status == "silent"), health
            time.sleep(0.002)
        assert endcap.health.frames == 0


# --- damaged pictures ------------------------------------------------------------------------------------------
def test_a_picture_that_the_decoder_complains_of_is_unusable_counted_and_quiet(press, capfd):
    pipe = pipeline()
    found = [pipe.update(f) for f in frames([*press[:6], broken(press[6]), *press[7:12]])]
    assert found[6].event is Event.UNDECODED and np.isnan(found[6].wrench.force_n).all() and pipe.faults == 1
    assert plain(found[6])["flags"] == ["damaged"]
    assert all(r.valid for r in found[:6] + found[7:])
    assert capfd.readouterr() == ("", "")


def test_a_single_picture_with_a_false_step_is_held_back_and_a_press_is_not_delayed(press):
    half = cv2.imdecode(np.frombuffer(press[0], np.uint8), 1)
    half[:, 330:] = np.roll(half[:, 330:], 16, axis=0)  # blocks that slid: the decoder has nothing to complain of
    pipe = pipeline()
    found = [pipe.update(f) for f in frames([*press[:8], encoded(half), *press[9:18]])]
    wrong = found[8]
    assert np.linalg.norm(wrong.estimate.force_n) > 1.0  # what it would have been
    assert np.linalg.norm(wrong.wrench.force_n) < 0.1 and not wrong.contact.touching
    assert {UNCONFIRMED, DISTURBED} <= wrong.wrench.flags and wrong.event is Event.FLAGGED
    assert all(r.event is Event.GOOD and np.linalg.norm(r.wrench.force_n) < 0.1 for r in found[9:12])
    assert found[12].contact.touching and found[12].event is Event.GOOD  # the first frame of the press


def test_a_step_that_lasts_is_confirmed_by_the_next_frame(press):
    half = cv2.imdecode(np.frombuffer(press[0], np.uint8), 1)
    half[:, 330:], jpegs = np.roll(half[:, 330:], 16, axis=0), []
    for k in range(3):
        half[-4:, : k + 1] ^= 8
        jpegs.append(encoded(half))
    pipe = pipeline()
    found = [pipe.update(f) for f in frames(press[:8] + jpegs)]
    assert UNCONFIRMED in found[8].wrench.flags and UNCONFIRMED not in found[9].wrench.flags
    assert np.linalg.norm(found[10].wrench.force_n) > 1.0 and DISTURBED in found[10].wrench.flags


def test_a_tear_that_leaves_every_dot_whole_is_flagged_for_as_long_as_it_lasts(press):
    torn = cv2.imdecode(np.frombuffer(press[0], np.uint8), 1)
    pipe = pipeline()
    good = [pipe.update(f) for f in frames(press[:8])]
    rows = np.sort(good[-1].tracks.reference_px[:, 1])[20:-20]
    row = round(rows[np.argmax(np.diff(rows)) :][:2].mean())  # no dot is cut there
    torn[row:] = np.roll(torn[row:], 2, axis=1)
    jpegs = []
    for k in range(4):
        torn[-4:, : k + 1] ^= 8
        jpegs.append(encoded(torn))
    found = [pipe.update(f) for f in frames([*jpegs, *press[8:18]], good[-1].frame.time_s + 1 / 30)]
    for reading in found[:4]:
        assert DISTURBED in reading.wrench.flags and "torn at row" in reading.reason
        assert np.linalg.norm(reading.estimate.force_n) > 0.5 > 5 * np.linalg.norm(reading.wrench.force_n)
    assert all(r.event is Event.GOOD for r in found[4:])  # nor is any press
    first = pipe.update(frames(jpegs[:1], 900.0)[0])  # after a gap nothing stands in for it
    assert first.event is Event.UNSEEN and "torn at row" in first.reason


def test_png_and_cut_pictures_are_named_and_no_camera_hangs(press):
    png = cv2.imencode(".png", np.zeros((480, 640, 3), np.uint8))[1].tobytes()
    for bad, word in ((png, "PNG"), (press[0][:9000], "damaged"), (b"<html>", "no picture")):
        pictures = itertools.chain(frames(press[:2]), (Frame(200 + k / 30, 9 + k, "test", jpeg=bad) for k in range(4)))
        endcap = LiveEndcap(FileFeed(lambda pictures=pictures: pictures, Pace(0)), pipeline())
        states = []
        endcap.feed.start(lambda: None)
        while not endcap.feed.ended:
            item = endcap.feed.take()
            if item is not None:
                endcap.process(item)
                states.append(endcap.machine.condition)
        assert states[-1].state is State.DAMAGED and word in states[-1].reason and "hangs" not in states[-1].reason


def test_the_same_picture_for_a_second_is_a_camera_that_hangs(press):
    pipe = pipeline()
    found = [pipe.update(f) for f in frames(press[:3] + [press[3]] * 45 + press[4:6])]
    assert [r.event for r in found[3:33]] == [Event.GOOD] * 30
    assert found[40].event is Event.REPEATED and not found[40].valid and "hangs" in found[40].reason
    assert found[-1].event is Event.GOOD


def test_another_size_is_a_state_that_ends_with_it(press):
    pipe, machine, states = pipeline(), Machine(), []
    small = encoded(cv2.resize(cv2.imdecode(np.frombuffer(press[0], np.uint8), 1), (320, 240)))
    given = frames(press[:6])
    given[3:5] = [replace(frame, jpeg=small, size=(320, 240)) for frame in given[3:5]]
    for frame in given:
        pipe.update(frame)
        states.append(machine.happened(*pipe.outcome))
    assert [s.state for s in states[1:]] == [State.RUNNING] * 2 + [State.WRONG_SIZE] * 2 + [State.RUNNING]
    assert states[-1].message == ""


def test_a_recording_of_faults_replays_to_the_bit(press, tmp_path):
    from sensing.live.outputs.mcap.recorder import Recorder

    pipe = pipeline()
    faults = [broken(press[1]), black(1), noise(2), press[0][:9000]]
    jpegs = press[:5] + faults[:2] + press[5:14] + faults[2:] + press[14:20]
    pipe.update(frames(press[:1], 90.0)[0])
    recorder = Recorder(tmp_path / "a.mcap", CONFIG, {"endcap_0": pipe.epoch}, lambda name: None)
    recorder.start()
    pipe.request_restart()
    for frame in frames(jpegs):
        recorder.put(pipe.update(frame))
    recorder.close(PATIENCE_S)
    checked = verify(tmp_path / "a.mcap", CONFIG, models=lambda endcap: stand_in())
    frames_checked, different = (checked.frames, checked.different) if hasattr(checked, "frames") else checked[:2]
    assert frames_checked == len(jpegs) and different == 0


def test_the_run_answers_for_each_endcap(press):
    run = LiveRun(CONFIG, [LiveEndcap(CameraFeed(endless(press[:12])), pipeline())])
    with run.engine:
        wait_for(lambda: run.engine.health()[0].status == "running")
        health = run.engine.health()[0]
        assert health.valid and health.level == 0 and health.zeroed and not health.undoable
