"""Picture files that claim too much, and folders that cannot be read: one line, whichever command meets them."""

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from cad.errors import FileError
from sensing import calibrate, zero
from sensing.decode import MOST_PIXELS, decode_file, picture_size
from sensing.field import main as field
from sensing.sources.__main__ import main as sources
from sensing.sources.files import FolderSource, VideoSource, read_picture


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
    assert picture_size(jpeg_of(640, 480)) == (640, 480) and picture_size(b"\xff\xd8") is None
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
