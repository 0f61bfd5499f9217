"""A recording is on the disk when it has ended, and not long after its frames before: power goes without a warning."""

import errno
import os
import threading

import pytest
from live_stand_in import PATIENCE_S, film, frames, pipeline

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.outputs.mcap import new_file
from sensing.live.outputs.mcap.recorder import Recorder

MAGIC = b"\x89MCAP0\r\n"  # ends a whole file


def recorded(path) -> Recorder:
    """A recording of some frames, not yet closed."""
    recorder = Recorder(path, LiveConfig((EndcapConfig("endcap_0", "test"),)), {"endcap_0": 0}, lambda _: None)
    recorder.start()
    pipe = pipeline()
    for frame in frames(film([0] * 6)):
        recorder.put(pipe.update(frame))
    return recorder


def test_a_recording_that_has_ended_is_on_the_disk_with_its_name(tmp_path, monkeypatch):
    path, asked = tmp_path / "run.mcap", []
    monkeypatch.setattr(os, "fsync", lambda number: asked.append((os.fstat(number).st_ino, path.read_bytes()[-8:])))
    recorder = recorded(path)
    recorder.close(PATIENCE_S)
    assert asked == [(path.stat().st_ino, MAGIC), (tmp_path.stat().st_ino, MAGIC)] and recorder.frames == 6


def test_frames_are_sent_to_the_disk_with_every_flush(tmp_path, monkeypatch):
    monkeypatch.setattr("sensing.live.outputs.mcap.recorder.FLUSH_S", 0.0)
    path, sizes = tmp_path / "run.mcap", []
    monkeypatch.setattr(os, "posix_fadvise", lambda number, *_: sizes.append(os.fstat(number).st_size))
    recorder = recorded(path)
    recorder.close(PATIENCE_S)
    assert len(sizes) >= 6 and sizes == sorted(sizes) and sizes[-1] > sizes[0] > 0


@pytest.mark.parametrize(("number", "failed"), [(errno.EIO, os.strerror(errno.EIO)), (errno.EINVAL, "")])
def test_a_disk_that_fails_at_the_end_is_named_and_one_that_cannot_wait_is_not(tmp_path, monkeypatch, number, failed):
    def refuse(_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(new_file.os, "fsync", refuse)
    recorder = recorded(tmp_path / "run.mcap")
    recorder.close(PATIENCE_S)
    assert recorder.failed == failed


def test_a_disk_that_takes_its_time_at_the_end_makes_no_recording_incomplete(tmp_path, monkeypatch):
    asked, answers = threading.Event(), threading.Event()
    monkeypatch.setattr(os, "fsync", lambda _: (asked.set(), answers.wait(PATIENCE_S)))
    recorder = recorded(tmp_path / "run.mcap")
    closing = threading.Thread(target=recorder.close, args=(PATIENCE_S,))
    closing.start()
    try:
        assert asked.wait(PATIENCE_S)
        recorder.close(0.0)
        assert not recorder.ended and recorder.failed == "" and recorder.frames == 6
    finally:
        answers.set()
        closing.join(PATIENCE_S)
