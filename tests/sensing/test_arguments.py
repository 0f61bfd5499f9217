"""Numbers at the command line: what is refused is said in one line that names value and form."""

import argparse
import ast
from pathlib import Path

import pytest

from cad.design_arguments import add_design_arguments
from sensing.arguments import number, pair, scientific, silicone_name, whole

PACKAGES = ("endcap", "sensing")
ROOT = Path(__file__).resolve().parents[2]


def refusal(parser, words, capsys) -> str:
    with pytest.raises(SystemExit) as end:
        parser.parse_args(words)
    assert end.value.code == 2
    return capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("text", ["x", "1e3", "130mm", "1_30", "nan", "１３０", ""])
def test_another_form_is_refused_by_value_and_form(text, capsys):
    parser = argparse.ArgumentParser(prog="p")
    parser.add_argument("--speed", type=number)
    said = refusal(parser, ["--speed", text], capsys)
    assert said == f"p: error: argument --speed: {text} is not a plain decimal number: " + said.split("number: ")[1]
    assert "write it like 130 or 8.5" in said


def test_plain_decimals_are_read():
    assert [number(text) for text in ("130", "8.5", "-2.", "+.5")] == [130, 8.5, -2.0, 0.5]


@pytest.mark.parametrize("flag", ["--diameter", "--wall", "--dot-mm"])
@pytest.mark.parametrize("text", ["\u0661\u0663\u0660", "nan", "13O"])
def test_a_design_is_refused_by_value_and_form_not_by_the_name_of_a_function(flag, text, capsys):
    parser = argparse.ArgumentParser(prog="p")
    add_design_arguments(parser)
    said = refusal(parser, [flag, text], capsys)
    assert f"argument {flag}: {text} is not a plain decimal number: write it like 130" in said


@pytest.mark.parametrize("kind", [whole, scientific])
@pytest.mark.parametrize("text", ["\u0663", "x", "nan", "1_0", "9" * 5000])
def test_counts_and_small_numbers_of_another_form_are_refused(kind, text, capsys):
    parser = argparse.ArgumentParser(prog="p")
    parser.add_argument("--n", type=kind)
    assert "decimal number" in (said := refusal(parser, ["--n", text], capsys)) or "whole number" in said


@pytest.mark.parametrize("text", ["3", "3x", "3x3x3", "0x3", "3x-1", "\u0663x3", "3.5x3", "3x" + "9" * 5000])
def test_a_pair_is_two_whole_numbers(text, capsys):
    parser = argparse.ArgumentParser(prog="p")
    parser.add_argument("--n", type=pair)
    assert "write it like 30x30" in refusal(parser, ["--n", text], capsys)
    assert pair("9x6") == pair("9X6") == (9, 6)


def test_a_silicone_is_typed_in_any_case_as_for_make_molds():
    parser = argparse.ArgumentParser(prog="p")
    parser.add_argument("--silicone", type=silicone_name)
    assert parser.parse_args(["--silicone", "dragon SKIN 30"]).silicone == "Dragon Skin 30"
    assert parser.parse_args(["--silicone", "Butter"]).silicone == "Butter"  # refused where it is looked up


def test_no_option_is_of_a_type_that_reads_more_than_plain_numbers():
    """Python's int and float take digits of all scripts, ``1_0`` and, as a float, ``nan``."""
    paths = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    found = [
        f"{path.relative_to(ROOT)}:{node.value.lineno}"
        for path in paths
        if "add_argument" in (text := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.keyword) and node.arg == "type"
        if isinstance(node.value, ast.Name) and node.value.id in ("int", "float", "plain_number")
    ]
    assert not found, "take number, whole or scientific of sensing.arguments"
