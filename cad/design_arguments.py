"""Command-line options of an endcap's design: D, T, counts and size of its dots (standard library only)."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from cad.errors import ParameterError
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_RINGS, parse_rings, rings_text
from cad.plain_numbers import plain, plain_number

DEFAULTS: dict[str, Any] = {  # option -> value of the released sensor; lengths in mm
    "diameter": 130.0,
    "wall": 8.0,
    "dot_rings": rings_text(RELEASED_RINGS),
    "dot_mm": RELEASED_DOT_MM,
}
HELP = {
    "diameter": "outer diameter D of the design (130)",
    "wall": "thickness T of its wall (8)",
    "dot_rings": f"dots of each ring from tip to equator ({rings_text(RELEASED_RINGS)})",
    "dot_mm": f"diameter of a dot ({plain(RELEASED_DOT_MM)})",
}


def number(text: str) -> float:
    """Type of an option: a plain decimal number.

    Raises:
        argparse.ArgumentTypeError: the text has another form (a ``ValueError`` would make argparse print the name of
            this function).
    """
    try:
        return plain_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_design_arguments(parser: argparse._ActionsContainer, with_defaults: bool = True) -> None:
    """Add the options of a design to a parser.

    Args:
        parser: the parser, or a group of its arguments.
        with_defaults: whether an option that is not given has the released sensor's value; otherwise it is None.
    """
    for name, usual in DEFAULTS.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=str if name == "dot_rings" else number,
            default=usual if with_defaults else None, metavar="COUNTS" if name == "dot_rings" else "MM",
            help=HELP[name],
        )  # fmt: skip


def design_of(options: argparse.Namespace) -> EndcapParams:
    """Design from the options; an option that is None takes the value of the released sensor.

    Raises:
        ParameterError: the design cannot be made.
    """
    given = {name: getattr(options, name) for name in DEFAULTS}
    chosen = {name: usual if given[name] is None else given[name] for name, usual in DEFAULTS.items()}
    return EndcapParams(chosen["diameter"], chosen["wall"], parse_rings(chosen["dot_rings"]), chosen["dot_mm"])


def agreed_design(options: argparse.Namespace, held: EndcapParams | None, path: Path | str) -> EndcapParams:
    """Design of a file, if the options that were given agree with it.

    Args:
        options: those of :func:`add_design_arguments` without defaults.
        held: design that the file records; where it records none (None), the design of the options is returned.
        path: the file, for the message.

    Raises:
        ParameterError: an option differs from the file's design, or the design cannot be made.
    """
    named = design_of(options)
    if held is None:
        return named
    of_file = {
        "diameter": held.diameter_mm, "wall": held.wall_mm, "dot_rings": held.dot_rings, "dot_mm": held.dot_mm,
    }  # fmt: skip
    of_options = {
        "diameter": named.diameter_mm, "wall": named.wall_mm, "dot_rings": named.dot_rings, "dot_mm": named.dot_mm,
    }  # fmt: skip
    other = [name for name in DEFAULTS if getattr(options, name) is not None and of_options[name] != of_file[name]]
    if other:
        typed = " ".join(f"--{name.replace('_', '-')} {_typed(of_options[name])}" for name in other)
        raise ParameterError(
            f"{typed}: {path} was taken of {held.label}, and its dots lie where that design has them: leave "
            f"{'this option' if len(other) == 1 else 'these options'} out, or give a file taken of the other endcap",
            name=other[0],
            value=of_options[other[0]],
        )
    return held


def _typed(value: Any) -> str:
    return plain(value) if isinstance(value, float) else rings_text(value)


def design_words(params: EndcapParams) -> tuple[str, ...]:
    """Options that give a design: D and T always, its dots where they differ from the released ones."""
    options = params.option_words
    own = {"--dot-rings": options.get("dots"), "--dot-mm": options.get("dot_mm")}
    words = ("--diameter", plain(params.diameter_mm), "--wall", plain(params.wall_mm))
    return (*words, *(word for flag, value in own.items() if value for word in (flag, value)))
