"""Sizes are typed as plain decimals; everything else that Python reads as a number is refused, in every command."""

from __future__ import annotations

import pytest

from cad.errors import ParameterError
from cad.plain_numbers import is_plain, plain, plain_number


@pytest.mark.parametrize("text", ["130", "8.5", "130.", ".5", "-3", "+7"])
def test_plain_decimals_are_read(text):
    assert is_plain(text) and plain_number(text) == float(text)


@pytest.mark.parametrize("text", ["1_30", "1e2", "nan", "inf", "\uff11\uff13\uff10", " 130", "130\n", "", ".", "0x82"])
def test_other_forms_are_refused(text):
    assert not is_plain(text)
    with pytest.raises(ParameterError, match="not a plain decimal number"):
        plain_number(text)


@pytest.mark.parametrize("number", [130.0, 8.5, 0.1, 1 / 3, 130.0000001, 1e-7])
def test_a_printed_number_reads_back(number):
    assert float(plain(number)) == number
    assert plain(130.0) == "130"


def test_a_program_of_the_sensing_side_refuses_them_too(capsys):
    from sensing.calibrate import main

    with pytest.raises(SystemExit) as caught:
        main(["--photo", "a.jpg", "--out", "c.json", "--diameter", "1_30"])
    assert caught.value.code == 2 and "--diameter" in capsys.readouterr().err
