"""Options of the commands, as NAME=VALUE words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cad.errors import ParameterError


def read_options(words: Sequence[str], defaults: Mapping[str, str]) -> dict[str, str]:
    """Read NAME=VALUE words over the defaults.

    Raises:
        ParameterError: an unknown name, or a word of another form.
    """
    options = dict(defaults)
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or name not in defaults or not value:
            raise ParameterError(
                f"{word!r} is not an option: give {', '.join(f'{n}=...' for n in defaults)}", name=name
            )
        options[name] = value
    return options


def read_number(name: str, text: str, example: str) -> float:
    """Read a number.

    Raises:
        ParameterError: not a number.
    """
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"{name}={text} is not a number: give {example}", name=name, value=text) from None
