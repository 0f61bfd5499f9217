"""The design of an endcap as options of a command: D, T, counts and size of its dots (standard library only)."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from cad.errors import ParameterError
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_RINGS, parse_rings, rings_text
from cad.plain_numbers import plain, plain_number

DEFAULTS: dict[str, Any] = {
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
    """A plain decimal number, as the type of an option.

    Raises:
        argparse.ArgumentTypeError: another form; argparse would name the function where a ``ValueError`` is raised.
    """
    try:
        return plain_number(text)
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def add_design_arguments(parser: argparse._ActionsContainer, with_defaults: bool = True) -> None:
    """Add the options of a design.

    Args:
        parser: or a group of one. with_defaults: False leaves what is not given at None.
    """
    for name, usual in DEFAULTS.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=str if name == "dot_rings" else number,
            default=usual if with_defaults else None, metavar="COUNTS" if name == "dot_rings" else "MM",
            help=HELP[name],
        )  # fmt: skip


def design_of(options: argparse.Namespace) -> EndcapParams:
    """The design that the options name; what is None is the released sensor's.

    Raises:
        ParameterError: a design that cannot be made.
    """
    given = {name: getattr(options, name) for name in DEFAULTS}
    chosen = {name: usual if given[name] is None else given[name] for name, usual in DEFAULTS.items()}
    return EndcapParams(chosen["diameter"], chosen["wall"], parse_rings(chosen["dot_rings"]), chosen["dot_mm"])


def agreed_design(options: argparse.Namespace, held: EndcapParams | None, path: Path | str) -> EndcapParams:
    """The design that a file was made of, where the options that were given agree with it.

    Args:
        options: of :func:`add_design_arguments` without defaults. held: the file's design; None where it says none:
            then that of the options. path: the file.

    Raises:
        ParameterError: an option that says otherwise, or a design that cannot be made.
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
        said = " ".join(f"--{name.replace('_', '-')} {_typed(of_options[name])}" for name in other)
        raise ParameterError(
            f"{said}: {path} was taken of {held.label}, and its dots lie where that design has them: leave "
            f"{'this option' if len(other) == 1 else 'these options'} out, or give a file taken of the other endcap",
            name=other[0],
            value=of_options[other[0]],
        )
    return held


def _typed(value: Any) -> str:
    return plain(value) if isinstance(value, float) else rings_text(value)


def design_words(params: EndcapParams) -> tuple[str, ...]:
    """A design as these options: D and T always, its dots where they are not the released ones."""
    options = params.option_words
    own = {"--dot-rings": options.get("dots"), "--dot-mm": options.get("dot_mm")}
    words = ("--diameter", plain(params.diameter_mm), "--wall", plain(params.wall_mm))
    return (*words, *(word for flag, value in own.items() if value for word in (flag, value)))
