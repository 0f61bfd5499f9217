"""The command ``endcap``: its table, what it says of typos and missing libraries, and that it starts at once."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from endcap import command
from endcap.command import SUBCOMMANDS, main
from sensing.live import ending

ROOT = Path(__file__).resolve().parent.parent
INTERNAL = {  # of the checkout, started by other commands, or by who maintains the data that ship
    "fab.clean",
    "sensing.live.web.process",
    "sensing.simulator.robot.scene",
    "sensing.simulator.reduced.library.fit",
    "sensing.simulator.similarity.solve",
    "sensing.simulator.solid.own_weight_table",
}
WHOLE_DOCSTRING = re.compile(r"description=__doc__[,)]")


@pytest.mark.parametrize("name", SUBCOMMANDS)
def test_every_subcommand_has_a_module_with_a_main(name):
    spec = find_spec(SUBCOMMANDS[name].module)
    assert spec is not None and spec.origin is not None
    assert "\ndef main(" in Path(spec.origin).read_text()


def test_every_module_that_is_a_command_is_in_the_table():
    def called(module: str) -> str:
        return module.removesuffix(".__main__").removesuffix(".cli").removesuffix(".report")

    commands = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for package in ("cad", "endcap", "fab", "sensing")
        for path in (ROOT / package).rglob("*.py")
        if path.name == "__main__.py" or '__name__ == "__main__"' in path.read_text()
    }
    listed = {called(entry.module) for entry in SUBCOMMANDS.values()}
    assert {called(module) for module in commands} - INTERNAL - {"endcap"} == listed


def test_help_that_is_a_docstring_has_no_markup():
    paths = [path for package in ("endcap", "fab", "sensing") for path in (ROOT / package).rglob("*.py")]
    texts = {path: path.read_text(encoding="utf-8") for path in paths}
    shown = {name: ast.get_docstring(ast.parse(text)) for name, text in texts.items() if WHOLE_DOCSTRING.search(text)}
    assert len(shown) >= 3 and [name for name, text in shown.items() if re.search("``|:[a-z]+:`", text)] == []


def test_the_rest_of_the_line_goes_to_the_module(monkeypatch, capsys):
    seen = []

    class Module:
        @staticmethod
        def main(words):
            seen.append(words)
            return 7

    monkeypatch.setattr(command, "import_module", lambda name: Module)
    assert main(["data", "--frames", "10"]) == 7
    assert main(["help", "live"]) == 7
    assert seen == [["data", "--frames", "10"], ["--help"]]


@pytest.mark.parametrize(
    ("typed", "meant"), [("mold", "molds"), ("lvie", "live"), ("Calibrat", "calibrate"), ("--live", "live")]
)
def test_a_typo_gets_the_nearest_command(typed, meant, capsys):
    assert main([typed]) == 2
    out, err = capsys.readouterr()
    assert not out and err.count("\n") == 1
    assert f": did you mean endcap {meant}? endcap --help lists them" in err


def test_what_is_near_to_nothing_gets_no_guess(capsys):
    assert main(["xyzzy"]) == 2
    assert capsys.readouterr().err == "endcap: 'xyzzy' is not a command: endcap --help lists them\n"


def test_a_missing_library_is_one_line(monkeypatch, capsys):
    def missing(name):
        raise ModuleNotFoundError("No module named 'numba'", name="numba")

    monkeypatch.setattr(command, "import_module", missing)
    assert main(["live"]) == 2
    line = "endcap live: numba is not installed: run pip install 'endcap-toolkit[live]'\n"
    assert capsys.readouterr().err == line


def test_an_error_of_our_own_keeps_its_traceback(monkeypatch):
    def broken(name):
        raise ImportError("cannot import name 'x' from 'sensing.live'", name="sensing.live")

    monkeypatch.setattr(command, "import_module", broken)
    with pytest.raises(ImportError, match="cannot import"):
        main(["live"])


@pytest.mark.parametrize(
    ("words", "past"),
    [
        (["live"], True),
        (["-q", "setup"], True),
        (["doctor", "0"], True),
        (["cameras", "save"], True),
        (["molds"], False),
        ([], False),
    ],
)
def test_a_command_with_cameras_leaves_past_the_end_of_the_interpreter(words, past, monkeypatch):
    def leave(status):
        raise RuntimeError(f"left with {status}")  # the real one ends this process

    monkeypatch.setattr(command, "main", lambda: 3)
    monkeypatch.setattr(ending, "leave", leave)
    monkeypatch.setattr(sys, "argv", ["endcap", *words])
    with pytest.raises(RuntimeError if past else SystemExit, match="3"):
        command.program()


def test_help_that_nobody_reads_to_its_end_gives_no_traceback():
    """As in ``endcap --help | head``: the reader has gone before the text is written."""
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, "-m", "endcap", "--help"], stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


def test_help_lists_every_command_and_loads_no_library():
    code = "import sys; from endcap.command import main; main(['--help'])\n"
    code += "heavy = {'numpy', 'OCP', 'cv2', 'scipy', 'fab', 'sensing', 'argparse'} & set(sys.modules)\n"
    code += "sys.exit(f'loads {heavy}' if heavy else 0)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert result.returncode == 0, result.stderr
    assert all(f"  {name} " in result.stdout for name in SUBCOMMANDS)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["molds", "130", "8"], ["D=130", "T=8"]),
        (["molds", "130", "8", "joint_clearance=0.2"], ["D=130", "T=8", "joint_clearance=0.2"]),
        (["sheet", "D=130", "T=8"], ["D=130", "T=8"]),
        (["slice", "130", "8", "9"], ["D=130", "T=8", "9"]),
        (["cameras", "0"], ["0"]),
    ],
)
def test_numbers_at_the_start_are_the_design_where_one_is_meant(words, expected, monkeypatch):
    seen = []
    module = type("Module", (), {"main": staticmethod(lambda given: seen.extend(given) or 0)})
    monkeypatch.setattr(command, "import_module", lambda name: module)
    assert main(words) == 0
    assert seen == expected


def test_bad_input_is_that_of_the_module(capsys):
    assert main(["molds", "20", "8"]) == 2
    assert "D=20 outside" in capsys.readouterr().err
