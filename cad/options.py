"""Parser of command options in the form NAME=VALUE, with its error messages (standard library only)."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from cad import feasible
from cad.errors import ParameterError
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_GYROID, RELEASED_RINGS, parse_rings, rings_text
from cad.plain_numbers import brief, is_plain, plain

FROM_MAKE = "--make-variables"  # option with which the Makefile passes its variables as they were typed
MAKES_OWN = ("PYTHON", "VENV")  # variables of the Makefile itself
DESIGN_DEFAULTS = {"D": "130", "T": "8"}  # the released sensor, mm
OPTION_OF = {"diameter_mm": "D", "wall_mm": "T"}  # names of fields, and the options that set them
PATTERN_DEFAULTS = {
    "dots": rings_text(RELEASED_RINGS),
    "dot_mm": plain(RELEASED_DOT_MM),
    "gyroid": plain(RELEASED_GYROID),
}
MILLIMETRES = "plain millimetres without a unit, for example D=130 T=8"
FORMS = {  # forms of the options that are not lengths, for messages
    "gyroid": "the fraction as a plain number, for example gyroid=0.1",
    "leds": "the number of LEDs in the digits 0 to 9, for example leds=8",
}


def make_variables(flags: str) -> list[str]:
    """NAME=VALUE words that were given to `make`, from its MAKEFLAGS, without the Makefile's own variables.

    No shell interprets them, so that a value may contain any character. Make puts a backslash before spaces and
    backslashes, and doubles dollar signs.
    """
    words = [match[0] for match in re.finditer(r"(?:\\.|\S)+", flags, re.DOTALL)]
    if "--" not in words:
        return []
    typed = []
    for word in reversed(words[words.index("--") + 1 :]):  # make lists them in reverse order
        name, equals, value = word.partition("=")
        plain_name = name.rstrip(":")
        if plain_name not in MAKES_OWN:
            typed.append(plain_name + equals + re.sub(r"\\(.)", r"\1", value).replace("$$", "$"))
    return typed


def parse_options(words: Sequence[str], defaults: Mapping[str, str]) -> dict[str, str]:
    """Read NAME=VALUE words; options that are not given keep their defaults.

    Raises:
        ParameterError: a name is unknown or given twice, a word has another form, or only one of D and T is given.
    """
    given: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if equals and not value and name in defaults:
            raise ParameterError(f"{word!r} has no value: give {name}=..., or leave {name} out", name=name)
        if not equals or name not in defaults:
            raise ParameterError(f"{word!r} is not an option: {_hint(word, defaults)}", name=name)
        if name in given:
            raise ParameterError(f"{name} is given twice ({given[name]} and {value}): give it once", name=name)
        given[name] = value
    if {"D", "T"} <= set(defaults) and len({"D", "T"} & set(given)) == 1:
        _refuse_half_a_design(given)
    return {**defaults, **given}


def _hint(word: str, defaults: Mapping[str, str]) -> str:
    """Suggestion for a word that is not an option."""
    name, equals, value = word.partition("=")
    known = {known.lower(): known for known in defaults}
    near = difflib.get_close_matches(name.lower(), known, n=1)
    if equals and value and near:
        return f"did you mean {known[near[0]]}={value}? Options are {', '.join(defaults)}"
    if is_plain(word) and "D" in defaults:
        return "name each number, for example D=150 T=8"
    return f"give {', '.join(f'{n}=...' for n in defaults)}"


def _refuse_half_a_design(given: Mapping[str, str]) -> None:
    """Refuse one of D and T without the other; the message proposes a pair that can be made."""
    usual_wall = float(DESIGN_DEFAULTS["T"])
    if "D" in given:
        diameter = parse_length("D", given["D"])
        low, high = feasible.wall_range_mm(diameter) if diameter > 0 else (1.0, 0.0)
        if not low <= high:
            EndcapParams(diameter, usual_wall)  # raises with its own message where no wall fits
        example = f"D={given['D']} T={plain(feasible.nearest_wall_mm(diameter, usual_wall))}"
        missing, name = "D={D} without T", "T"
    else:
        wall = parse_length("T", given["T"])
        ranges = {diameter: feasible.wall_range_mm(diameter) for diameter in (130.0, 200.0, 250.0)}
        fitting = next((diameter for diameter, (low, high) in ranges.items() if low <= wall <= high), None)
        example = f"D={plain(fitting)} T={given['T']}" if fitting else "D=130 T=8"
        missing, name = "T={T} without D", "D"
    raise ParameterError(
        f"{missing.format(**given)}: a design is two numbers, diameter and wall (6.5 mm to a fifth of the radius): "
        f"give both, for example {example}",
        name=name,
    )


def parse_length(name: str, text: str) -> float:
    """Read a length in millimetres, or a number of :data:`FORMS`: a plain decimal in the digits 0 to 9.

    Raises:
        ParameterError: the text has another form, even one that Python accepts as a number (``1_30``, ``1e2``, digits
            of other scripts).
    """
    if not is_plain(text):
        raise ParameterError(
            f"{name}={brief(text)} is not a number: give {FORMS.get(name, MILLIMETRES)}",
            name=name,
            value=text,
        )
    return float(text)


def parse_design(options: Mapping[str, str]) -> EndcapParams:
    """Design from the options D and T, and from dots and gyroid where a command has them.

    Raises:
        ParameterError: a value is not a number, or the design lies outside the feasible region.
    """
    rings = parse_rings(options.get("dots", rings_text(RELEASED_RINGS)))
    dot_mm, gyroid = (
        parse_length(name, options.get(name, plain(usual)))
        for name, usual in (("dot_mm", RELEASED_DOT_MM), ("gyroid", RELEASED_GYROID))
    )
    return EndcapParams(parse_length("D", options["D"]), parse_length("T", options["T"]), rings, dot_mm, gyroid)


def chosen(option: str, typed: str, names: Iterable[str], table: str) -> str:
    """Spelling in a table of a name that was typed in any case.

    Args:
        option: name of the option, for example ``material``.
        typed: its value as typed.
        names: names in the table; no two differ in case alone.
        table: path of the table's file in the toolkit's folder, for the message.

    Raises:
        ParameterError: there is no such row; the message lists the nearest names and all names.
    """
    by_lower = {name.lower(): name for name in names}
    if found := by_lower.get(typed.lower()):
        return found
    near = [by_lower[name] for name in difflib.get_close_matches(typed.lower(), by_lower)]
    guess = f"did you mean {' or '.join(near)}? Choose" if near else "choose"
    raise ParameterError(
        f"{option}={typed} is not in {table}: {guess} one of {', '.join(by_lower.values())}, or add a row",
        name=option,
        value=typed,
    )


@contextmanager
def named_as_typed() -> Iterator[None]:
    """Context in which errors name the option instead of the design's field: ``D=300``, not ``diameter_mm=300``."""
    try:
        yield
    except ParameterError as error:
        name, equals, rest = str(error).partition("=")
        if name not in OPTION_OF:
            raise
        raise ParameterError(f"{OPTION_OF[name]}{equals}{rest}", name=OPTION_OF[name], value=error.value) from None
