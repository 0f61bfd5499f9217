"""Videos that build pictures from others are named by every command, whole ones of changing rate are not called cut."""

import json

import cv2
import numpy as np
import pytest

from sensing.field import main as field
from sensing.sources.__main__ import main as sources
from sensing.sources.choose import open_frames
from sensing.sources.coding import coding_of, cut_note
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.files import VideoSource

FRAMES = 14


def written(path, letters: str):
    """A video of the drawn dome with the noise of a camera."""
    rest, rng = draw_dots(Drawing())[0], np.random.default_rng(7)
    height, width = rest.shape[:2]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*letters), 30, (width, height))
    for _ in range(FRAMES):
        noisy = np.clip(rest + rng.normal(0, 1.5, rest.shape), 0, 255).astype(np.uint8)
        writer.write(noisy if noisy.ndim == 3 else cv2.cvtColor(noisy, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


@pytest.mark.parametrize(
    ("name", "letters", "keeps"), [("a.mp4", "mp4v", True), ("a.avi", "MJPG", False), ("a.avi", "FFV1", False)]
)
def test_frames_say_whether_their_video_keeps_parts_of_pictures(tmp_path, name, letters, keeps):
    frames = list(VideoSource(written(tmp_path / name, letters)))
    assert len(frames) == FRAMES and bool(frames[-1].coding) == keeps
    if keeps:
        assert "bits a pixel" in frames[-1].coding


def test_commands_that_take_a_video_name_its_coding(tmp_path, capsys):
    path = str(written(tmp_path / "a.mp4", "mp4v"))
    with open_frames(path) as frames:
        assert len(list(frames)) == FRAMES
    assert "record MJPEG" in capsys.readouterr().err
    cv2.imwrite(str(tmp_path / "a.png"), next(iter(VideoSource(path))).image)
    assert field(["--reference", str(tmp_path / "a.png"), "--video", path, "--out", str(tmp_path / "f.npy")]) == 0
    assert "record MJPEG" in capsys.readouterr().err
    sources(["check", "--json", path])
    (report,) = json.loads(capsys.readouterr().out)
    assert [each["verdict"] for each in report["findings"] if each["name"] == "coding"] == ["look"]


def test_the_doctor_calls_a_cut_video_bad(tmp_path, capsys):
    whole = written(tmp_path / "a.avi", "MJPG")
    cut = tmp_path / "cut.avi"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 6 // 10])
    for path, verdicts in ((whole, []), (cut, ["bad"])):
        sources(["check", "--json", str(path)])
        (report,) = json.loads(capsys.readouterr().out)
        assert [each["verdict"] for each in report["findings"] if each["name"] == "file"] == verdicts


class Capture:
    """A video of 640x480 in a coding, as OpenCV describes it."""

    def __init__(self, letters: bytes, count: float, key: float = 0.0, backend: str = "FFMPEG") -> None:
        self._backend = backend
        self._known = {
            cv2.CAP_PROP_LRF_HAS_KEY_FRAME: key, cv2.CAP_PROP_FOURCC: float(int.from_bytes(letters, "little")),
            cv2.CAP_PROP_FRAME_COUNT: count, cv2.CAP_PROP_FRAME_WIDTH: 640.0, cv2.CAP_PROP_FRAME_HEIGHT: 480.0,
            cv2.CAP_PROP_FPS: 30.0,
        }  # fmt: skip

    def get(self, what):
        return self._known[what]

    def getBackendName(self):
        return self._backend


@pytest.mark.parametrize(
    ("capture", "bytes_a_frame", "coding"),
    [
        (Capture(b"h264", 10), 20000, "h264 at 0.52 bits a pixel"),
        (Capture(b"VP80", 10), 20000, "vp80 at 0.52 bits a pixel"),
        (Capture(b"h264", -9e16), 20000, "h264"),  # its head was written before its end
        (Capture(b"h264", 10), 90000, ""),  # bits enough
        (Capture(b"h264", 10, key=1.0), 20000, ""),  # each picture alone
        (Capture(b"gif ", 10), 20000, ""),
        (Capture(b"h264", 10, backend="CV_MJPEG"), 20000, ""),  # says nothing of key frames
    ],
)
def test_a_coding_is_named_where_pictures_build_on_others_with_few_bits(tmp_path, capture, bytes_a_frame, coding):
    (tmp_path / "a").write_bytes(bytes(10 * bytes_a_frame))
    assert coding_of(capture, tmp_path / "a") == coding


@pytest.mark.parametrize(
    ("head", "count", "frames", "last_s", "words"),
    [
        (b"\x1aE\xdf\xa3", 160, 79, 5.28, ""),  # Matroska: its length times 30 a second, of which it has 15
        (b"\x1aE\xdf\xa3", 160, 40, 2.60, "ended at 2.60 s of the 5.33 s"),
        (b"\0\0\0\x18ftyp", 160, 79, 5.28, "ended after 79 of the 160 frames"),
        (b"RIFF", 160, 40, 1.3, "ended after 40 of the 160 frames"),
        (b"RIFF", 160, 159, 5.3, ""),
        (b"\x1aE\xdf\xa3", -9e16, 40, 2.6, ""),
    ],
)
def test_a_video_is_called_cut_where_its_count_or_its_length_say_so(tmp_path, head, count, frames, last_s, words):
    (tmp_path / "a").write_bytes(head)
    said = cut_note(tmp_path / "a", Capture(b"h264", count), frames, last_s)
    assert (words in said) and bool(said) == bool(words)
