"""Options, configurations and reference files that cannot be used: one line on stderr and exit status 2."""

import io
import itertools
import json
import signal
import socket
import threading
import zipfile
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, HTTPServer

import cv2
import numpy as np
import pytest
from live_program import program
from live_stand_in import PATIENCE_S, film, frames, stand_in, wait_for

from cad.errors import FileError, ParameterError, printable
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.live.cli import main
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import Captured, FileFeed
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.open_endcaps import open_feed
from sensing.live.replay import read_config
from sensing.npz import read_npz
from sensing.tracking.zero import load_zero, save_zero, single_zero


@pytest.fixture(autouse=True)
def stand_in_model(monkeypatch):
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())


def refused(capsys, *arguments: str) -> str:
    """The one line that the command says."""
    assert main(list(arguments)) == 2
    said = capsys.readouterr().err
    assert said.startswith("sensing.live: ") and said.count("\n") == 1 and said[:-1].isprintable()
    return said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("--config e.toml --rate 60", "--rate has no effect with --config: set rate_hz of each [[endcap]] in e.toml"),
        ("--config e.toml --diameter 140", "set diameter_mm"),
        ("--config e.toml --wall 9", "set wall_mm"),
        ("--config e.toml --zero z.npz", "set zero"),
        ("--config e.toml --exposure 3", "set exposure"),
        ("--replay r.mcap --rate 60", "a recording holds its own"),
        ("--diameter 140 --wall 40", "nearest valid choice"),
        ("--camera 0 --speed 2", "--speed has no effect with --camera"),
        ("--camera 0 --speed 0", "--speed has no effect with --camera"),
        ("--replay r.mcap --check --port 0", "--port has no effect with --check"),
        ("--url http://127.0.0.1:1/ --exposure 3", "--exposure has no effect with --url"),
        ("--photos d --no-page --port 80", "--port has no effect with --no-page"),
        ("--replay r.mcap --check --record", "--record has no effect with --check"),
        ("--photos d --seconds 0", "--seconds 0: give more than 0"),
        ("--camera ²", "--camera ²: give numbers"),
        ("--camera " + "9" * 400, "give numbers"),
    ],
)
def test_an_option_that_would_be_ignored_or_is_no_number_is_refused(capsys, arguments, said):
    assert said in refused(capsys, *arguments.split())


CAP = '[[endcap]]\nname = "a"\nsource = "0"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('method = "none such"\n' + CAP, "method='none such': choose dots, gelslim"),
        (f"weight_n = {'9' * 400}\n" + CAP, "weight_n = 999"),
        (f"weight_n = {'9' * 5000}\n" + CAP, "no TOML"),
        ("a = " + "[" * 5000 + "]" * 5000 + "\n" + CAP, "no TOML"),
        (CAP + f"T_robot_endcap = [[{'9' * 400}, 0, 0, 0]]\n", "T_robot_endcap"),
        (CAP.replace('"0"', '"²"'), "²: no camera number"),
        (CAP.replace('"0"', '"' + "9" * 400 + '"'), "no camera number"),
        (CAP.replace('"0"', '"' + "x" * 5000 + '"'), "no camera number"),
        (CAP.replace('"0"', '"a\\u0000b"'), "no camera number"),
        (CAP.replace('"0"', '"http://127.0.0.1:1/"') + "exposure = 3.0\n", "exposure of a has no effect"),
        (CAP + 'name2 = "\\u001b[2J"\n', "unknown key name2"),
        ('"\\u001b[2J" = 1\n' + CAP, "unknown key \\x1b[2J"),
    ],
)  # fmt: skip
def test_a_configuration_that_cannot_be_is_one_line(tmp_path, capsys, text, said):
    path = tmp_path / "e.toml"
    path.write_text(text)
    assert said in refused(capsys, "--config", str(path), "--no-page")


@pytest.mark.parametrize(
    ("source", "setting"),
    [("scene:0", "exposure"), ("pictures", "exposure"), ("film.mp4", "exposure"), ("film.mp4", "rate_hz")],
)
def test_a_setting_that_the_source_would_ignore_is_refused(tmp_path, source, setting):
    (tmp_path / "pictures").mkdir()
    (tmp_path / "film.mp4").touch()
    word = source if source.startswith("scene") else str(tmp_path / source)
    with pytest.raises(ParameterError, match=f"^{setting} of a has no effect on {word}: leave it out"):
        open_feed(EndcapConfig("a", word, **{setting: 5.0}))


def test_a_speed_that_no_source_of_a_configuration_has_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())
    path = tmp_path / "e.toml"
    path.write_text(CAP.replace('"0"', '"http://127.0.0.1:1/"'))
    for speed in ("0", "2"):
        said = refused(capsys, "--config", str(path), "--no-page", "--seconds", "0.1", "--speed", speed)
        assert f"--speed {speed} has no effect: no source is a file" in said


def test_a_method_that_is_left_empty_is_the_models_own(tmp_path):
    path = tmp_path / "e.toml"
    path.write_text('method = ""\n' + CAP)
    assert load_config(path).method is None
    path.write_text('method = "lk"\n' + CAP)
    assert load_config(path).method == "lk"


def npy(shape: tuple[int, ...], data: bytes = b"") -> bytes:
    """An array file whose head claims a shape."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "|u1", "fortran_order": False, "shape": shape})
    return head.getvalue() + data


def png(width: int, height: int) -> bytes:
    """The smallest picture with a head that claims another size."""
    data = bytearray(cv2.imencode(".png", np.zeros((1, 1, 3), np.uint8))[1].tobytes())
    data[16:24] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    return bytes(data)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("png", npy((1 << 40,))),  # a head without the bytes
        ("png", npy((1 << 31,)) + bytes(1 << 27)),  # zeros pack to a thousandth
        ("png", npy((0,))),
        ("png", npy((len(png(1, 1)),), png(30000, 30000))),  # a picture of 2.7 GB
        ("about", npy((3,), b"abc")),
        ("about", b"no array"),
        ("noise_px", npy((1 << 62, 1 << 62))),
    ],
)
def test_a_reference_file_that_is_a_bomb_or_damaged_is_one_line(tmp_path, name, content):
    path = tmp_path / "z.npz"
    save_zero(single_zero(frames(film([0]))[0]), path)
    with zipfile.ZipFile(path) as archive:
        members = {entry: archive.read(entry) for entry in archive.namelist()} | {f"{name}.npy": content}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for entry, data in members.items():
            archive.writestr(entry, data)
    with pytest.raises(FileError, match=r"no reference file \(.+\): zero the sensor again") as caught:
        load_zero(path)
    assert "\n" not in str(caught.value)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    path = tmp_path / "b.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", npy((1 << 24,), bytes(1 << 24)))
    assert read_npz(path)["a"].size == 1 << 24
    with pytest.raises(ValueError, match="bytes when unpacked, at most 1000 allowed"):
        read_npz(path, most_bytes=1000)


def test_an_error_never_carries_what_a_terminal_obeys():
    error = ParameterError("a\x1b[2J\x07b\x9b1mc\u202ed\ne")
    assert str(error) == "a\\x1b[2J\\x07b\\x9b1mc\\u202ed\ne"
    assert printable("a\nb\r\x1b]0;title\x07") == "a\\nb\\r\\x1b]0;title\\x07"


def test_control_characters_of_a_server_do_not_reach_the_terminal():
    class Hostile(BaseHTTPRequestHandler):
        def do_GET(self):
            self.wfile.write(b"HTTP/1.0 404 \x1b[2J\x1b]0;owned\x07gone\r\n\r\n")

        def log_message(self, *_):
            """Quiet."""

    server = HTTPServer(("127.0.0.1", 0), Hostile)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with program("--url", f"http://127.0.0.1:{server.server_port}/", "--no-page") as process:
            said = next(line for line in process.stdout if "gone" in line)
            process.send_signal(signal.SIGTERM)
            rest, errors = process.communicate(timeout=PATIENCE_S)
    finally:
        server.shutdown()
    assert "\\x1b[2J" in said and process.returncode == 0
    assert not any(ord(c) < 32 and c != "\n" for c in said + rest + errors)


def test_a_camera_file_that_nests_too_deep_is_one_line(tmp_path, capsys):
    camera, config = tmp_path / "c.json", tmp_path / "e.toml"
    camera.write_text("[" * 100_000)
    picture = tmp_path / "0.jpg"
    picture.write_bytes(film([0])[0])
    config.write_text(f"[[endcap]]\nname = 'a'\nsource = {json.dumps(str(picture))}\ncamera = 'c.json'\n")
    assert "not a camera file" in refused(capsys, "--config", str(config), "--no-page")


@pytest.fixture
def large_camera(tmp_path):
    """A camera file of 1280x960 px."""
    nominal_mount(EndcapParams(130, 8), 1280, 960).save(tmp_path / "c.json")
    return tmp_path / "c.json"


def photos(folder, *pictures: bytes):
    folder.mkdir(exist_ok=True)
    for number, data in enumerate(pictures):
        (folder / f"{number}.jpg").write_bytes(data)
    return folder


SIZES = "c.json: a camera of 1280x960 px, the pictures have 640x480"


@pytest.mark.parametrize("zero", [False, True])
def test_a_camera_file_of_another_picture_size_is_refused_with_both_sizes(tmp_path, capsys, large_camera, zero):
    folder, (picture,) = photos(tmp_path / "p", *film([0])), film([0])
    text = f"[[endcap]]\nname = 'a'\nsource = {json.dumps(str(folder))}\ncamera = 'c.json'\n"
    if zero:
        save_zero(single_zero(frames([picture])[0]), tmp_path / "z.npz")
    (tmp_path / "e.toml").write_text(text + ("zero = 'z.npz'\n" if zero else ""))
    said = refused(capsys, "--config", str(tmp_path / "e.toml"), "--no-page")
    assert SIZES in said and "calibrate it again" in said


def test_where_the_size_shows_with_the_first_frames_the_state_says_so_and_nothing_is_read(large_camera):
    endcap = LiveEndcap(FileFeed(list), EndcapPipeline(EndcapConfig("a", "0", camera=large_camera), stand_in(), None))
    given = itertools.cycle(frames(film([0] * 10)))

    def refused_now() -> bool:  # the reference is taken in a thread of its own
        frame = next(given)
        assert endcap.process(Captured(frame, frame.time_s)) is None
        return endcap.health.status == "waiting for a reference"

    wait_for(refused_now)
    assert SIZES in endcap.health.message and not endcap.health.valid


def test_a_recording_with_a_camera_of_another_size_is_refused(tmp_path, capsys, monkeypatch, large_camera):
    folder, mcap = photos(tmp_path / "p", *film([0])), tmp_path / "r.mcap"
    assert main(["--photos", str(folder), "--no-page", "--speed", "0", "--record", str(mcap)]) == 0
    capsys.readouterr()
    held = read_config(mcap)
    monkeypatch.setattr(
        "sensing.live.replay.read_config",
        lambda *_: replace(held, endcaps=(replace(held.endcaps[0], camera=large_camera),)),
    )
    assert SIZES in refused(capsys, "--replay", str(mcap), "--no-page")


@pytest.mark.parametrize("words", [["--port", "TAKEN"], ["--no-page", "--output", "nosuch"]])
def test_where_another_output_cannot_begin_no_recording_is_left(tmp_path, capsys, monkeypatch, words):
    monkeypatch.setattr("sensing.live.core.warm_up.warm_up", lambda _: None)
    folder, mcap = photos(tmp_path / "p", *film([0])), tmp_path / "r.mcap"
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        refused(
            capsys, "--photos", str(folder), "--record", str(mcap), *(word.replace("TAKEN", port) for word in words)
        )
    assert not mcap.exists()


def test_a_picture_that_cannot_be_read_is_counted_and_the_rest_is_shown_recorded_and_replayed(tmp_path, capsys, caplog):
    rest, press = film([0, 1.0])
    folder, mcap = photos(tmp_path / "p", rest, rest, b"no picture", press), tmp_path / "r.mcap"
    assert main(["--photos", str(folder), "--no-page", "--speed", "0", "--record", str(mcap)]) == 1
    said = capsys.readouterr().out
    assert "4 frames, 0 dropped, 1 unusable" in said and "1 of 4 pictures cannot be read" in said
    assert f"{folder}/2.jpg: no picture" in said
    assert [line for line in caplog.messages if line.startswith("sensing.live: 1 of 4 pictures cannot be read")]
    assert main(["--replay", str(mcap), "--check"]) == 0
    assert "4 frames computed again, 0 differ" in capsys.readouterr().out
    photos(folder, b"no picture")
    assert "0.jpg: no picture" in refused(capsys, "--photos", str(folder), "--no-page")


def test_a_video_that_is_cut_says_so(tmp_path, capsys):
    path = tmp_path / "v.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30, (640, 480))
    for jpeg in film([0] * 8):
        writer.write(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))
    writer.release()
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert main(["--video", str(path), "--no-page", "--speed", "0"]) == 1
    assert "of the 8 frames that it states: is the file cut?" in capsys.readouterr().out
