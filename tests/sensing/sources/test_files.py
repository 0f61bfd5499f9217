"""Pictures, folders and videos that are too large, locked, turned, cut, not whole, or state times of their own."""

import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_jpeg import jpeg

from cad.errors import FileError
from sensing import calibrate, zero
from sensing.calibration.picture import read_image
from sensing.decode import MOST_PIXELS, FrameError, decode_bgr, decode_file, decode_gray, jpeg_size
from sensing.field import main as field
from sensing.simulator.render.cli import _read as render_read
from sensing.sources.__main__ import main as sources
from sensing.sources.choose import open_frames
from sensing.sources.files import FolderSource, VideoSource, read_picture

ROOT = Path(__file__).resolve().parents[3]


def png_head(width: int, height: int) -> bytes:
    """A PNG that holds nothing but its size."""
    parts = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)), (b"IDAT", b""), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def jpeg_of(width: int, height: int) -> bytes:
    """A small JPEG that claims another size."""
    data = bytearray(cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes())
    start = data.index(b"\xff\xc0") + 5
    data[start : start + 4] = struct.pack(">HH", height, width)
    return bytes(data)


def bmp_head(width: int, height: int) -> bytes:
    """A BMP whose size is not read here, so that OpenCV itself refuses it."""
    return b"BM" + struct.pack("<IHHIIiiHHIIiiII", 54, 0, 0, 54, 40, width, height, 1, 24, 0, 0, 0, 0, 0, 0)


def one_line(capsys) -> str:
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "Traceback" not in error
    return error


@pytest.mark.parametrize("size", [(100000, 100000), (MOST_PIXELS + 1, 1)])
@pytest.mark.parametrize("read", [read_picture, lambda path: decode_file(path, path.read_bytes())])
def test_a_picture_of_too_many_pixels_is_refused_before_it_is_decoded(tmp_path, size, read):
    (tmp_path / "large.png").write_bytes(png_head(*size))
    with pytest.raises(FileError, match=f"a picture of {size[0]}x{size[1]} px: at most {MOST_PIXELS} pixels"):
        read(tmp_path / "large.png")


def test_the_size_of_a_jpeg_counts_too_and_what_opencv_refuses_is_no_picture(tmp_path):
    assert jpeg_size(jpeg_of(640, 480)) == (640, 480) and jpeg_size(b"\xff\xd8") is None
    with pytest.raises(FileError, match="65000x65000 px"):
        decode_file("a.jpg", jpeg_of(65000, 65000))
    with pytest.raises(FileError, match="no picture that can be decoded"):
        decode_file("a.bmp", bmp_head(100000, 100000))


@pytest.mark.parametrize("option", ["--photo", "--board"])
def test_calibration_and_the_camera_doctor_say_so(tmp_path, capsys, option):
    (tmp_path / "large.png").write_bytes(png_head(100000, 100000))
    assert calibrate.main([option, str(tmp_path / "large.png"), "--out", str(tmp_path / "c.json")]) == 2
    assert "100000x100000 px" in one_line(capsys)
    assert sources(["check", str(tmp_path / "large.png")]) == 2
    assert "100000x100000 px" in one_line(capsys)


def test_a_folder_that_may_not_be_read_is_named(tmp_path, capsys, monkeypatch):
    (tmp_path / "locked").mkdir()
    (tmp_path / "a.png").write_bytes(png_head(4, 4))

    def refuse(path, *_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "iterdir", refuse)
    monkeypatch.setattr(Path, "is_dir", refuse)  # as in a folder whose own folder is locked
    monkeypatch.setattr(Path, "is_file", refuse)
    monkeypatch.setattr(os, "scandir", refuse)
    locked = str(tmp_path / "locked")
    with pytest.raises(FileError, match="locked: Permission denied: give a readable folder"):
        FolderSource(locked)
    with pytest.raises(FileError, match="no such file"):
        VideoSource(tmp_path / "none.avi")
    assert sources(["check", locked]) == 2
    assert "Permission denied" in one_line(capsys)
    assert zero.main(["take", "--source", locked, "--out", "z.npz"]) == 2
    assert "Permission denied" in one_line(capsys)
    monkeypatch.setattr("sensing.field.require_place", lambda path: None)
    monkeypatch.setattr("sensing.field.read_picture", lambda path: None)
    assert field(["--reference", str(tmp_path / "a.png"), "--video", locked, "--out", "f.npy"]) == 2
    assert "Permission denied" in one_line(capsys)


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

    def getBackendName(self):
        return "none that knows codings"

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
    (tmp_path / "v.mp4").write_bytes(b"\0\0\0\x18ftyp")
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


def test_pictures_of_a_folder_come_in_the_order_in_which_they_were_numbered(tmp_path):
    """Programs that save pictures rarely pad numbers; 10.jpg before 2.jpg made a loaded picture the reference."""
    names = ["2.jpg", "9.jpg", "10.jpg", "11.jpg", "101.jpg", "press_2_1.jpg", "press_02_2.jpg", "press_10_0.jpg"]
    for name in names:
        (tmp_path / name).write_bytes(jpeg(8))
    assert [Path(frame.source).name for frame in FolderSource(tmp_path)] == names


@pytest.mark.parametrize("mark", [b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", b"SQLite format 3\0", b""])
def test_a_recording_is_no_video_though_ffmpeg_finds_jpegs_in_it(tmp_path, mark):
    """Of an MCAP of six cameras live showed one endcap that ran, with times of 25 pictures a second."""
    path = tmp_path / "run.avi"
    path.write_bytes(mark + (b"\0" * 90 + jpeg(9)) * 9 if mark else b"")
    with pytest.raises(FileError, match=r"a recording \(.*--replay" if mark else "an empty file"):
        VideoSource(path)


def test_hidden_files_are_no_pictures_of_a_folder(tmp_path):
    """macOS leaves ._1.jpg beside 1.jpg on sticks and shares: it came first, and the reference could not be read."""
    for name in ("shot_1.jpg", "shot_2.jpg"):
        (tmp_path / name).write_bytes(jpeg(8))
        (tmp_path / f"._{name}").write_bytes(b"\0\5\x16\7 resource fork")
    assert [Path(frame.source).name for frame in FolderSource(tmp_path)] == ["shot_1.jpg", "shot_2.jpg"]


def test_a_file_of_several_pictures_is_refused_instead_of_losing_all_but_the_first(tmp_path, capsys):
    image = np.zeros((48, 64, 3), np.uint8)
    path = tmp_path / "stack.tif"
    for pages in (1, 2):
        cv2.imwritemulti(str(path), [image] * pages)
        if pages == 1:
            assert decode_bgr(read_picture(path)).shape == image.shape
    png = cv2.imencode(".png", image)[1].tobytes()
    control = b"acTL" + struct.pack(">II", 2, 0)
    moving = tmp_path / "moving.png"
    moving.write_bytes(png[:33] + struct.pack(">I", 8) + control + struct.pack(">I", zlib.crc32(control)) + png[33:])
    for several in (path, moving):
        for read in (read_picture, read_image):
            with pytest.raises(FileError, match="several pictures"):
                read(several)


@pytest.mark.parametrize("command", [["sensing.sources", "check"], ["endcap", "doctor"]])
def test_a_command_shows_none_of_the_lines_of_opencv_and_ffmpeg(tmp_path, command):
    cv2.imwrite(str(tmp_path / "a.tif"), np.zeros((48, 64, 3), np.float32))
    (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x14ftypisom\0\0\0\0isom" + bytes(400))
    for name, words in (("a.tif", "none of 8 or 16 bits"), ("a.mp4", "no video")):
        run = [sys.executable, "-m", *command, str(tmp_path / name)]
        done = subprocess.run(run, capture_output=True, text=True, cwd=ROOT)
        assert done.returncode == 2 and words in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_a_program_that_reads_pictures_keeps_its_logs():
    code = (
        "import os, cv2; before = cv2.utils.logging.getLogLevel(), dict(os.environ); import sensing.sources.choose; "
        "assert (cv2.utils.logging.getLogLevel(), dict(os.environ)) == before"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


@pytest.mark.parametrize(
    ("names", "gaps"),
    [
        ([f"{k}.jpg" for k in range(12)], []),
        ([f"frame_{k:04d}.jpg" for k in range(0, 120, 10)], []),  # every tenth is even, too
        (["a1.png", "a2.png", "a3.png", "a7.png", "a8.png"], [("a3.png", "a7.png")]),
        (["rest.jpg", "press_1.jpg", "press_2.jpg", "press_3.jpg", "turn_9.jpg"], []),
        ([f"t{1000 + 33 * k + k % 3}.jpg" for k in range(9)], []),  # times in ms
        (["2026-11-28_09.jpg", "2026-11-28_10.jpg", "2026-11-29_55.jpg"], []),
    ],
)
def test_missing_numbers_of_a_folder_are_named(tmp_path, names, gaps):
    for name in names:
        (tmp_path / name).touch()
    assert FolderSource(tmp_path).gaps == gaps
