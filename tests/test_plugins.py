"""Plug-ins by entry points: a distribution of somebody else is installed, and the commands use it by name."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path

import cv2
import plugin_example
import pytest
from pictured_set import write_set

from cad import plugins
from cad.errors import ParameterError
from endcap.command import main
from sensing.learning.samples import read_samples
from sensing.live.core.endcaps_file import load_config
from sensing.simulator.contact import indenter
from sensing.sources.drawn import Drawing, draw_dots

BROKEN = """\
[endcap.cameras]
absent = no_such_package:Camera
[endcap.field_methods]
nothing = broken_plugin:raises
wrong = broken_plugin:wrong
[endcap.outputs]
text = broken_plugin:TEXT
"""


def install(folder: Path, name: str, entry_points: str) -> None:
    """What an installer leaves behind: metadata that the interpreter finds."""
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(entry_points)


@pytest.fixture(autouse=True)
def fresh():
    yield
    for cached in (plugins._entries, indenter._made):
        cached.cache_clear()


@pytest.fixture
def installed(tmp_path, monkeypatch):
    install(tmp_path / "site", "my-endcap-parts", plugin_example.ENTRY_POINTS)
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    plugins._entries.cache_clear()
    return tmp_path


@pytest.fixture
def broken(tmp_path, monkeypatch):
    site = tmp_path / "bad"
    install(site, "bad-parts", BROKEN)
    (site / "broken_plugin.py").write_text(
        "TEXT = 'no function'\ndef raises(*_):\n    raise RuntimeError('no licence\\nfound')\nwrong = lambda *_: 7\n"
    )
    monkeypatch.syspath_prepend(str(site))
    plugins._entries.cache_clear()
    yield site
    sys.modules.pop("broken_plugin", None)


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), draw_dots(Drawing())[0])
    return path


def test_names_are_read_without_importing_anything(installed, monkeypatch):
    monkeypatch.delitem(sys.modules, "plugin_example")
    assert [plugins.names(kind) for kind in plugins.Kind] == [
        ("still",), ("nothing",), ("ball",), ("constant",), ("file",)
    ]  # fmt: skip
    assert "plugin_example" not in sys.modules


def test_camera_method_model_and_output_run_live(installed, picture, capsys, monkeypatch):
    lines, put = installed / "lines.txt", plugin_example.Lines.put

    def put_and_stop(self, reading):
        put(self, reading)
        os.kill(os.getpid(), signal.SIGINT)  # as a user stops it, once there is a number

    monkeypatch.setattr(plugin_example.Lines, "put", put_and_stop)
    words = ["--source", f"still:{picture}", "--model", "constant", "--output", f"file={lines}", "--seconds", "500"]
    assert main(["live", "--no-page", *words]) == 0, capsys.readouterr().err
    found = [line.split() for line in lines.read_text().splitlines()]
    assert found and {name for name, _ in found} == {"endcap_0"}
    assert float(found[-1][1]) == pytest.approx(-2.0, abs=0.2)


def test_one_camera_of_a_plug_in_for_two_endcaps_is_refused_and_a_file_is_not(installed, picture):
    """Of a copied table both readings would be of one endcap, and the robot's sum would count it twice."""
    path = installed / "endcaps.toml"
    for address, refused in (("SN-1", True), (picture, False)):
        tables = (f'[[endcap]]\nname = "{name}"\nsource = "still:{address}"\n' for name in ("a", "b"))
        path.write_text("".join(tables))
        if refused:
            with pytest.raises(ParameterError, match="a and b have the same source, still:SN-1"):
                load_config(path)
        else:
            assert len(load_config(path).endcaps) == 2


def test_outputs_that_raise_are_named_and_another_goes_on(installed, picture, capsys, monkeypatch):
    lines, put = installed / "lines.txt", plugin_example.Lines.put

    def put_and_stop(self, reading):
        if self._stream.name.endswith("closed.txt"):
            self._stream.close()
        put(self, reading)
        if self._stream.name == str(lines):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(plugin_example.Lines, "put", put_and_stop)
    outputs = [f"file={installed / 'closed.txt'}", "file=/dev/full", f"file={lines}"]
    words = ["--source", f"still:{picture}", "--model", "constant", "--seconds", "500"]
    assert main(["live", "--no-page", *words, *(word for output in outputs for word in ("--output", output))]) == 1
    assert lines.read_text()
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"sensing.live: --output {outputs[0]}: stopped (ValueError: I/O operation on closed file.); "
        "--output file=/dev/full: stopped (No space left on device)"
    )


def test_a_field_method_is_used_by_its_name(installed, picture, capsys):
    words = ["--reference", str(picture), "--frame", str(picture), "--out", str(installed / "f.npy")]
    assert main(["field", "--method", "nothing", *words]) == 0
    assert "nothing" in capsys.readouterr().out


def test_fields_of_a_method_whose_code_has_changed_are_computed_anew(tmp_path, monkeypatch):
    """Training took the fields that an earlier version of the plug-in had left beside the data."""
    code = "import numpy\nfrom plugin_example import Nothing\nfrom sensing.records import ShearField\n"
    code += "class Mine(Nothing):\n    def update(self, frame):\n"
    code += "        return ShearField(frame.time_s, numpy.full((2, *self._shape), {}, 'float32'))\n"
    install(tmp_path / "site", "own-method", "[endcap.field_methods]\nmine = own_method:Mine\n")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    plugins._entries.cache_clear()
    data, seen = write_set(tmp_path / "set", 2, 1), []
    for value in (1.0, 1.0, 2.5):
        (tmp_path / "site" / "own_method.py").write_text(code.format(value))
        shutil.rmtree(tmp_path / "site" / "__pycache__", ignore_errors=True)
        monkeypatch.delitem(sys.modules, "own_method", raising=False)
        before = {path: path.stat().st_mtime_ns for path in data.glob("fields_*")}
        seen.append((read_samples(data, "mine", (16, 16)).fields.max(), before))
    assert [float(most) for most, _ in seen] == [1.0, 1.0, 2.5]
    assert seen[1][1] == seen[2][1]  # the second time nothing was computed


@pytest.mark.long
def test_an_indenter_gives_what_the_same_body_here_gives(installed, capsys):
    said = []
    for body in ("ball", "sphere"):
        words = ["--body", body, "--radius", "30", "--normal", "2", "--friction", "0.3", "--density", "draft"]
        assert main(["press", *words]) == 0
        said.append(capsys.readouterr().out.splitlines()[:4])
    assert said[0] == said[1]  # depth, force, torque and patch, as printed


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["zero", "take", "--source", "absent:1", "--out", "z.npz"], "ModuleNotFoundError: No module named"),
        (["field", "--method", "nothing", "--reference", "a.png", "--frame", "a.png", "--out", "f.npy"], "no licence"),
        (
            ["field", "--method", "wrong", "--reference", "a.png", "--frame", "a.png", "--out", "f.npy"],
            "gave int without",
        ),
        (["live", "--no-page", "--photos", ".", "--output", "text"], "is str, not something that can be called"),
        (["live", "--no-page", "--photos", ".", "--output", "none=1"], "no plug-in adds 'none' (text installed)"),
    ],
)
def test_a_bad_plugin_is_one_line_that_names_it(broken, picture, monkeypatch, capsys, words, says):
    monkeypatch.chdir(picture.parent)
    assert main(words) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert says in said and ("bad-parts" in said or "none=1" in said) and "Traceback" not in said
    assert not (picture.parent / "f.npy").exists()


def test_two_distributions_with_one_name_are_refused(installed, broken):
    with pytest.raises(ParameterError, match="bad-parts and my-endcap-parts both add 'nothing': uninstall one"):
        plugins.load(plugins.Kind.FIELD_METHOD, "nothing")


def test_an_unknown_name_lists_those_that_are_there(installed, capsys):
    with pytest.raises(SystemExit):
        main(["press", "--body", "cube"])
    assert "'ball'" in capsys.readouterr().err
