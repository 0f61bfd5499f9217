"""Words of fab's commands: NAME=VALUE, plain numbers at the start for D and T, hints."""

from __future__ import annotations

import pytest

from cad.errors import ParameterError
from fab.command import Command, parse_options

DEFAULTS = {"D": "130", "T": "8", "exports": "exports"}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], ("130", "8")),
        (["150", "10"], ("150", "10")),
        (["150"], ("150", "8")),
        (["150", "T=9", "exports=x"], ("150", "9")),
        (["T=9", "D=150"], ("150", "9")),
    ],
)
def test_numbers_at_the_start_are_the_two_of_the_design(words, expected):
    options = parse_options(words, DEFAULTS)
    assert (options["D"], options["T"]) == expected


@pytest.mark.parametrize(
    ("words", "hint"),
    [(["d=150"], "did you mean D=150?"), (["export=x"], "did you mean exports=x?"), (["T=9", "150"], "'150' is not")],
)
def test_a_wrong_name_gets_a_hint(words, hint):
    with pytest.raises(ParameterError) as caught:
        parse_options(words, DEFAULTS)
    assert hint in str(caught.value)


def test_numbers_mean_nothing_to_a_command_without_a_design():
    with pytest.raises(ParameterError, match="'150' is not an option"):
        parse_options(["150"], {"exports": "exports"})


@pytest.mark.parametrize(("words", "says"), [(["D=150"], True), (["150"], True), (["150", "8"], False), ([], False)])
def test_an_assumed_wall_is_named(words, says, capsys):
    seen = []
    command = Command("make molds", "", "", "", DEFAULTS)
    assert command.run(words, lambda options, _: seen.append(options["T"]) or 0) == 0
    assert seen == ["8"]
    assert ("T=8 is assumed" in capsys.readouterr().err) == says
