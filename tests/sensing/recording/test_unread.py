"""Recording beside a stream that goes on while nobody reads it: the camera opens, the reference is made."""

import json
from contextlib import nullcontext

import cv2
import numpy as np

from cad.params import EndcapParams
from sensing import record
from sensing.frames import FtMount
from sensing.recording.folder import Recording
from sensing.recording.ft_streams import FtSample
from sensing.records import Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.tracking.zero import single_zero


class Overflowing:
    """A force sensor at 100 Hz whose socket keeps ten samples while nobody reads, on a clock of the test."""

    faulty, note = 0, ""

    def __init__(self, clock):
        self._clock, self._next = clock, 0

    def __enter__(self):
        self._next = round(100 * self._clock())
        return self

    def __exit__(self, *_):
        pass

    def arrived(self):
        newest = round(100 * self._clock())
        for number in [*range(self._next, min(newest, self._next + 10)), newest]:
            yield FtSample(number / 100, np.zeros(6))
        self._next = newest + 1


def test_what_is_lost_while_the_camera_opens_and_the_reference_is_made_is_no_clock_that_jumped(tmp_path, monkeypatch):
    """Both take seconds, in which a NetFT at 7 kHz sends more than a socket keeps."""
    now, jpeg = [100.0], cv2.imencode(".jpg", draw_dots(Drawing())[0])[1].tobytes()
    monkeypatch.setattr(record.time, "monotonic", lambda: now[0])

    def zeroed(rest, name, params):
        now[0] += 2.2
        return single_zero(rest[0])

    def camera():
        now[0] += 1.8
        for k in range(76):
            now[0] += 1 / 30
            yield Frame(now[0], k, "drawn", jpeg=jpeg)

    monkeypatch.setattr(record, "take_zero", zeroed)
    with Recording(tmp_path / "set", EndcapParams(130, 8), FtMount(np.eye(4), 1)) as recording:
        result = record.record(camera(), Overflowing(lambda: now[0]), recording)
    assert result.written >= 40


def test_the_compiled_code_is_loaded_before_the_streams_are_opened(tmp_path, monkeypatch):
    """On a new computer that takes half a minute, in which frames and samples are cut."""
    opened = []
    mount = tmp_path / "mount.json"
    mount.write_text(json.dumps({"T_endcap_ft": np.eye(4).tolist(), "reads": 1}))
    monkeypatch.setattr(record, "warm_up", lambda _: opened.append("warm"))
    monkeypatch.setattr(record, "record", lambda *_: opened.append("record") or record.RecordResult(1, 0, 0))
    words = ["--source", "0", "--netft", "127.0.0.1", "--mount", str(mount), "--out", str(tmp_path / "set")]
    monkeypatch.setattr(record, "open_frames", lambda _: nullcontext([]))
    assert record.main(words) == 0 and opened == ["warm", "record"]
