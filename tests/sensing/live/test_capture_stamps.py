"""Stamps of a recording are the wall time of the capture, at whatever pace its pictures are read."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, film, frames, pipeline, stand_in
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import FileFeed, Pace
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.outputs.mcap.stamps import CaptureStamps, RecordedClock
from sensing.live.playback import Playback
from sensing.live.recorded_feed import replay_endcaps
from sensing.live.replay import read_config
from sensing.live.run import LiveRun
from sensing.live.timeline import Timeline
from sensing.records import Frame

NAMES, COUNT, STEP_NS = ("endcap_0", "endcap_1"), 8, 1e9 / 30
EARLIER_S = 5000.0  # between the recording and its replay


def shown(time_s: float, read_s: float, endcap: str = NAMES[0]) -> SimpleNamespace:
    return SimpleNamespace(frame=Frame(time_s, 0, endcap, jpeg=b"x"), captured_s=read_s, endcap=endcap)


def messages(path):
    """(topic, stamp of the file, message) of a recording, by another reader."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [(channel.topic, m.log_time, decoded) for _, channel, m, decoded in reader.iter_decoded_messages()]


def played(run: LiveRun, path) -> None:
    recording = Recording(run, path.parent)
    recording.start(path)
    recording.add_note("copied")
    with run.engine:
        assert run.engine.wait(PATIENCE_S)
    recording.stop()
    assert "lost" not in recording.note


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("stamps") / "run.mcap"
    config = LiveConfig(tuple(EndcapConfig(name, "test") for name in NAMES))
    recorder = Recorder(path, config, dict.fromkeys(NAMES, -1), lambda _: None)
    recorder.start()
    pipes = [pipeline(name, k) for k, name in enumerate(NAMES)]
    for frame in frames(film([0, 0, 0.5, 1.0, 1.0, 0.5, 0, 0]), time.monotonic() - EARLIER_S):
        for pipe in pipes:
            recorder.put(pipe.update(frame))
    recorder.close(PATIENCE_S)
    assert recorder.frames == 2 * COUNT
    return path


def test_a_recording_of_a_replay_at_full_speed_has_the_stamps_of_the_first_one(recorded, tmp_path):
    playback, config = Playback(recorded, 0), read_config(recorded)
    copy = tmp_path / "copy.mcap"
    played(LiveRun(config, replay_endcaps(recorded, config, playback, lambda _: stand_in()), playback=playback), copy)
    for name in NAMES:
        one, two = (
            [(log, m.header.stamp.sec, m.header.stamp.nanosec) for topic, log, m in messages(path) if topic == wrench]
            for path in (recorded, copy)
            for wrench in [f"/{name}/wrench/wrench_pred"]
        )
        assert one == two and len(one) == COUNT
    assert any(topic == "/notes" for topic, *_ in messages(copy))
    assert Timeline(copy).span_s < EARLIER_S / 10  # nothing in it is stamped with the time of the replay


def test_pictures_of_a_file_read_at_once_are_stamped_at_the_files_own_pace(tmp_path):
    given = frames(film([0, 0, 0.5, 1.0]), 0.0)
    endcap = LiveEndcap(FileFeed(lambda: given, Pace(0)), pipeline())
    path = tmp_path / "video.mcap"
    played(LiveRun(LiveConfig((EndcapConfig(NAMES[0], "test"),)), [endcap]), path)
    stamps = [log for topic, log, _ in messages(path) if topic == "/endcap_0/wrench/wrench_pred"]
    assert np.diff(stamps) == pytest.approx([STEP_NS] * 3, abs=2)
    assert abs(stamps[0] / 1e9 - time.time()) < 600


def test_pictures_say_the_cameras_frame_and_wrenches_the_endcaps(recorded):
    said = {topic: m.header.frame_id for topic, _, m in messages(recorded) if hasattr(m, "header")}
    assert said["/endcap_1/image/compressed"] == said["/endcap_1/zero"] == "endcap_1_camera"
    assert said["/endcap_1/wrench/wrench_pred"] == "endcap_1"


def test_a_camera_is_stamped_by_this_runs_clock_and_so_is_what_belongs_to_no_picture():
    stamps, now_s = CaptureStamps(), time.monotonic()
    assert stamps.of(shown(now_s, now_s)) == stamps._wall_ns + int(now_s * 1e9)
    assert stamps.now_ns() >= stamps.of(shown(now_s, now_s))


def test_a_file_played_again_goes_on_after_its_end_and_its_endcaps_stay_together():
    stamps = CaptureStamps(RecordedClock(begin_ns=900, wall_less_capture_ns=1000))
    assert stamps.now_ns() == 900
    assert [stamps.of(shown(t, 50 + t / 9, name)) for t in (1.0, 2.0) for name in NAMES] == [
        1_000_001_000, 1_000_001_000, 2_000_001_000, 2_000_001_000,
    ]  # fmt: skip
    again = stamps.of(shown(1.0, 50.5, NAMES[1]))
    assert again == stamps.now_ns() == 2_000_001_000 + int((50.5 - (50 + 2 / 9)) * 1e9)
    assert stamps.of(shown(2.5, 50.6, NAMES[0])) == 2_500_001_000  # it still ends its first pass
    assert stamps.of(shown(1.0, 50.7, NAMES[0])) == again
