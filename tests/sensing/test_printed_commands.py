"""Commands that programs print, and those of their help and docstrings, against the parsers of their modules."""

from __future__ import annotations

import argparse
import ast
import html
import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import cv2
import pytest
from command_lines import parser_of, refusal
from test_architecture import ROOT

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.calibration.command_for import calibrate_command
from sensing.calibration.misfit import Misfit
from sensing.calibration.other_design import OtherDesignError
from sensing.calibration.rest_camera import RestCamera
from sensing.design.page import study_page
from sensing.design.pressed import Study
from sensing.design.prints import sliced_prints
from sensing.live.core.camera_check import _advice
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import live_command
from sensing.robot.node.replay import Recording
from sensing.sources.drawn import Drawing, draw_dots
from sensing.wrench.weight_files import command_for
from sensing.zero import main as zero

OWN = EndcapParams(187.3, 12.6, (1, 5, 11, 17), 6.3)
SPACED = Path("my films", "it's 0.npz")
BAD = Misfit(9.0, 0.0, False, "camera turned by 1.4 degrees (0.1); shifted")
SOURCES = sorted((ROOT / "sensing").rglob("*.py"))


def command_in(text: str) -> str:
    """The command that a message names last, to its end."""
    return text[text.rindex(" ", 0, text.rindex("python -m ")) + 1 :]


def advice(rest: RestCamera, zero: Path | None = SPACED) -> str:
    return _advice(EndcapConfig("endcap_0", "0", zero, 187.3, 12.6, dots="1-5-11-17", dot_mm=6.3), rest)


@pytest.mark.parametrize("params", [EndcapParams(130.0, 8.0), OWN], ids=["released", "own dots"])
@pytest.mark.parametrize("reference", [None, SPACED])
@pytest.mark.parametrize("trusted", [False, True])
def test_the_command_that_calibrates_is_whole_and_quoted(params, reference, trusted):
    said = calibrate_command(params, SPACED.with_suffix(".json"), reference, trusted)
    assert refusal(said) == "" and str(SPACED.with_suffix(".json")) in shlex.split(said)
    assert ("--dot-rings" in said) == (params is OWN) and ("--trust-design" in said) == trusted
    assert reference is None or str(reference) in shlex.split(said)


def test_the_reference_of_another_design_names_a_command_that_parses(tmp_path, capsys):
    picture, _ = draw_dots(Drawing())
    (folder := tmp_path / "my films").mkdir()
    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    out = folder / "it's 0.npz"
    assert zero(["take", "--source", str(folder), "--out", str(out), "--diameter", "99", "--wall", "8"]) == 0
    said = command_in(capsys.readouterr().err.strip())
    assert refusal(said) == "" and said == calibrate_command(EndcapParams(99, 8), out.with_suffix(".json"), out)


def test_live_names_the_design_and_the_reference_of_the_endcap():
    found = SimpleNamespace(camera=None, misfit=BAD, found=True, doubt="", other_design=False)
    for rest in (found, RestCamera(None, BAD)):
        said = command_in(advice(rest))
        assert refusal(said) == ""
        assert said == calibrate_command(OWN, "endcap_0.json", SPACED)


def test_live_names_no_option_that_it_lacks():
    """``--trust-design`` is of ``sensing.calibrate``, and live has to say so."""
    error = OtherDesignError("another design fits this photo better")
    said = advice(RestCamera(None, BAD, doubt=error.found, other_design=True))
    command = command_in(said[: said.index(" and name that file")])
    assert refusal(command) == "" and command == calibrate_command(OWN, "endcap_0.json", SPACED, trusted=True)
    assert "--trust-design" not in said.replace(command, "") and "--trust-design" in str(error)


@pytest.mark.parametrize("silicone", ["Smooth-Sil 950", "Dragon Skin 20"])
def test_the_commands_of_weights_and_of_a_configuration_parse(silicone):
    for said in (command_for(OWN, silicone), live_command(SPACED.with_suffix(".toml"))):
        assert refusal(said) == ""
    assert "my films/it's 0.toml" in shlex.split(live_command(SPACED.with_suffix(".toml")))


def test_the_commands_of_a_study_parse():
    page = html.unescape(study_page(Study(EndcapParams(111, 7.1, dot_mm=3.5), "Dragon Skin 20"), []))
    found = re.findall(r"python -m [^<\n]+", page)
    assert found and [refusal(command) for command in found] == [""] * len(found)


def test_slicing_again_is_of_the_very_design(tmp_path):
    (tmp_path / "slice.json").write_text("{}")
    with pytest.raises(FileError, match=r"make slice D=187\.3 T=12\.6 dots=1-5-11-17 dot_mm=6\.3 again"):
        sliced_prints(OWN, tmp_path / "slice.json")


def test_the_command_that_records_a_robot_names_a_file(tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(FileError) as refused:
        Recording(tmp_path / "a.mcap")
    assert refusal(command_in(str(refused.value))) == ""


def test_the_commands_of_help_and_docstrings_parse():
    """Lines of their own; what follows two spaces says what the command does."""
    trees = [ast.parse(text) for path in SOURCES if "python -m sensing" in (text := path.read_text(encoding="utf-8"))]
    texts = [node.value for tree in trees for node in ast.walk(tree) if is_text(node)]
    lines = [line.strip() for text in texts for line in text.splitlines() if line.strip().startswith("python -m sens")]
    commands = [re.split(r" {2,}|\s[|#&]", line)[0] for line in lines]
    assert len(commands) > 50
    assert {command: said for command in commands if (said := refusal(command))} == {}


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and "\n" in node.value


@pytest.mark.parametrize(
    "command",
    [
        "python -m sensing.calibrate --zero a.npz", "python -m sensing.live --trust-design",
        "endcap calibrate --zero my films/a.npz --out a.json", "python -m sensing.robot --record --live b",
    ],
)  # fmt: skip
def test_a_command_that_does_not_parse_is_seen(command):
    assert refusal(command)


def unexplained(parser: argparse.ArgumentParser) -> list[str]:
    """Options without a word of help and commands without a description, of a parser and those below it."""
    found = [] if parser.description else [parser.prog]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found += [name for below in action.choices.values() for name in unexplained(below)]
        elif not action.help:
            found.append(f"{parser.prog} {'/'.join(action.option_strings) or action.dest}")
    return found


@pytest.mark.parametrize(
    "module",
    [
        "setup",
        "live",
        "zero",
        "record",
        "train",
        "evaluate",
        "calibrate",
        "field",
        "simulator",
        "weigh",
        "dwell",
        "robot",
    ],
)
def test_help_has_words_for_each_command_and_option(module):
    parser = parser_of(f"sensing.{module}")
    assert parser is not None and unexplained(parser) == []
