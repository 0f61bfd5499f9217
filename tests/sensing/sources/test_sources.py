import threading
import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from made_jpeg import jpeg

from cad.errors import FileError, ParameterError
from sensing.decode import jpeg_size
from sensing.records import Frame
from sensing.sources.camera import (
    CameraConfig,
    CameraSource,
    capture_time_s,
    device_number,
    lasting_name,
    list_devices,
    to_frame,
)
from sensing.sources.choose import source_opener
from sensing.sources.files import FolderSource, VideoSource, read_picture
from sensing.sources.newest import LiveSource, NewestQueue, SourceError

PATIENCE_S = 60.0


def frames(count: int, size: tuple[int, int] = (64, 48)) -> list[Frame]:
    return [Frame(i / 30, i, "test", jpeg=jpeg(i * 7 % 200, size), size=size) for i in range(count)]


def wait_for(condition) -> None:
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.005)


# --- queue ---------------------------------------------------------------------------------------------------
def test_newest_frames_win_and_drops_are_counted():
    queue = NewestQueue(2)
    for frame in frames(5):
        queue.put(frame)
    assert [queue.get(0).sequence, queue.get(0).sequence] == [3, 4] and queue.dropped == 3
    assert queue.get(0.01) is None


def test_slow_reader_sees_gaps_in_the_sequence_not_old_frames():
    def endless():
        while True:
            yield from frames(20)
            time.sleep(0.001)

    with LiveSource(endless, length=1) as live:
        first = live.get(PATIENCE_S)
        wait_for(lambda: live.health.frames > first.sequence + 60)
        assert live.get(PATIENCE_S).sequence > first.sequence + 50 and live.health.dropped > 50


# --- faults --------------------------------------------------------------------------------------------------
def test_unplugged_source_says_so_and_recovers():
    opened, plugged, done = [], threading.Event(), threading.Event()

    def open_source():
        opened.append(1)
        if len(opened) == 2:
            plugged.wait(PATIENCE_S)
            raise SourceError("/dev/video7: no such camera")
        yield from frames(3)
        if len(opened) == 1:
            raise SourceError("/dev/video7: no more frames: is it unplugged?")
        yield from frames(3)
        done.wait(PATIENCE_S)

    with LiveSource(open_source, length=100, silent_s=PATIENCE_S, retry_s=0.05) as live:
        wait_for(lambda: live.health.status == "unplugged")
        assert "/dev/video7" in live.health.message
        plugged.set()
        wait_for(lambda: live.health.status == "running" and live.health.frames > 6)
        assert live.health.reopened == 1  # once it delivered again; the attempt that failed does not count
        sequences = [live.get(PATIENCE_S).sequence for _ in range(6)]
        done.set()
        assert sequences == list(range(6))  # goes on counting through the reopening


@pytest.fixture
def clock(monkeypatch):
    """The clock of the sources, set by hand."""
    clock = SimpleNamespace(now_s=100.0)
    clock.monotonic = lambda: clock.now_s
    monkeypatch.setattr("sensing.sources.newest.time", clock)
    return clock


def test_silence_is_judged_by_the_clock(clock):
    gate = threading.Event()

    def silent():
        yield frames(1)[0]
        gate.wait(PATIENCE_S)

    with LiveSource(silent, silent_s=1.0) as live:
        wait_for(lambda: live.health.status == "running")
        clock.now_s += 0.9
        assert live.health.status == "running"
        clock.now_s += 0.2
        assert live.health.status == "silent" and "no frame for 1.1 s" in live.health.message
        gate.set()


def test_a_source_that_never_gives_a_whole_picture_does_not_start_for_ever(clock):
    gate, done = threading.Event(), threading.Event()

    def dripping():
        gate.wait(PATIENCE_S)
        yield frames(1)[0]
        done.wait(PATIENCE_S)

    with LiveSource(dripping) as live:
        clock.now_s += 3.9
        assert live.health.status == "starting"
        clock.now_s += 0.2
        assert live.health.status == "silent" and "no whole picture in 4 s" in live.health.message
        gate.set()
        wait_for(lambda: live.health.status == "running")
        done.set()


def test_what_is_in_a_frame_is_not_judged_here():
    done = threading.Event()

    def odd():
        yield frames(1)[0]
        yield Frame(0, 0, "cut", jpeg=jpeg(9)[:200])
        yield frames(1, (32, 24))[0]
        done.wait(PATIENCE_S)

    with LiveSource(odd, length=10, silent_s=PATIENCE_S) as live:
        wait_for(lambda: live.health.frames == 3)
        assert live.health.status == "running" and live.health.message == ""
        done.set()


def test_unexpected_error_in_a_source_does_not_end_the_thread():
    def broken():
        yield frames(1)[0]
        raise RuntimeError("driver")

    with LiveSource(broken, retry_s=0.01) as live:
        wait_for(lambda: live.health.reopened >= 3)
        assert "RuntimeError: driver" in live.health.message or live.health.status == "running"


def test_six_sources_side_by_side():
    def endless():
        while True:
            yield from frames(10)
            time.sleep(0.002)

    lives = [LiveSource(endless) for _ in range(6)]
    try:
        for live in lives:
            live.__enter__()
        for live in lives:
            assert live.get(PATIENCE_S) is not None
        wait_for(lambda: all(live.health.frames > 30 for live in lives))
    finally:
        for live in lives:
            live.close()


# --- files ---------------------------------------------------------------------------------------------------
def test_jpeg_size_without_decoding():
    assert jpeg_size(jpeg(3, (123, 45))) == (123, 45)
    assert jpeg_size(b"") is None and jpeg_size(b"\xff\xd8\xff\xc0") is None and jpeg_size(b"\x89PNG") is None


def test_folder_in_order_of_names(tmp_path):
    for name, level in [("b.jpg", 2), ("a.jpg", 1)]:
        (tmp_path / name).write_bytes(jpeg(level))
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((48, 64, 3), np.uint8))
    (tmp_path / "notes.txt").write_text("x")
    got = list(FolderSource(tmp_path))
    assert [f.source[-5:] for f in got] == ["a.jpg", "b.jpg", "c.png"] and got[0].jpeg and got[2].image is not None


def test_video_round_trip(tmp_path):
    path = tmp_path / "v.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (64, 48))
    for level in (10, 120, 230):
        writer.write(np.full((48, 64, 3), level, np.uint8))
    writer.release()
    got = list(VideoSource(path))
    assert [round(f.image.mean(), -1) for f in got] == [10, 120, 230] and got[2].time_s == pytest.approx(2 / 25)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda d: read_picture(d / "none.jpg"), "No such file"),
        (lambda d: FolderSource(d / "none"), "No such file"),
        (lambda d: FolderSource(d), "no picture in it"),
        (lambda d: VideoSource(d / "none.avi"), "no such file"),
        (lambda d: source_opener(str(d / "none")), "no camera number, address, folder or file"),
        (lambda _: source_opener("rtsp://10.0.0.7/stream"), "no address that can be read"),
        (lambda _: source_opener("http:/10.0.0.7/stream"), "given as http://HOST"),
    ],
)
def test_missing_files_are_named(tmp_path, make, words):
    with pytest.raises(FileError, match=words):
        make(tmp_path)


def test_file_that_is_no_picture_or_video(tmp_path):
    path = tmp_path / "x.jpg"
    for content in (b"", b"hello", b"\xff\xd8\xff"):
        path.write_bytes(content)
        with pytest.raises(FileError, match="no picture"):
            read_picture(path)
    with pytest.raises(FileError, match="no video"):
        VideoSource(path)


# --- camera --------------------------------------------------------------------------------------------------
def test_missing_camera_is_named():
    with pytest.raises(SourceError, match="/dev/video77: no such camera"):
        CameraSource(CameraConfig(device=77))


def test_driver_stamp_is_used_only_when_near_the_arrival():
    assert capture_time_s(99.98, 100.0) == 99.98
    assert capture_time_s(0.0, 100.0) == 100.0 and capture_time_s(100.1, 100.0) == 100.0


def test_driver_data_becomes_a_frame_either_way():
    data = jpeg(3)
    packed = to_frame(np.frombuffer(data, np.uint8)[None], 1.0, 0, "c", 50.0)
    assert packed.jpeg == data and packed.size == (64, 48) and packed.exposure == 50.0
    assert to_frame(np.zeros((48, 64, 3), np.uint8), 1.0, 0, "c", 50.0).image.shape == (48, 64, 3)


def test_devices_are_listed_without_metadata_nodes(tmp_path):
    for name, index, label in [("video0", "0", "HD USB"), ("video1", "1", "HD USB"), ("video10", "0", "other")]:
        (tmp_path / name).mkdir()
        (tmp_path / name / "index").write_text(index + "\n")
        (tmp_path / name / "name").write_text(label + "\n")
    assert list_devices(tmp_path) == [(0, "HD USB"), (10, "other")]
    assert list_devices(tmp_path / "none") == []


def test_a_camera_is_known_by_its_port_whatever_number_it_gets(tmp_path, monkeypatch):
    ports = tmp_path / "by-path"
    ports.mkdir()
    names = [f"pci-0000:00:14.0-usb-0:{port}:1.0-video-index0" for port in (1, 2)]

    def plug(numbers: tuple[int, int]) -> None:
        for name, number in zip(names, numbers, strict=True):
            (tmp_path / f"video{number}").touch()
            (ports / name).unlink(missing_ok=True)
            (ports / name).symlink_to(tmp_path / f"video{number}")

    plug((0, 2))
    lasting = [lasting_name(number, ports) for number in (0, 2)]
    assert lasting == [str(ports / name) for name in names]
    assert lasting_name(7, ports) == "7" and lasting_name(0, tmp_path / "none") == "0"
    assert [device_number(name) for name in lasting] == [0, 2]
    plug((2, 0))  # the computer started anew, and the cameras answered in another order
    assert [device_number(name) for name in lasting] == [2, 0]
    monkeypatch.setattr("sensing.sources.camera.BY_PATH", ports)
    monkeypatch.setattr("sensing.sources.choose.CameraSource", lambda config: config.device)
    opener, _ = source_opener("2")
    assert opener() == 2
    plug((0, 2))  # unplugged while they run, and plugged in again in another order: it stays the same camera
    assert opener() == 0
    (ports / names[0]).unlink()
    with pytest.raises(SourceError, match="no such camera: plug it into this port"):
        opener()
    opener, live = source_opener("/dev/v4l/by-path/none-video-index0")
    assert live
    with pytest.raises(SourceError, match="no such camera"):
        opener()
    with pytest.raises(SourceError, match="/dev/null: no camera"):
        device_number("/dev/null")


def test_bad_camera_settings_are_refused():
    with pytest.raises(ParameterError, match="rate_hz=0"):
        CameraConfig(rate_hz=0)
