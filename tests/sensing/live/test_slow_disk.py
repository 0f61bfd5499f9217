"""A disk that is too slow: what is queued is written, every other frame is counted, and the file replays to the bit."""

import io
import threading
import time

import pytest
from live_stand_in import PATIENCE_S, endless, film, frames, pipeline, stand_in, wait_for

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.replay import read_config, recorded_frames, verify
from sensing.live.run import LiveRun

ENDCAPS = ("endcap_0", "endcap_1")
ROOM = 6


@pytest.fixture(scope="module")
def press() -> list[bytes]:
    return film([0] * 3 + [0.3, 0.7, 1.0, 1.0, 0.7, 0.3] + [0] * 3)


def config(*names: str) -> LiveConfig:
    return LiveConfig(tuple(EndcapConfig(name, "test", contact_on_n=2.0, contact_off_n=1.0) for name in names))


class Held(io.FileIO):
    """A disk that answers only while it may."""

    def __init__(self, path) -> None:
        super().__init__(path, "wb")
        self.answers, self.asked = threading.Event(), threading.Event()
        self.answers.set()

    def write(self, data):
        self.asked.set()
        assert self.answers.wait(PATIENCE_S)
        return super().write(data)


def test_what_is_queued_is_written_and_every_other_frame_is_counted(press, tmp_path, monkeypatch):
    monkeypatch.setattr("sensing.live.outputs.mcap.recorder.ROOM", ROOM)
    monkeypatch.setattr("sensing.live.outputs.mcap.recorder.FLUSH_S", 0.0)  # the disk is asked with every frame
    monkeypatch.setattr("sensing.live.outputs.mcap.recorder.DIAGNOSTICS_S", PATIENCE_S)  # and with nothing else
    path, pipe, restarts = tmp_path / "held.mcap", pipeline(), []
    disk, given = Held(path), iter(frames(press * 3))

    def restart(name):
        restarts.append(name)
        pipe.request_restart()

    def put(count):
        for _ in range(count):
            recorder.put(pipe.update(next(given)))

    recorder = Recorder(path, config("endcap_0"), {"endcap_0": 0}, restart, stream=disk)
    recorder.start()
    disk.asked.clear()
    disk.answers.clear()
    put(1)
    assert disk.asked.wait(PATIENCE_S)  # the first one is being written
    put(ROOM + 5)
    assert recorder.dropped == 5 and restarts == []  # no new beginning while there is no room for it
    disk.answers.set()
    wait_for(lambda: recorder.frames == 1 + ROOM)
    put(4)  # the first of them has the endcap begin anew
    recorder.close(PATIENCE_S)
    assert restarts == ["endcap_0"] and (recorder.frames, recorder.dropped) == (1 + ROOM + 3, 6)
    assert "10 frames recorded, 6 lost to a slow disk" in recorder.note
    found = list(recorded_frames(path, "endcap_0"))
    assert [each.frame.sequence for each in found] == [*range(1 + ROOM), *range(ROOM + 7, ROOM + 10)]
    assert [k for k, each in enumerate(found) if each.zero is not None] == [0, 1 + ROOM]
    check = verify(path, read_config(path), lambda _: stand_in())
    assert (check.frames, check.different, check.end) == (10, 0, None)


def test_a_reference_taken_while_the_disk_is_behind_is_recorded_from_its_first_frame(press, tmp_path, monkeypatch):
    monkeypatch.setattr("sensing.live.outputs.mcap.recorder.ROOM", ROOM)
    pipe, restarts, given = pipeline(), [], iter(frames(press * 2))
    recorder = Recorder(tmp_path / "x.mcap", config("endcap_0"), {"endcap_0": 0}, restarts.append)
    for _ in range(ROOM + 1):  # its thread has not begun: the last one is lost
        recorder.put(pipe.update(next(given)))
    recorder._queue.popleft()
    recorder.put(pipe.update(next(given)))  # there is room, but it follows a gap
    pipe.restart()
    recorder.put(reading := pipe.update(next(given)))
    assert recorder._queue[-1] is reading and recorder.dropped == 2 and restarts == []
    recorder._stream.close()


@pytest.mark.long
def test_a_slow_disk_drops_frames_and_what_is_kept_still_replays(press, tmp_path):
    class Slow(io.FileIO):
        pause_s = 0.1

        def write(self, data):
            time.sleep(self.pause_s)
            return super().write(data)

    endcaps = [LiveEndcap(CameraFeed(endless(press, 40), 4), pipeline(name, k)) for k, name in enumerate(ENDCAPS)]
    run, path = LiveRun(config(*ENDCAPS), endcaps), tmp_path / "slow.mcap"
    stream = Slow(path, "wb")
    pipelines = {endcap.name: endcap.pipeline for endcap in run.engine.endcaps}
    recorder = Recorder(
        path, config(*ENDCAPS), dict.fromkeys(ENDCAPS, 0), lambda name: pipelines[name].request_restart(), stream=stream
    )
    recorder._queue = type(recorder._queue)(maxlen=ROOM)
    recorder.start()
    put, given = recorder.put, []
    recorder.put = lambda reading: (given.append(reading.epoch), put(reading))
    run.engine.add_sink(recorder)
    with run.engine:
        wait_for(lambda: recorder.frames > 2 and recorder.dropped > 10)
        stream.pause_s = 0.0
        wait_for(lambda: recorder.frames > 40)
    recorder.close(PATIENCE_S)
    assert recorder.frames + recorder.dropped == len(given)
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames == recorder.frames > 40 and check.different == 0 and "lost to a slow disk" in recorder.note
    zeros = [sum(r.zero is not None for r in recorded_frames(path, endcap)) for endcap in ENDCAPS]
    assert max(zeros) > 1  # began anew behind a gap
