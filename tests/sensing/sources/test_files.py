"""Pictures, folders and videos whose files are turned, cut, not whole, or state times of their own."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from made_jpeg import jpeg

from cad.errors import FileError
from sensing.calibration.picture import read_image
from sensing.decode import FrameError, decode_bgr, decode_gray
from sensing.simulator.render.cli import _read as render_read
from sensing.sources.choose import open_frames
from sensing.sources.files import FolderSource, VideoSource, read_picture


class Capture:
    """A video whose container states these times, ms."""

    def __init__(self, stated_ms: list[float], count: float, rate_hz: float = 25.0) -> None:
        self._times, self._known = iter(stated_ms), {cv2.CAP_PROP_FPS: rate_hz, cv2.CAP_PROP_FRAME_COUNT: count}

    def read(self):
        self._known[cv2.CAP_PROP_POS_MSEC] = stated_ms = next(self._times, None)
        return stated_ms is not None, np.zeros((4, 4, 3), np.uint8)

    def get(self, what):
        return self._known[what]

    def set(self, *_):
        """Nothing can be set."""

    def isOpened(self):
        return True

    def release(self):
        """Nothing to let go."""


@pytest.mark.parametrize(
    ("stated_ms", "times_s"),
    [
        ([0, 40, 80, 480, 880], [0, 0.04, 0.08, 0.48, 0.88]),  # two rates in one file
        ([100, 133, 166], [0, 0.033, 0.066]),
        ([0, 0, 0, 0], [0, 0.04, 0.08, 0.12]),  # none stated: the rate
        ([0, 10, 10, 50], [0, 0.01, 0.05, 0.09]),  # no time goes back
        ([0, float("nan"), float("inf")], [0, 0.04, 0.08]),
    ],
)
def test_frames_of_a_video_have_the_times_that_it_states(tmp_path, monkeypatch, stated_ms, times_s):
    (tmp_path / "v.mp4").write_bytes(b"x")
    monkeypatch.setattr("sensing.sources.files.cv2.VideoCapture", lambda _: Capture(stated_ms, len(stated_ms)))
    assert [frame.time_s for frame in VideoSource(tmp_path / "v.mp4")] == pytest.approx(times_s)


@pytest.mark.parametrize(("stated", "note"), [(9, "ended after 3 of the 9 frames"), (4, ""), (3, ""), (-9e18, "")])
def test_a_video_that_ends_before_its_stated_count_says_so(tmp_path, monkeypatch, capsys, stated, note):
    (tmp_path / "v.mp4").write_bytes(b"x")
    monkeypatch.setattr("sensing.sources.files.cv2.VideoCapture", lambda _: Capture([0, 40, 80], stated))
    source = VideoSource(tmp_path / "v.mp4")
    assert len(list(source)) == 3 and (note in source.note) and bool(source.note) == bool(note)
    with open_frames(str(tmp_path / "v.mp4")) as given:
        assert len(list(given)) == 3
    assert capsys.readouterr().err.count("is the file cut?") == bool(note)


def with_orientation(data: bytes, turn: int) -> bytes:
    """A JPEG or PNG whose EXIF asks viewers to turn it."""
    tiff = b"II*\0\x08\0\0\0" + struct.pack("<HHHIHHI", 1, 0x112, 3, 1, turn, 0, 0)
    if data[:2] == b"\xff\xd8":
        body = b"Exif\0\0" + tiff
        return data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]
    chunk = b"eXIf" + tiff
    return data[:33] + struct.pack(">I", len(tiff)) + chunk + struct.pack(">I", zlib.crc32(chunk)) + data[33:]


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_every_command_sees_the_stored_pixels_whatever_a_picture_s_exif_says(tmp_path, suffix):
    path, image = tmp_path / f"a{suffix}", np.zeros((48, 64, 3), np.uint8)
    image[:9] = 255
    path.write_bytes(with_orientation(cv2.imencode(suffix, image)[1].tobytes(), 6))
    assert cv2.imread(str(path)).shape == (64, 48, 3)  # as a viewer shows it
    for found in (read_image(path), decode_bgr(read_picture(path)), render_read(str(path))):
        assert found.shape == image.shape and np.abs(found.astype(int) - image).mean() < 9


def test_a_turned_video_is_read_as_it_is_stored(tmp_path):
    path = tmp_path / "v.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 25, (64, 48))
    for _ in range(3):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    data, one = path.read_bytes(), 1 << 16
    upright = struct.pack(">9i", one, 0, 0, 0, one, 0, 0, 0, 1 << 30)
    at = data.index(upright, data.index(b"tkhd"))
    path.write_bytes(data[:at] + struct.pack(">9i", 0, one, 0, -one, 0, 0, 0, 0, 1 << 30) + data[at + 36 :])
    assert {frame.image.shape for frame in VideoSource(path)} == {(48, 64, 3)}


def test_a_picture_that_cannot_be_read_is_an_error_or_a_frame_that_says_why(tmp_path):
    for name, data in (("a.jpg", jpeg(9)), ("b.png", b"no picture"), ("c.jpg", jpeg(7))):
        (tmp_path / name).write_bytes(data)
    with pytest.raises(FileError, match=r"b\.png: no picture"):
        list(FolderSource(tmp_path))
    source = FolderSource(tmp_path, faulty=True)
    got = list(source)
    assert [bool(frame.fault) for frame in got] == [False, True, False] and "1 of 3 pictures" in source.note
    with pytest.raises(FrameError, match=r"b\.png: no picture"):
        decode_gray(got[1], 2)
