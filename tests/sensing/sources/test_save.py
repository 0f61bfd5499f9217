"""``sensing.sources save``: one frame of every kind of source, whole or not at all, and one line for every fault."""

import time

import cv2
import numpy as np
import pytest
from made_jpeg import jpeg

from sensing.records import Frame
from sensing.sources import save as saving
from sensing.sources.__main__ import main
from sensing.sources.newest import SourceError


@pytest.fixture
def camera(monkeypatch):
    """Makes the source of every word: frames for ever, of the bytes that a function of their number gives."""

    def make(bytes_of):
        def frames():
            for number in range(1000):
                yield Frame(number / 30, number, "/dev/video0", jpeg=bytes_of(number), size=(64, 48))
                time.sleep(0.01)

        monkeypatch.setattr(saving, "source_opener", lambda word, camera: (frames, True))

    monkeypatch.setattr(saving, "SETTLE_S", 0.1)
    monkeypatch.setattr(saving, "WAIT_S", 1.0)
    return make


def test_the_first_frame_of_files_is_saved_byte_for_byte_as_jpeg_and_without_loss_as_png(tmp_path, capsys):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for number, name in enumerate(("a.jpg", "b.jpg")):
        (folder / name).write_bytes(jpeg(90 * number + 40, (64, 48)))
    for source in (folder, folder / "a.jpg"):
        assert main(["save", str(source), str(tmp_path / "out.jpg")]) == 0
        assert (tmp_path / "out.jpg").read_bytes() == (folder / "a.jpg").read_bytes()
        assert f"{tmp_path / 'out.jpg'}: 64 x 48 px of " in capsys.readouterr().out
    assert main(["save", str(folder), str(tmp_path / "out.png")]) == 0
    image, wanted = cv2.imread(str(tmp_path / "out.png")), cv2.imread(str(folder / "a.jpg"))
    assert np.abs(image.astype(int) - wanted).max() <= 2  # two decoders


def test_a_png_becomes_a_jpeg(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.full((48, 64, 3), 120, np.uint8))
    assert main(["save", str(tmp_path / "a.png"), str(tmp_path / "a.JPG")]) == 0
    assert (tmp_path / "a.JPG").read_bytes()[:2] == b"\xff\xd8"


def test_a_camera_settles_first_and_a_damaged_frame_is_passed_over(tmp_path, camera):
    camera(lambda number: jpeg(10) if number < 5 else jpeg(99)[:200] if number % 2 else jpeg(200))
    assert main(["save", "0", str(tmp_path / "a.jpg")]) == 0
    assert (tmp_path / "a.jpg").read_bytes() == jpeg(200)


def test_a_camera_without_a_whole_picture_gets_one_line_and_leaves_what_stands_there(tmp_path, camera, capsys):
    (tmp_path / "a.jpg").write_bytes(b"before")
    camera(lambda number: jpeg(99)[:200])
    assert main(["save", "0", str(tmp_path / "a.jpg")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "0: no whole picture in 1 s" in error and "damaged" in error
    assert [path.name for path in tmp_path.iterdir()] == ["a.jpg"]
    assert (tmp_path / "a.jpg").read_bytes() == b"before"


def test_a_camera_that_is_not_there_says_so_at_once(tmp_path, monkeypatch, capsys):
    def missing():
        raise SourceError("/dev/video7: no such camera; found: none: plug it in or choose another")

    monkeypatch.setattr(saving, "source_opener", lambda word, camera: (missing, True))
    assert main(["save", "7", str(tmp_path / "a.jpg")]) == 2
    assert capsys.readouterr().err == (
        "sensing.sources: /dev/video7: no such camera; found: none: plug it in or choose another\n"
    )


@pytest.mark.parametrize(
    ("source", "file", "expected"),
    [
        ("nothing_here", "a.jpg", "no camera number, address, folder or file"),
        ("a.jpg", "a.txt", "unknown picture format '.txt'; end the name in .jpg or .jpeg or .png"),
        ("a.jpg", "missing/a.jpg", "name a file in a folder that may be written"),
        ("cut.jpg", "b.jpg", "is damaged"),
        ("empty", "b.jpg", "no picture in it"),
    ],
)
def test_bad_input_gets_one_line_status_2_and_no_file(source, file, expected, tmp_path, monkeypatch, capsys):
    (tmp_path / "a.jpg").write_bytes(jpeg(90))
    (tmp_path / "cut.jpg").write_bytes(jpeg(90)[:400])
    (tmp_path / "empty").mkdir()
    before = sorted(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    assert main(["save", source, file]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and expected in error and sorted(tmp_path.iterdir()) == before
