"""docs/python.md: its blocks run, and what they call is what the commands call."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pictured_set import write_set

import endcap
from cad.dots import dot_pattern
from cad.errors import ParameterError
from endcap import Endcap
from endcap.command import main
from sensing.records_labelled import LabelledSet

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
BLOCKS = {
    title: re.findall(r"```python\n(.*?)```", part, re.S)
    for title, part in re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", TEXT, re.M | re.S)
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(title: str) -> dict[str, object]:
    (block,) = BLOCKS[title]
    names: dict[str, object] = {}
    exec(compile(block, title, "exec"), names)
    return names


def test_every_block_is_run_below():
    assert list(BLOCKS) == [
        "An endcap",
        "What it will feel",
        "Press it",
        "A data set",
        "Your own model, live and evaluated",
    ]
    assert len(re.findall(r"```python", TEXT)) == 5


def test_an_endcap():
    run("An endcap")


def test_an_endcap_of_its_own_dots_is_pressed_with_them():
    """What its simulator says of the dots is said of those that its camera sees."""
    own = Endcap(130, 8, dots="1-6-10-12-16", dot_mm=6)
    simulator, dots = own.simulator("draft"), dot_pattern(own.params)
    assert len(dots) != len(dot_pattern(Endcap(130, 8).params))
    assert simulator.markers(simulator.press(5.0, 20.0)).shape == (len(dots), 3) and simulator.geometry.dot_mm == 6


def test_what_it_will_feel(folder, capsys):
    study = run("What it will feel")["study"]
    assert main(["study", "130", "8", "folder=typed"]) == 0
    typed = capsys.readouterr().out
    assert study.blind in typed and all(figure.name in typed and figure.text in typed for figure in study.figures)
    for name in ("study.csv", "study.json", "study.html"):
        assert (folder / "typed" / name).read_bytes() == (folder / "out" / name).read_bytes()
    with pytest.raises(ParameterError, match="'weight' is no figure of a study: choose from"):
        study["weight"]


def test_press_it():
    run("Press it")


def test_a_data_set(folder):
    write_set(folder / "exports" / "data", 2, 1)
    names = run("A data set")
    frames, data = names["frames"], LabelledSet("exports/data")
    walked = list(data.frames())
    assert len(frames) == len(walked) == len(data) == 8
    for row in (0, 3, 4, 7, -1):
        assert frames[row].frame == walked[row].frame and frames[row].path == walked[row].path
    with pytest.raises(IndexError, match="index=8 outside the 8 frames"):
        frames[8]
    assert float(names["wrench"][2]) == pytest.approx(float(frames.samples().wrenches[0, 2]))


@pytest.mark.long
def test_an_own_model_is_evaluated_and_runs_live(folder):
    write_set(folder / "exports" / "data", 1, 1)
    photos = folder / "exports" / "photos"
    photos.mkdir()
    for number, item in enumerate(LabelledSet(folder / "exports" / "data").frames({0})):
        (photos / f"{number}.jpg").write_bytes(item.frame.jpeg)
    scores = run("Your own model, live and evaluated")["scores"]
    ours = scores["ours, data"]
    assert ours.count == 4 and 0.5 < ours.rmse[2] < 20  # says -1 N along z, whatever is pressed


def test_the_command_and_the_api_export_through_one_function(folder, monkeypatch, capsys):
    calls = []

    def made(variant, folder, interrupts, progress, use_cache, where):
        calls.append((variant, use_cache))
        (folder / "manifest.json").write_text("{}")
        return "1 file"

    monkeypatch.setattr("fab.molds.cached_molds", made)
    assert Endcap(150, 10, "Dragon Skin 30", 0.2).export("out") == Path("out/D150_T10_c0.2_Dragon-Skin-30")
    words = ["150", "10", "material=Dragon Skin 30", "joint_clearance=0.2", "exports=out", "cache=no"]
    assert main(["molds", *words]) == 0
    assert [made[0] for made in calls] == [calls[0][0]] * 2 and [made[1] for made in calls] == [True, False]
    assert "out/D150_T10_c0.2_Dragon-Skin-30: 1 file" in capsys.readouterr().out


def test_every_option_of_the_design_is_one_of_the_api(folder, monkeypatch):
    def made(variant, folder, *_):
        (folder / "manifest.json").write_text("{}")
        return variant.words

    monkeypatch.setattr("fab.molds.cached_molds", made)
    mine = Endcap(150, 10, joint_clearance_mm=0.2, dots="1-6-10-12", dot_mm=5, gyroid=0.12)
    assert mine.export("out") == Path("out/D150_T10_dots1-6-10-12_dot_mm5_gyroid0.12_c0.2")


def test_numbers_of_numpy_are_those_of_python():
    mine = Endcap(
        np.int64(130), np.float32(8), joint_clearance_mm=np.float32(0.125), dot_mm=np.int32(5), gyroid=np.float64(0.12)
    )
    same = Endcap(130, 8, joint_clearance_mm=0.125, dot_mm=5, gyroid=0.12)
    assert (mine.params, mine.layout) == (same.params, same.layout)
    assert {type(value) for value in (mine.params.diameter_mm, mine.params.wall_mm, mine.params.gyroid)} == {float}
    assert type(mine.layout.joint_clearance_mm) is float


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"joint_clearance_mm": "0.15"},
            "joint_clearance='0.15' is not a number: give millimetres a side, for example 0",
        ),
        ({"joint_clearance_mm": True}, "joint_clearance=True is not a number"),
        ({"dots": (1, 6, 10)}, "dots=(1, 6, 10) is not a text: give the dots of each ring as '1-6-10-12-16-18-20'"),
        ({"dots": ()}, "dots=() is not a text"),
        ({"dot_mm": "4"}, "dot_mm='4' is not a number: give millimetres, for example dot_mm=4"),
        ({"gyroid": np.bool_(True)}, "gyroid=np.True_ is not a number: give a fraction, for example gyroid=0.1"),
        ({"gyroid": 0.2}, "gyroid=0.2 outside 0.08..0.12"),
        ({"dot_mm": 10**400}, "dot_mm=inf is not a positive finite number"),
    ],
)
def test_values_of_another_kind_are_refused_in_one_line(options, message):
    with pytest.raises(ParameterError, match=re.escape(message)) as caught:
        Endcap(130, 8, **options)
    assert "\n" not in str(caught.value)


def test_importing_the_api_loads_the_standard_library_only():
    code = "import sys, endcap; dir(endcap); print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {"numpy", "cad", "fab", "sensing", "OCP"} & set(done.stdout.split())
    with pytest.raises(AttributeError, match="it has DataSet, Endcap, Simulator"):
        endcap.Sphere  # noqa: B018


def test_bad_endcaps_are_refused_at_once():
    with pytest.raises(ValueError, match="wall_mm=3"):
        Endcap(130, 3)
    with pytest.raises(ValueError, match="silicone='Jelly'"):
        Endcap(130, 8, "Jelly")
