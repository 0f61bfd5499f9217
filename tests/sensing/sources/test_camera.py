"""The camera without a camera: stand-ins for the driver's ioctl and for OpenCV's capture."""

import struct
import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from sensing.decode import decode_bgr
from sensing.sources import camera, v4l2
from sensing.sources.__main__ import main
from sensing.sources.camera import CameraConfig, CameraSource
from sensing.sources.newest import LiveSource, SourceError
from sensing.sources.v4l2 import CameraMode, read_modes

MJPG, YUYV = (struct.unpack("I", code)[0] for code in (b"MJPG", b"YUYV"))
SIZES = {MJPG: [(640, 480), (1280, 720)], YUYV: [(320, 240)]}
RATES = {(640, 480): [(1, 30), (1, 60)], (1280, 720): [(1, 30)], (320, 240): [(2, 15)]}


def driver(descriptor: int, request: int, buffer: bytearray) -> int:
    """Answers as the kernel does: requests and offsets as printed by a C program from <linux/videodev2.h>."""
    if request == 0x80685600:
        struct.pack_into("II", buffer, 84, 0x84200001, 0x04200001)
        return 0
    index, second = struct.unpack_from("II", buffer)
    try:
        if request == 0xC0405602:
            assert second == 1
            struct.pack_into("I", buffer, 44, [YUYV, MJPG][index])
        elif request == 0xC02C564A:
            struct.pack_into("3I", buffer, 8, 1, *SIZES[second][index])
        elif request == 0xC034564B:
            struct.pack_into("3I", buffer, 16, 1, *RATES[struct.unpack_from("II", buffer, 8)][index])
        else:
            raise AssertionError(hex(request))
    except IndexError:
        raise OSError(22, "Invalid argument") from None
    return 0


def test_modes_are_those_of_the_driver_jpeg_first():
    assert read_modes("/dev/null", driver) == [
        CameraMode("MJPG", (640, 480), (60.0, 30.0)),
        CameraMode("MJPG", (1280, 720), (30.0,)),
        CameraMode("YUYV", (320, 240), (7.5,)),
    ]


def test_a_range_of_sizes_gives_the_usual_ones_within():
    def ranged(descriptor, request, buffer):
        if request == 0xC02C564A:
            struct.pack_into("7I", buffer, 8, 3, 16, 1280, 2, 16, 720, 2)
            return 0
        if request == 0xC034564B:
            struct.pack_into("7I", buffer, 16, 3, 1, 60, 1, 5, 0, 0)
            return 0
        return driver(descriptor, request, buffer)

    modes = [m for m in read_modes("/dev/null", ranged) if m.pixel_format == "MJPG"]
    assert [m.size for m in modes] == [(640, 480), (800, 600), (1280, 720)]
    assert modes[0].rates_hz == (60.0, 5.0) and str(modes[0]) == "MJPG 640x480 at 60, 5 frames/s"


def test_metadata_nodes_and_other_files_have_no_modes(monkeypatch):
    def metadata(descriptor, request, buffer):
        struct.pack_into("II", buffer, 84, 0x84A00001, 0x04A00000)
        return 0

    assert read_modes("/dev/null", metadata) == []
    with pytest.raises(OSError):
        read_modes("/dev/null")  # the real ioctl: not a camera


def test_listing_names_what_is_wrong(monkeypatch, capsys):
    monkeypatch.setattr("sensing.sources.__main__.list_devices", lambda: [(99, "HD USB")])
    assert main([]) == 2
    output = capsys.readouterr()
    assert "/dev/video99  HD USB" in output.out and "no such camera" in output.err
    monkeypatch.setattr("sensing.sources.__main__.list_devices", lambda: [])
    assert main([]) == 0 and "no camera found" in capsys.readouterr().out


class Capture:
    """What OpenCV's capture does with a camera that sends three frames and is then pulled out."""

    opened = True

    def __init__(self, device, backend):
        self.settings, self.count = {}, 0
        Capture.made = self

    def isOpened(self):
        return self.opened

    def set(self, key, value):
        self.settings[key] = value

    def get(self, key):
        if key == cv2.CAP_PROP_POS_MSEC:
            return (1000.0 + self.count / 30 - 0.02) * 1e3
        return self.settings.get(key, 0.0)

    def read(self):
        self.count += 1
        if self.count > 3:
            return False, None
        data = cv2.imencode(".jpg", np.full((48, 64), 50 * self.count, np.uint8))[1]
        return True, data.reshape(1, -1)

    def release(self):
        pass


@pytest.fixture
def plugged(monkeypatch):
    monkeypatch.setattr(camera, "_require_usable", lambda path: None)
    monkeypatch.setattr(cv2, "VideoCapture", Capture)
    monkeypatch.setattr(camera, "time", SimpleNamespace(monotonic=lambda: 1000.0 + Capture.made.count / 30))
    monkeypatch.setattr(Capture, "opened", True)


def test_frames_keep_their_bytes_the_drivers_time_and_the_fixed_exposure(plugged):
    got = []
    with pytest.raises(SourceError, match="unplugged"):
        for frame in CameraSource(CameraConfig(exposure=120)):
            got.append((frame, camera.time.monotonic() - frame.time_s))
    assert [f.sequence for f, _ in got] == [0, 1, 2]
    assert all(f.jpeg[:2] == b"\xff\xd8" and f.size == (64, 48) and f.exposure == 120 for f, _ in got)
    assert [age for _, age in got] == pytest.approx([0.02] * 3)  # the driver's stamp, not the arrival


@pytest.mark.parametrize("reported", [0.0, -1.0])
def test_an_exposure_that_the_driver_does_not_say_is_none(plugged, monkeypatch, reported):
    """A reference of such a camera said "exposure -1"."""
    offered = Capture.get
    monkeypatch.setattr(Capture, "get", lambda self, key: offered(self, key) or reported)
    assert next(iter(CameraSource(CameraConfig()))).exposure is None


@pytest.mark.parametrize("pixels", ["YUYV", "NV12"])
def test_a_camera_without_jpeg_gives_pictures_and_no_planes_of_yuv(plugged, monkeypatch, pixels):
    """As OpenCV's capture does: raw bytes are rows of another shape, (h, w, 2) or (1.5 h, w), unless it converts."""
    picture = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    raw = {"YUYV": cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_YUY2), "NV12": cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420)}
    offered = Capture.get

    def get(self, key):
        return cv2.VideoWriter.fourcc(*pixels) if key == cv2.CAP_PROP_FOURCC else offered(self, key)

    def read(self):
        self.count += 1
        return True, picture if self.settings.get(cv2.CAP_PROP_CONVERT_RGB, 1) else raw[pixels]

    monkeypatch.setattr(Capture, "get", get)
    monkeypatch.setattr(Capture, "read", read)
    frame = next(iter(CameraSource(CameraConfig())))
    assert frame.size == (64, 48)
    assert (decode_bgr(frame) == picture).all()


def test_busy_camera_is_said(plugged, monkeypatch):
    monkeypatch.setattr(Capture, "opened", False)
    with pytest.raises(SourceError, match="busy"):
        next(iter(CameraSource(CameraConfig())))


def test_unplugged_camera_is_opened_again(plugged):
    with LiveSource(lambda: CameraSource(CameraConfig()), retry_s=0.02) as live:
        end = time.monotonic() + 60
        while live.health.frames < 7 and time.monotonic() < end:
            time.sleep(0.01)
        assert live.health.frames >= 7 and live.health.reopened >= 2


def test_no_permission_is_said(tmp_path, monkeypatch):
    def refuse(self, *_):
        raise PermissionError(13, "Permission denied")

    node = tmp_path / "video0"
    node.touch()
    monkeypatch.setattr(type(node), "open", refuse)
    with pytest.raises(SourceError, match="group 'video'"):
        camera._require_usable(node)


def test_request_numbers_are_those_of_the_header():
    assert [hex(v4l2._read_write(n, size)) for n, size in ((2, 64), (74, 44), (75, 52))] == [
        "0xc0405602", "0xc02c564a", "0xc034564b",
    ]  # fmt: skip
