"""A recording that is paused, sent to a moment and played over and over; no test asks how soon."""

import time

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, film, frames, pipeline, stand_in, wait_for

from sensing.live.cli import main
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.playback import AtEnd, Playback
from sensing.live.recorded_feed import replay_endcaps
from sensing.live.replay import read_config, recorded_frames, recorded_wrenches, verify
from sensing.live.timeline import Timeline
from sensing.tracking.zero import single_zero

COUNT, RATE_HZ, ZEROED = 45, 30.0, 30  # frames, of which this one has a reference of its own
NAMES = ("endcap_0", "endcap_1")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A second and a half of two endcaps; the second takes another reference after one second."""
    path = tmp_path_factory.mktemp("playback") / "run.mcap"
    pushes = film([0, *np.abs(np.sin(np.arange(COUNT - 1) / 9))])
    given, restarts = frames(pushes, time.monotonic(), RATE_HZ), [pipeline(name, k) for k, name in enumerate(NAMES)]
    config = LiveConfig(tuple(EndcapConfig(name, "test") for name in NAMES))
    recorder = Recorder(path, config, dict.fromkeys(NAMES, -1), lambda _: None)
    recorder.start()
    for frame in given:
        if frame.sequence == ZEROED:
            restarts[1].set_zero(single_zero(frame, "endcap_1"))
        for each in restarts:
            recorder.put(each.update(frame))
        wait_for(lambda: len(recorder._queue) < 100)
    recorder.close(PATIENCE_S)
    assert recorder.dropped == 0 and recorder.frames == 2 * COUNT
    return path


class Seen:
    """What the engine gave: (number of the frame, wrench) of each endcap."""

    def __init__(self) -> None:
        self.got = {name: [] for name in NAMES}

    def put(self, reading) -> None:
        wrench = np.r_[reading.wrench.force_n, reading.wrench.torque_nm]
        self.got[reading.endcap].append((reading.frame.sequence, wrench))

    def numbers(self, name: str = "endcap_0") -> list[int]:
        return [number for number, _ in self.got[name]]


def played(path, **options):
    playback, seen = Playback(path, **options), Seen()
    endcaps = replay_endcaps(path, read_config(path), playback, lambda _: stand_in())
    return playback, seen, Engine(endcaps, [seen])


def test_over_and_over_gives_the_recorded_bits_each_time(recording):
    playback, seen, engine = played(recording, speed=0, at_end=AtEnd.LOOP)
    with engine:
        wait_for(lambda: min(map(len, seen.got.values())) >= 2 * COUNT)
        playback.loop(False)
    for name in NAMES:
        again = np.array([wrench for _, wrench in seen.got[name][: 2 * COUNT]])
        assert np.array_equal(again, 2 * recorded_wrenches(recording, name))


def test_sent_to_a_moment_it_starts_anew_a_second_before_and_shows_one_picture_while_paused(recording):
    playback, seen, engine = played(recording, speed=0, paused=True, at_end=AtEnd.STAY)
    with engine:
        wait_for(lambda: all(seen.numbers(name) == [0] for name in NAMES))
        playback.seek(1.19)
        run_up = list(range(round(0.2 * RATE_HZ), round(1.2 * RATE_HZ) + 1))
        wait_for(lambda: all(len(seen.numbers(name)) == 1 + len(run_up) for name in NAMES))
        state = playback.state()
        assert state["paused"] and state["position_s"] == 1.19 and not state["whole"]
        playback.pause(False)
        wait_for(lambda: playback.paused)  # behind the last picture it waits
        expected = [0, *run_up, *range(run_up[-1] + 1, COUNT)]
        wait_for(lambda: all(seen.numbers(name) == expected for name in NAMES))
        assert not engine.wait(0) and playback.state()["position_s"] == pytest.approx(1.47, abs=0.02)
        zeros = [endcap.pipeline.zero.digest for endcap in engine.endcaps]
        kept = [[r.zero.digest for r in recorded_frames(recording, n) if r.zero] for n in NAMES]
        assert zeros == [found[-1] for found in kept] and [len(found) for found in kept] == [1, 2]
        playback.pause(False)  # from the begin, with the reference of the begin
        wait_for(lambda: seen.numbers("endcap_1").count(0) == 2)
        wait_for(lambda: playback.paused and seen.numbers("endcap_1")[-1] == COUNT - 1)
    whole = [wrench for _, wrench in seen.got["endcap_1"][-COUNT:]]
    assert np.array_equal(whole, recorded_wrenches(recording, "endcap_1"))


@pytest.mark.long
def test_what_a_moment_gives_is_compared_with_the_recording(recording):
    models = lambda _: stand_in()  # noqa: E731
    check = verify(recording, read_config(recording), models, from_s=1.19)
    assert check.frames == 2 * (COUNT - round(1.2 * RATE_HZ)) and check.end is None
    assert 0 < check.largest_n < 0.05  # the filter's memory of what was before
    assert verify(recording, read_config(recording), models).largest_n == 0


def test_a_moment_is_found_by_the_heads_of_the_records_also_in_a_cut_file(recording, tmp_path):
    timeline = Timeline(recording)
    assert timeline.span_s >= (COUNT - 1) / RATE_HZ - 1e-3
    assert [timeline.start("endcap_1", s).byte for s in (0.0, -1.0)] == [0, 0]
    late = timeline.start("endcap_1", 1.39)
    first = next(iter(recorded_frames(recording, "endcap_1", late)))
    assert first.frame.sequence == round(1.4 * RATE_HZ) and first.zero is not None and late.byte > 100_000
    cut = tmp_path / "cut.mcap"
    content = recording.read_bytes()
    cut.write_bytes(content[: len(content) * 3 // 4])
    assert Timeline(cut).span_s > 0.1
    playback, seen, engine = played(cut, speed=0, at_end=AtEnd.STAY)
    with engine:
        wait_for(lambda: playback.paused)
        count = len(seen.numbers())
        playback.seek(0.1)
        wait_for(lambda: len(seen.numbers()) > count and not engine.wait(0))


@pytest.mark.long
def test_all_feeds_end_when_the_run_does_whatever_they_wait_for(recording):
    for options in ({"paused": True}, {"at_end": AtEnd.STAY, "speed": 0}, {"speed": 0.01}):
        _, seen, engine = played(recording, **options)
        with engine:
            wait_for(lambda seen=seen: seen.numbers())
        assert not any(endcap.feed._thread.is_alive() for endcap in engine.endcaps)


def test_a_moment_outside_is_one_line(recording, capsys):
    assert main(["--replay", str(recording), "--no-page", "--from", "3600"]) == 2
    assert "s long: give a moment in it" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--from", "1"], ["--at-end", "loop"], ["--paused"]])
def test_options_of_a_replay_without_one_are_refused(capsys, words):
    assert main([*words, "--no-page"]) == 2
    assert f"{words[0]} has no effect with the simulated robot" in capsys.readouterr().err
