"""Numbers at the command line: what is refused is said in one line that names value and form."""

import argparse

import pytest

from sensing.arguments import number


@pytest.mark.parametrize("text", ["x", "1e3", "130mm", "1_30", "nan", "１３０", ""])
def test_another_form_is_refused_by_value_and_form(text, capsys):
    parser = argparse.ArgumentParser(prog="p")
    parser.add_argument("--speed", type=number)
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--speed", text])
    said = capsys.readouterr().err.splitlines()[-1]
    assert end.value.code == 2
    assert said == f"p: error: argument --speed: {text} is not a plain decimal number: " + said.split("number: ")[1]
    assert "write it like 130 or 8.5" in said


def test_plain_decimals_are_read():
    assert [number(text) for text in ("130", "8.5", "-2.", "+.5")] == [130, 8.5, -2.0, 0.5]
