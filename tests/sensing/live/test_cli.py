import json
import os
import re
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from live_program import camera, program
from live_stand_in import PATIENCE_S, WEIGHTS_BYTES, film, stand_in, wait_for
from long_cases import others_long

from sensing.live.cli import main
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config
from sensing.live.replay import read_config, verify
from sensing.live.web.state import hello

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def address():
    with camera() as url:
        yield url


@pytest.mark.parametrize("number", others_long([signal.SIGINT, signal.SIGTERM, signal.SIGHUP]))
def test_a_stop_is_clean_and_says_what_was_done(address, tmp_path, number):
    path = tmp_path / "run.mcap"
    with program("--url", address, "--port", "0", "--record", str(path)) as process:
        said = []
        reading = threading.Thread(target=lambda: said.extend(process.stdout), daemon=True)
        reading.start()
        wait_for(lambda: path.exists() and path.stat().st_size > WEIGHTS_BYTES + 1_700_000)
        process.send_signal(number)
        assert process.wait(PATIENCE_S) == 0
        reading.join(PATIENCE_S)
        assert [line for line in process.stderr if not line.startswith("loading the dot tracker")] == []
    assert any("frames recorded" in line for line in said)
    assert any(re.search(r"page: http://127\.0\.0\.1:\d+/", line) for line in said)
    frames = [int(m[1]) for line in said if (m := re.search(r"endcap_0: (\d+) frames, \d+ dropped", line))]
    assert len(frames) == 1 and frames[0] >= 5  # what 1.7 MB hold at least, besides the reference
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames > 10 and check.different == 0 and check.end is None


def test_json_goes_to_the_pipe_alone_and_a_closed_pipe_ends_the_run(address):
    with program("--url", address, "--no-page", "--json") as process:
        lines = [json.loads(process.stdout.readline()) for _ in range(5)]
        assert [line["endcap"] for line in lines] == ["endcap_0"] * 5
        assert sorted(line["time_s"] for line in lines) == [line["time_s"] for line in lines]
        process.stdout.close()
        assert process.wait(PATIENCE_S) == 0
        assert "Traceback" not in process.stderr.read()


def photos(folder: Path) -> Path:
    for number, picture in enumerate(film([0, 0, 1.0, 0])):
        (folder / f"{number}.jpg").write_bytes(picture)
    return folder


def test_photos_each_stand_for_themselves(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())
    assert main(["--photos", str(photos(tmp_path)), "--no-page", "--json", "--speed", "0"]) == 0
    reported = capsys.readouterr()
    lines = [json.loads(line) for line in reported.out.splitlines()]
    assert [line["contact"] for line in lines] == [False, False, True, False]
    assert lines[2]["force_n"][0] > 5 and abs(lines[3]["force_n"][0]) < 0.5  # no memory of the photo before
    assert "endcap_0: 4 frames" in reported.err


def test_what_corrects_the_forces_is_said_at_the_start_and_on_the_page(tmp_path, monkeypatch, capsys):
    """Constants of a dwell test changed every force by percents, and nothing showed that they are in use."""
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())
    path = tmp_path / "endcaps.toml"
    path.write_text(
        f'[[endcap]]\nname = "a"\nsource = "{photos(tmp_path)}"\ngain = 0.9\ngain_sd = 0.01\n'
        "relaxation = [[0.0625, 0.166, 0.01], [0.0419, 1.31, 0.004]]\n"
    )
    assert main(["--config", str(path), "--no-page", "--speed", "1000"]) == 0
    out = capsys.readouterr().out
    assert "a: calibrated by weight: gain 0.900" in out
    assert "a: rate effects corrected: 6.2 % in 0.17 s, 4.2 % in 1.3 s" in out
    config = load_config(path)
    both = replace(config, endcaps=(*config.endcaps, EndcapConfig("b", "1")))
    shown = hello(SimpleNamespace(config=both, begin_s=0.0))["hello"]
    assert [each["rate_effects"][:16] for each in shown] == ["corrected: 6.2 %", ""]


def test_rerun_is_an_option_that_says_how_to_get_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["--photos", str(photos(tmp_path)), "--no-page", "--rerun"]) == 2
    assert "pip install rerun-sdk" in capsys.readouterr().err


def test_a_video_a_recording_of_it_and_its_check(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())
    video, mcap = tmp_path / "press.avi", tmp_path / "press.mcap"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 30, (640, 480))
    for jpeg in film([0] * 3 + [0.5, 1.0, 1.0]):
        writer.write(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR))
    writer.release()
    assert main(["--video", str(video), "--no-page", "--speed", "0", "--record", str(mcap)]) == 0
    assert "6 frames recorded" in capsys.readouterr().out
    assert main(["--replay", str(mcap), "--check"]) == 0
    assert "6 frames computed again, 0 differ" in capsys.readouterr().out
    assert main(["--replay", str(mcap), "--no-page", "--json", "--speed", "0"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["contact"] is True


def test_help_is_there_without_loading_anything_heavy():
    code = (
        "import sys, sensing.live.cli; print(*{m.split('.')[0] for m in sys.modules} & {'torch', 'starlette', 'mcap'})"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment).stdout == "\n"
