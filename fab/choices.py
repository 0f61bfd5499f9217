"""What a person types against what can be made: names of tables in any case, and errors that name options as typed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from cad.errors import ParameterError

OPTION_OF = {"diameter_mm": "D", "wall_mm": "T"}  # names of fields, and the options that set them


def chosen(option: str, typed: str, names: Iterable[str], table: str) -> str:
    """A name as its table writes it; upper and lower case count as one.

    Args:
        option: as typed, for example ``material``.
        typed: its value.
        names: rows of the table; no two differ in case alone.
        table: its file, from the toolkit's folder.

    Raises:
        ParameterError: no such row; the message has the nearest names, and all.
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
    """Errors about a field of the design begin with the option that set it: ``D=300``, not ``diameter_mm=300``."""
    try:
        yield
    except ParameterError as error:
        name, equals, rest = str(error).partition("=")
        if name not in OPTION_OF:
            raise
        raise ParameterError(f"{OPTION_OF[name]}{equals}{rest}", name=OPTION_OF[name], value=error.value) from None
