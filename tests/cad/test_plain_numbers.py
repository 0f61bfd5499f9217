"""Sizes are typed as plain decimals; everything else that Python reads as a number is refused, in every command."""

from __future__ import annotations

import pytest

from cad.errors import ParameterError
from cad.plain_numbers import is_plain, plain, plain_number, stored_number, whole_number


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


LONG = "9" * 5000  # Python refuses so long a whole number, and takes so long a decimal one for infinity


@pytest.mark.parametrize("read", [plain_number, whole_number, stored_number])
@pytest.mark.parametrize("text", [LONG, "\u0663", "nan", "inf", "1_0", "", "x\ny"])
def test_no_reader_takes_what_is_no_number_and_each_says_so_in_a_short_line(read, text):
    with pytest.raises(ParameterError) as caught:
        read(text)
    assert len(str(caught.value)) < 160 and "\n" not in str(caught.value)


def test_whole_and_stored_numbers_are_read():
    assert [whole_number(text) for text in ("30", "-1", "+7", "007")] == [30, -1, 7, 7]
    assert [stored_number(text) for text in ("8.5", " 1e-05", "-1.20E+01 ", "3")] == [8.5, 1e-5, -12.0, 3.0]
    for text in ("8.5", "1e2", " 3"):
        with pytest.raises(ParameterError, match="not a whole number"):
            whole_number(text)
    with pytest.raises(ParameterError, match="nothing is not a finite"):
        stored_number(None)
