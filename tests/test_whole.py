"""Everything of one endcap: which commands run with which words, what their failures do, and the page at the end."""

from __future__ import annotations

import html
import json
import os
import re
import signal
import threading
import time
from pathlib import Path
from urllib.parse import unquote_to_bytes

import pytest

from cad.errors import ParameterError
from cad.options import parse_design
from cad.typed_folder import EXPORTS
from endcap import whole
from endcap.start_page import PAGE, write_page
from endcap.whole import Step, make, parsed
from sensing import study

MADE = {"checks": [{"name": "a"}, {"name": "b"}]}


def runner(wanted, seen: list[Step], status: dict[str, int] | None = None):
    """Stands in for the commands: writes what they would leave."""

    def run(step: Step) -> int:
        seen.append(step)
        folder = wanted.exports / wanted.variant.label
        if step.module == "fab.molds":
            folder.mkdir(parents=True)
            (folder / "manifest.json").write_text(json.dumps(MADE))
            (folder / "base.stl").write_text("solid")
            (folder / "shell.stl").write_text("solid")
        if step.module == "sensing.study":
            (folder / "study").mkdir()
            (folder / "study" / "study.csv").write_text(
                "key,name,value,unit,source,note\nrange_n,range <of> it,54.6875,N,computed,\nx,y,,%,unknown,\n"
                "plastic_g,plastic,1065.6,g,measured,\n"
            )
        return (status or {}).get(step.module, 0)

    return run


def test_every_command_gets_d_and_t_and_the_page_lists_what_it_made(tmp_path):
    wanted = parsed(["D=180", "T=10", "material=Dragon Skin 20", f"exports={tmp_path}"])
    seen: list[Step] = []
    assert make(wanted, runner(wanted, seen)) == 0
    assert [step.module for step in seen] == [
        "fab.molds", "fab.slice", "fab.build_sheet", "fab.led_ring", "sensing.train", "endcap.robot_model",
        "sensing.study",
    ]  # fmt: skip
    for step in seen:
        assert {"D=180", "T=10"} <= set(step.words) or "--design 180 10" in " ".join(step.words)
    assert all("Dragon Skin 20" in " ".join(step.words) for step in seen if step.module != "fab.led_ring")
    page = (tmp_path / "D180_T10_Dragon-Skin-20" / PAGE).read_text()
    for words in (
        "2 checks",
        "range &lt;of&gt; it",
        "54.7 N",
        "<td>–</td>",
        "1066 g",
        'base.stl">base.stl</a></td><td>part as a mesh, to slice',
        'shell.stl">shell.stl</a></td><td>the dome as it is cast, as a mesh; it is not printed',
        "study/study.csv",
        "sensing.live --diameter 180 --wall 10 --silicone &#x27;Dragon Skin 20&#x27;",
        "make coupons material=&#x27;Dragon Skin 20&#x27; exports=",
    ):
        assert words in page
    assert not list(tmp_path.rglob("*.part"))


def test_files_of_ones_own_are_linked_whatever_their_names(tmp_path):
    """A # began an anchor, a % an escape; a name in Latin-1 ended the command with a traceback."""
    wanted = parsed([f"exports={tmp_path}"])
    wanted.folder.mkdir()
    names = ["a photo #1 of 100%.jpg", "Stra\u00dfe.txt", os.fsdecode(b"M\xe4rz.txt")]
    for name in names:
        (wanted.folder / name).touch()
    write_page(wanted.variant, wanted.exports, "", [])
    links = re.findall('<td><a href="([^"]*)">', (wanted.folder / PAGE).read_text(encoding="utf-8"))
    assert sorted(unquote_to_bytes(link) for link in links) == sorted(os.fsencode(name) for name in names)
    assert "#" not in "".join(links)


def test_the_study_is_of_the_very_design(tmp_path):
    """It refuses slices of another one, and a gyroid of one's own makes another one."""
    options = ["D=180", "T=10", "dots=1-8-12-16-20-24", "dot_mm=4.4", "gyroid=0.09", f"exports={tmp_path}"]
    wanted = parsed(options)
    words = next(step.words for step in wanted.steps() if step.module == "sensing.study")
    assert parse_design(study._options(words)) == wanted.variant.params


def test_the_printer_goes_to_the_commands_that_print_and_to_no_other(tmp_path):
    wanted = parsed(["D=142", "T=7.5", "printer=a1_mini", f"exports={tmp_path}"])
    seen: list[Step] = []
    assert make(wanted, runner(wanted, seen)) == 0
    assert {step.module for step in seen if "printer=a1_mini" in step.words} == {
        "fab.molds", "fab.slice", "fab.build_sheet",
    }  # fmt: skip
    assert f"make sheet D=142 T=7.5 printer=a1_mini exports={tmp_path}" in (tmp_path / "D142_T7.5" / PAGE).read_text()
    assert not any("printer" in word for step in parsed([]).steps() for word in step.words)
    own = parsed(["D=142", "T=7.5", "printer=my bed", f"exports={tmp_path}"])  # a row of one's own
    write_page(own.variant, own.exports, own.printer, [])
    page = html.unescape((own.folder / PAGE).read_text())
    assert f"make sheet D=142 T=7.5 printer='my bed' exports={tmp_path}" in page


def test_a_failure_stops_it_but_for_a_slicer_that_is_not_there(tmp_path, capsys):
    wanted = parsed([f"exports={tmp_path / 'a'}"])
    seen: list[Step] = []
    assert make(wanted, runner(wanted, seen, {"fab.slice": 2})) == 0
    assert "left out: slicer projects" in capsys.readouterr().out
    for module in ("fab.slice", "endcap.robot_model"):  # a gate that did not hold is no slicer that is not there
        wanted = parsed([f"exports={tmp_path / module}"])
        assert make(wanted, runner(wanted, seen, {module: 1})) == 1
        assert "failed" in capsys.readouterr().err
    wanted = parsed([f"exports={tmp_path / 'b'}"])
    assert make(wanted, runner(wanted, seen, {"fab.build_sheet": 1})) == 1
    assert "build sheet failed" in capsys.readouterr().err and not (tmp_path / "b" / "D130_T8" / PAGE).exists()
    wanted = parsed([f"exports={tmp_path / 'c'}"])
    assert make(wanted, runner(wanted, seen, {"fab.molds": 2})) == 2


WAITS = """
import pathlib, signal, sys, time
place = pathlib.Path(sys.argv[1])
signal.signal(signal.SIGTERM, lambda *_: (place.joinpath("tidied").touch(), sys.exit(143)))
place.joinpath("ready").touch()
time.sleep(60)
"""


def test_a_command_under_way_removes_what_it_began_when_all_is_ended(tmp_path, monkeypatch, capsys):
    (tmp_path / "waits.py").write_text(WAITS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(whole.Wanted, "steps", lambda _: [Step("molds", "waits", (str(tmp_path),))])

    def end() -> None:
        while not (tmp_path / "ready").exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=end, daemon=True).start()
    assert whole.main([f"exports={tmp_path}"]) == 128 + signal.SIGTERM
    assert (tmp_path / "tidied").exists()
    assert capsys.readouterr().err.splitlines()[-1] == "make endcap: ended by SIGTERM; what was made before stays"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["D=180"], "D=180 without T"),
        (["D=180", "T=40"], "nearest valid choice"),
        (["D=1e2", "T=8"], "plain millimetres"),
        (["d=180", "T=8"], "did you mean D=180"),
        (["D=180", "T=10", "material=Jelly"], "choose one of"),
        (["D=250", "T=25", "material=Dragon Skin 10 Medium"], "the pot life is 20"),  # the sheet refused it at last
    ],
)
def test_bad_words_are_refused(words, said):
    with pytest.raises(ParameterError, match=said):
        parsed(words)


def test_makes_variables_are_read_as_they_were_typed(monkeypatch):
    monkeypatch.setenv("MAKEFLAGS", r"w -- material=Dragon\ Skin\ 20 T=10 D=180 PYTHON=python3")
    wanted = parsed([whole.FROM_MAKE])
    assert wanted.variant.params.label == "D180_T10" and wanted.variant.silicone == "Dragon Skin 20"
    assert wanted.exports == Path(EXPORTS)


def test_help_and_errors_of_the_command(capsys):
    assert whole.main(["--help"]) == 0 and "start.html" in capsys.readouterr().out
    assert whole.main(["D=180"]) == 2 and len(capsys.readouterr().err.splitlines()) == 1
