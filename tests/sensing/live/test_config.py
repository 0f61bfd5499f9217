"""The configuration's file, and bad input at the command line."""

import importlib
import textwrap
import tomllib
from dataclasses import fields, replace

import numpy as np
import pytest
from live_stand_in import stand_in

from cad.errors import FileError, ParameterError
from sensing.live import open_endcaps as opening
from sensing.live.cli import main
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import EXAMPLE, NO_KEYS, load_config, save_config


def test_a_configuration_survives_the_file(tmp_path):
    pose = np.eye(4)
    pose[:3, 3] = 1.5, -2.0, 300.25
    endcaps = (
        EndcapConfig(
            "left_1", "0", tmp_path / "a.npz", contact_on_n=0.8, contact_off_n=0.5, exposure=120.0, T_robot_endcap=pose
        ),
        EndcapConfig("right", 'http://h/"s"\\', diameter_mm=120.0, wall_mm=7.0),
    )
    config = LiveConfig(endcaps, "paper", tmp_path / "w.pth", "dis", 117.7)
    save_config(config, tmp_path / "endcaps.toml")
    again = load_config(tmp_path / "endcaps.toml")
    assert [replace(a, T_robot_endcap=np.eye(4)).__repr__() for a in again.endcaps] == [
        replace(c, T_robot_endcap=np.eye(4)).__repr__() for c in endcaps
    ]
    assert np.array_equal(again.endcaps[0].T_robot_endcap, pose)
    assert (again.model, again.weights, again.method, again.weight_n) == ("paper", tmp_path / "w.pth", "dis", 117.7)


def test_the_example_to_which_a_message_points_has_every_key_and_is_read(tmp_path):
    module = importlib.import_module(EXAMPLE)
    example = "\n".join(line for line in module.__doc__.splitlines() if line.startswith("    "))
    (tmp_path / "endcaps.toml").write_text(textwrap.dedent(example))
    assert len(load_config(tmp_path / "endcaps.toml").endcaps) == 1
    shared = tomllib.loads(textwrap.dedent(example))
    (endcap,) = shared.pop("endcap")
    assert set(endcap) == {entry.name for entry in fields(EndcapConfig)}
    assert set(shared) == {entry.name for entry in fields(LiveConfig)} - set(NO_KEYS)
    with pytest.raises(FileError, match=f"pydoc {EXAMPLE}"):
        (tmp_path / "endcaps.toml").write_text("[[endcap]]\nname = 'a'\nsource = 0")
        load_config(tmp_path / "endcaps.toml")


TWO = (  # sources, place in the robot
    "[[endcap]]\nname = 'a'\nsource = '{0}'\nT_robot_endcap = [[1,0,0,{2}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n"
    "[[endcap]]\nname = 'b'\nsource = '{1}'\nT_robot_endcap = [[1,0,0,-{2}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n"
)


def test_a_file_with_a_byte_order_mark_and_two_addresses_is_read(tmp_path):
    path = tmp_path / "endcaps.toml"
    path.write_text(TWO.format("http://h/1", "http://h/2", 150), encoding="utf-8-sig")
    assert [endcap.source for endcap in load_config(path).endcaps] == ["http://h/1", "http://h/2"]


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("endcaps = 3", "unknown key endcaps"),
        ("[[endcap]]\nname = 'a'", "without name or source"),
        ("[[endcap]]\nname = 'a'\nsource = 0", "source = 0"),
        ("[[endcap]]\nname = 'a b'\nsource = '0'", "name='a b'"),
        ("[[endcap]]\nname = 'a'\nsource = '0'\nT_robot_endcap = [[1,2],[3,4]]", "T_robot_endcap"),
        ("[[endcap]]\nname = 'a'\nsource = '0'\ncontact_on_n = 1\ncontact_off_n = 2", "contact_off_n=2"),
        ("[[endcap]]\nname = 'a'\nsource = '0'\n[[endcap]]\nname = 'a'\nsource = '1'", "endcaps=a"),
        (
            "[[endcap]]\nname = 'a'\nsource = '0'\n[[endcap]]\nname = 'b'\nsource = '00'",
            "source=00 of b is the camera of a",
        ),
        ("[[endcap]]\nname = 'a'\nsource = '/dev/video7'\n[[endcap]]\nname = 'b'\nsource = '7'", "is the camera of a"),
        (
            "[[endcap]]\nname = 'a'\nsource = 'scene:1'\n[[endcap]]\nname = 'b'\nsource = 'scene:01'",
            "is the camera of a",
        ),
        ("[[endcap]]\nname = 'a'\nsource = '0'\ndiameter_mm = 12", "endcaps.toml, a: diameter_mm=12"),
        ("model = 'best'\n[[endcap]]\nname = 'a'\nsource = '0'", "endcaps.toml: model="),
        (TWO.format("http://h/1", "http://h/1", 150), "a and b have the same source, http://h/1"),
        (TWO.format("0", "1", 0.15), "within 0.15 mm of the robot's origin: give mm"),
        ("[[endcap]]\nname = 'a'\nsource = '0'\nweight_n = 60", "weight_n in the wrong place: write it above"),
        ("wall_mm = 8\n[[endcap]]\nname = 'a'\nsource = '0'", "wall_mm in the wrong place: write it under the"),
        ("model = 'best'\n[[endcap]]\nname = 'a'\nsource = '0'", "model='best'"),
        ("endcap = 3", "no list of tables"),
        ("weight_n = ", "no TOML"),
    ],
)
def test_a_bad_configuration_is_named_in_one_line(tmp_path, text, reported, capsys):
    path = tmp_path / "endcaps.toml"
    path.write_text(text)
    with pytest.raises((FileError, ParameterError), match=reported.replace("[", r"\[")):
        load_config(path)
    assert main(["--config", str(path)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["--camera", "front"],
        ["--camera", "77"],
        ["--camera", "0,2,0"],
        ["--video", "nowhere.avi"],
        ["--photos", "nowhere"],
        ["--url", "ftp://x"],
        ["--config", "nowhere.toml"],
        ["--video", "nowhere.avi", "--rate", "-1"],
    ],
)
def test_bad_input_ends_with_one_line_and_status_2(arguments, capsys, monkeypatch):
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())
    assert main(arguments) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_weights_that_cannot_be_read_are_refused_before_the_simulated_robot_is_rendered(tmp_path, monkeypatch):
    (tmp_path / "w.safetensors").write_bytes(b"no weights")
    monkeypatch.setattr(opening, "open_feed", lambda *_: pytest.fail("opened first"))
    config = LiveConfig((EndcapConfig("endcap_0", "scene:0"),), weights=tmp_path / "w.safetensors")
    with pytest.raises(FileError, match="damaged weights"):
        opening.open_endcaps(config)
