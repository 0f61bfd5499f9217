import io
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, WEIGHTS_BYTES, endless, film, frames, pipeline, stand_in, wait_for
from mcap.writer import Writer

from cad.errors import FileError
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed, Pace
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.outputs.mcap.topics import TOPICS
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.messages import TRANSFORMS
from sensing.live.playback import Playback
from sensing.live.recorded_feed import replay_endcaps
from sensing.live.replay import read_config, recorded_frames, recorded_wrenches, verify
from sensing.live.run import LiveRun
from sensing.sources.newest import SourceError

ENDCAPS = ("endcap_0", "endcap_1")


@pytest.fixture(scope="module")
def press() -> list[bytes]:
    return film([0] * 3 + [0.3, 0.7, 1.0, 1.0, 0.7, 0.3] + [0] * 3)


def config() -> LiveConfig:
    return LiveConfig(tuple(EndcapConfig(name, "test", contact_on_n=2.0, contact_off_n=1.0) for name in ENDCAPS))


def a_run(press: list[bytes]) -> LiveRun:
    endcaps = [LiveEndcap(CameraFeed(endless(press, 40), 4), pipeline(name, k)) for k, name in enumerate(ENDCAPS)]
    return LiveRun(config(), endcaps)


@pytest.fixture(scope="module")
def recorded(press, tmp_path_factory) -> Path:
    """A recording that begins in the middle of a run and is zeroed anew on the way."""
    path = tmp_path_factory.mktemp("mcap") / "run.mcap"
    run = a_run(press)
    recording = Recording(run, path.parent)
    with run.engine:
        wait_for(lambda: len(run.latest.all()) == 2)
        recording.start(path)
        wait_for(lambda: recording._recorder.frames > 30)
        epoch = run.engine.endcaps[1].pipeline.epoch
        run.engine.endcaps[1].pipeline.request_zero(confirmed=True)
        wait_for(lambda: recording._recorder._begun[ENDCAPS[1]] > epoch and recording._recorder.frames > 70)
        recording.stop()
    assert "frames recorded" in recording.note and "lost" not in recording.note
    return path


def test_a_recording_computed_again_gives_the_same_bits(recorded):
    found = read_config(recorded)
    assert [endcap.name for endcap in found.endcaps] == list(ENDCAPS) and found.endcaps[0].contact_on_n == 2.0
    check = verify(recorded, found, lambda _: stand_in())
    assert check.frames > 70 and check.different == 0 and check.end is None
    zeros = [sum(r.zero is not None for r in recorded_frames(recorded, endcap)) for endcap in ENDCAPS]
    assert zeros == [1, 2]


def test_frames_from_before_the_restart_are_left_out(press, tmp_path):
    recorder = Recorder(tmp_path / "x.mcap", config(), {"endcap_0": 1}, lambda _: None)
    recorder.start()
    pipe = pipeline()
    pipe.epoch = 0  # its first reference makes it 1
    given = frames(press)
    for frame in given[:6]:
        recorder.put(pipe.update(frame))
    pipe.request_restart()
    for frame in given[6:]:
        recorder.put(pipe.update(frame))
    recorder.close(PATIENCE_S)
    found = list(recorded_frames(recorder.path, "endcap_0"))
    assert [r.frame.sequence for r in found] == list(range(6, len(given)))
    assert [r.zero is not None for r in found] == [True] + [False] * (len(given) - 7)


def test_the_check_sees_a_bit_that_differs(recorded, monkeypatch):
    reported = recorded_wrenches(recorded, ENDCAPS[0])
    reported[7] = np.nextafter(reported[7], 9)
    monkeypatch.setattr(
        "sensing.live.replay.recorded_wrenches", lambda path, endcap, _: reported if endcap == ENDCAPS[0] else []
    )
    assert verify(recorded, read_config(recorded), lambda _: stand_in()).different == 1


def test_replay_through_the_engine_gives_the_recorded_wrenches(recorded):
    found, got = read_config(recorded), {endcap: [] for endcap in ENDCAPS}

    class Sink:
        def put(self, reading):
            got[reading.endcap].append(np.concatenate([reading.wrench.force_n, reading.wrench.torque_nm]))

    endcaps = replay_endcaps(recorded, found, Playback(recorded, 0), lambda _: stand_in())
    with Engine(endcaps, [Sink()]) as engine:
        assert engine.wait(PATIENCE_S)
    for endcap in ENDCAPS:
        assert np.array_equal(got[endcap], recorded_wrenches(recorded, endcap))


def test_diagnostics_are_recorded_while_no_frame_comes(tmp_path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    def absent():
        raise SourceError("/dev/video9: no such camera")

    one = LiveConfig((EndcapConfig("endcap_0", "test"),))
    run = LiveRun(one, [LiveEndcap(CameraFeed(absent), pipeline())])
    recording, path = Recording(run, tmp_path), tmp_path / "none.mcap"
    with run.engine:
        recording.start(path)
        wait_for(lambda: path.read_bytes().count(b"no such camera") > 1)
        recording.stop()
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [m.status[0] for *_, m in reader.iter_decoded_messages(["/diagnostics"])]
    assert [status.message for status in found[1:]] == ["unplugged: /dev/video9: no such camera"] * (len(found) - 1)
    level = found[-1].level
    assert (level[0] if isinstance(level, bytes) else level) == 2


def test_an_independent_reader_opens_the_recording(recorded):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with recorded.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        topics = {channel.topic: summary.schemas[channel.schema_id].name for channel in summary.channels.values()}
        assert topics == {f"/{endcap}/{t}": kind for endcap in ENDCAPS for t, kind in TOPICS.items()} | {
            "/diagnostics": ros.DIAGNOSTICS,
            "/notes": ros.STRING,
            "/tf_static": TRANSFORMS,
        }
        seen = {}
        for _, channel, message, decoded in reader.iter_decoded_messages():
            seen.setdefault(channel.topic, []).append((message, decoded))
    reported = recorded_wrenches(recorded, ENDCAPS[0])
    forces = [d.wrench.force.x for _, d in seen["/endcap_0/wrench/wrench_pred"]]
    assert forces == [w[0] for w in reported]
    message, image = seen["/endcap_0/image/compressed"][0]
    assert image.format == "jpeg" and bytes(image.data[:2]) == b"\xff\xd8"
    stamp_s = image.header.stamp.sec + image.header.stamp.nanosec / 1e9
    assert abs(stamp_s - time.time()) < 600 and stamp_s == pytest.approx(message.log_time / 1e9)
    wholes = [d for _, d in seen["/endcap_0/wrench/with_covariance"]]
    assert [d.wrench.force.x for d in wholes] == forces
    whole = [d for d in wholes if d.state == "running"][-1]  # a computer that drops frames sees steps: degraded
    assert whole.valid
    spread = np.array(whole.covariance).reshape(6, 6)
    assert np.array_equal(spread, spread.T) and (np.linalg.eigvalsh(spread) > 0).all()
    placed = {each.child_frame_id: each.header.frame_id for each in seen["/tf_static"][-1][1].transforms}
    assert placed == {f"{endcap}_camera": endcap for endcap in ENDCAPS}  # of image and reference; no robot is stated
    assert image.header.frame_id in placed
    field = seen["/endcap_0/array/shear_vector"][0][1]
    assert [d.size for d in field.layout.dim] == [2, 16, 16] and len(field.data) == 512
    status = seen["/diagnostics"][-1][1].status
    assert {s.name for s in status} == set(ENDCAPS)


def test_a_recording_never_replaces_a_file(tmp_path, press):
    path = tmp_path / "there.mcap"
    path.write_bytes(b"mine")
    with pytest.raises(FileError, match="is there already"):
        Recording(a_run(press), tmp_path).start(path)
    assert path.read_bytes() == b"mine"


@pytest.mark.parametrize("part", ["index", "head"])
def test_a_recording_that_cannot_begin_leaves_no_file(part, tmp_path, press, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    where = tempfile if part == "index" else Writer
    monkeypatch.setattr(where, "TemporaryFile" if part == "index" else "add_metadata", full)
    recording = Recording(a_run(press), tmp_path)
    assert "No space left on device: choose another place" in recording.switch(True)
    assert not recording.on and not list(tmp_path.iterdir())


class FullDisk(io.BytesIO):
    """A disk with room for so many bytes."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room = room

    def write(self, data):
        if self.tell() + len(data) > self.room:
            raise OSError(28, "No space left on device")
        return super().write(data)

    def close(self):
        self.kept = self.getvalue()


def test_a_full_disk_ends_the_recording_not_the_run(press, tmp_path):
    disk = FullDisk(WEIGHTS_BYTES + 1_200_000)
    run = a_run(press)
    recorder = Recorder(tmp_path / "x.mcap", config(), dict.fromkeys(ENDCAPS, 0), lambda _: None, stream=disk)
    recorder.start()
    run.engine.add_sink(recorder)
    with run.engine:
        wait_for(lambda: recorder.failed)
        count = run.engine.endcaps[0].stats.frames
        wait_for(lambda: run.engine.endcaps[0].stats.frames > count + 10)
    assert "No space left" in recorder.note and "are kept" in recorder.note
    wait_for(lambda: hasattr(disk, "kept"))
    path = tmp_path / "kept.mcap"
    path.write_bytes(disk.kept)
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames == recorder.kept > 0 and check.different == 0
    assert re.search(r"cut at byte \d+", str(check.end))


KILLED = """
import sys
import tempfile
from live_stand_in import endless, film, pipeline
from pathlib import Path
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.outputs.ros.messages import TRANSFORMS
from sensing.live.run import LiveRun
endcaps = [LiveEndcap(CameraFeed(endless(film([0, 0.5, 1.0]))), pipeline())]
run = LiveRun(LiveConfig((EndcapConfig("endcap_0", "test"),)), endcaps)
recording = Recording(run, Path.cwd())
with run.engine:
    recording.start(Path(sys.argv[1]))
    while True:
        print(recording._recorder.frames, flush=True)
        __import__("time").sleep(0.05)
"""


def test_a_killed_run_leaves_a_file_that_replays(tmp_path):
    path = tmp_path / "killed.mcap"
    root = Path(__file__).resolve().parents[3]
    environment = {**os.environ, "PYTHONPATH": f"{root / 'tests'}{os.pathsep}{root}"}
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, env=environment)
    while int(process.stdout.readline()) < 40:
        pass
    process.send_signal(signal.SIGKILL)
    process.wait()
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames > 10 and check.different == 0 and "cut at byte" in str(check.end)


@pytest.mark.parametrize("content", [b"", b"no mcap at all", b"\x89MCAP0\r\n" + b"\xff" * 40])
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"x\.mcap"):
        read_config(path)


def test_raw_pictures_are_recorded_without_loss(press, tmp_path):
    import cv2

    raw = [cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR) for jpeg in press[:5]]
    given = [
        type(f)(f.time_s, f.sequence, f.source, image=image) for f, image in zip(frames(press[:5]), raw, strict=True)
    ]
    endcap = LiveEndcap(FileFeed(lambda: given, Pace(0)), pipeline())
    run = LiveRun(LiveConfig((EndcapConfig("endcap_0", "test"),)), [endcap])
    recording = Recording(run, tmp_path)
    recording.start(tmp_path / "raw.mcap")
    with run.engine:
        assert run.engine.wait(PATIENCE_S)
    recording.stop()
    again = [r.frame for r in recorded_frames(tmp_path / "raw.mcap", "endcap_0")]
    assert all(np.array_equal(a.image, b.image) and a.time_s == b.time_s for a, b in zip(again, given, strict=True))
